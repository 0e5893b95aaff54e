"""Rotation of mesh links from mesh axes to frame axes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.files.solved_links import solved_link
from forcefit.assembly.model.mesh_link import mesh_link_stiffness, mesh_rotation
from forcefit.inputs.table import BadInput
from forcefit.stiffness.link import scaled
from forcefit.stiffness.screws import rotation_vector, screw_map
from forcefit.stiffness.surface.beam_surfaces import shape_surface

numbers = st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(
    lambda v: np.linalg.norm(v) > 1e-3
)


@given(a=numbers, b=numbers)
def test_mesh_rotation_aligns_the_spans_by_the_smallest_angle(a, b):
    a, b = np.array(a), np.array(b)
    R = mesh_rotation(a, b)
    assert np.allclose(R @ a / np.linalg.norm(a), b / np.linalg.norm(b), atol=1e-9)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
    angle = np.linalg.norm(rotation_vector(R))
    assert np.cos(angle) == pytest.approx(np.clip(cosine, -1, 1), abs=1e-9)


@pytest.mark.parametrize("b", [[0, 0, 2.0], [0, 0, -2.0]])
def test_mesh_rotation_aligns_parallel_and_opposite_spans(b):
    R = mesh_rotation(np.array([0, 0, 0.5]), np.array(b))
    assert np.allclose(R @ [0, 0, 1], np.array(b) / 2, atol=1e-15)


def test_up_directions_determine_the_rotation_about_the_span():
    """The mesh z axis is the x axis of the frame; the mesh x axis is its z axis."""
    R = mesh_rotation(
        np.array([0, 0, 1.0]), np.array([2.0, 0, 0]), (1, 0, 0), (0, 0, 1)
    )
    assert np.allclose(R, [[0, 0, 1], [0, 1, 0], [1, 0, 0]] @ np.diag([1, -1, 1]))
    assert np.allclose(R @ [1, 0, 0], [0, 0, 1])
    assert np.allclose(R @ [0, 0, 1], [1, 0, 0])


# --- mesh links after a prismatic joint --------------------------------------------

RAM = """
name = "ram"
platform = "tool"
[[frame]]
name = "slide"
parent = "base"
joint = "prismatic"
actuated = true
position = {position}
[[frame]]
name = "tool"
parent = "slide"
{more}
[frame.link]
mesh = {{ surface = "bar.stl", base = "z=0", tip = "z=0.08" {axis} }}
young = 6e10
poisson = 0.3
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Return a folder for meshes that the tests share."""
    return tmp_path_factory.mktemp("meshes")


@pytest.fixture
def ram(tmp_path, monkeypatch, cache):
    """Return the path of a robot file with a mesh link after a prismatic joint."""
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setenv("FORCEFIT_CACHE", str(cache))
    bar = shape_surface("rectangle", {"length": 0.08, "width": 0.02, "height": 0.02})
    surface = pyvista.PolyData.from_regular_faces(bar.points, bar.triangles)
    surface.save(tmp_path / "bar.stl")

    def written(axis="", more="", position=0):
        path = tmp_path / "ram.toml"
        path.write_text(RAM.format(axis=axis, more=more, position=position))
        return path

    return written


def stiffness(frame):
    """Return the stiffness of a mesh link."""
    return mesh_link_stiffness(replace(frame, link=solved_link(frame)))


@pytest.mark.slow
def test_mesh_stiffness_after_a_slide_is_rotated_to_its_axis(ram):
    """The stiffness for an axis along x is the rotated stiffness for z."""
    spelt = read_robot(ram(more="translation = [0, 0, 0.08]")).frame("tool")
    K = stiffness(spelt).stiffness
    along_z = read_robot(ram(", axis = [0, 0, 2]")).frame("tool")
    assert np.abs(scaled(stiffness(along_z).stiffness - K, K)).max() < 1e-12
    along_x = read_robot(ram(", axis = [1, 0, 0]")).frame("tool")
    turn = screw_map(np.zeros(3), mesh_rotation(np.eye(3)[2], np.eye(3)[0]))
    turned = stiffness(along_x).stiffness
    assert np.abs(scaled(turned - turn @ K @ turn.T, turned)).max() < 1e-12
    assert turned[3, 3] == pytest.approx(K[5, 5])


def test_mesh_axis_after_a_slide_is_read_and_written(ram, tmp_path):
    robot = read_robot(ram(", axis = [0, 0, 1]", position=0.05))
    assert robot.frame("tool").link.axis == (0.0, 0.0, 1.0)
    write_robot(robot, tmp_path / "again.toml")
    again = read_robot(tmp_path / "again.toml").frame("tool").link
    assert again == robot.frame("tool").link


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, 'link: found a distance of 0 m from .*, or a mesh with "axis"'),
        ({"more": "translation = [0, 0, 0.1]", "position": 0.1},
         'home position of 0.1 m; expected a home position of 0'),
        ({"axis": ", axis = [0, 0, 0]"}, "mesh.axis: found .*, expected a nonzero"),
        ({"axis": ", axis = [0, 0, 1], up = [1, 0, 0]", "more": "up = [0, 0, 3]"},
         r'"tool".up: up = .* lies along the axis .*; expected a different direction'),
    ],
)  # fmt: skip
def test_mesh_without_a_direction_is_rejected(ram, changes, message):
    with pytest.raises(BadInput, match=message):
        read_robot(ram(**changes))


def test_up_direction_along_the_mesh_axis_is_rejected(ram):
    path = ram(", axis = [0, 0, 1], up = [0, 0, 1]", "up = [1, 0, 0]")
    message = r'"tool".link.mesh: up = .* lies along the axis .*; expected a different'
    with pytest.raises(BadInput, match=message):
        solved_link(read_robot(path).frame("tool"))
