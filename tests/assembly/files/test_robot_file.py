"""Reading and writing of robot files."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.robot import (
    BeamLink,
    Clearance,
    Frame,
    LibraryLink,
    MatrixLink,
    MeshLink,
    Robot,
)
from forcefit.inputs.table import BadInput
from tests.robot_files_for_tests import (
    BEAM,
    FOUR_BAR,
    LINK,
    PLAY,
    SLIDER,
    SPRING,
    mesh,
    rows,
)

LOADS = {
    "byte order mark": lambda t: "\ufeff" + t,
    "CRLF": lambda t: t.replace("\n", "\r\n"),
    "integers for floats": lambda t: re.sub(r"\b(\d)\.0\b", r"\1", t),
    "quoted keys": lambda t: t.replace("radial =", '"radial" =').replace(
        "name =", "'name' ="
    ),
    "block tables": lambda t: t.replace(
        PLAY, "[frame.clearance]\nradial = 29e-6\nspin = 3.0"
    ),
    "dotted keys": lambda t: t.replace(
        PLAY, "clearance.radial = 29e-6\nclearance.spin = 3.0"
    ),
    "actuated = false on a fixed joint": lambda t: t.replace(
        "mass = 1.2", "mass = 1.2\nactuated = false\njoint = 'fixed'"
    ),
    "six rows for six terms": lambda t: t.replace(
        SPRING,
        "joint_stiffness = [[1e8,0,0,0,0,0], [0,1e8,0,0,0,0], [0,0,1,0,0,0],"
        "\n[0,0,0,3e8,0,0], [0,0,0,0,3e8,0], [0,0,0,0,0,inf]]",
    ),
    "zeros written out": lambda t: t.replace(
        "mass = 1.2", "mass = 1.2\ngeometric_error = [0,0,0,0,0,0]\nrotation = [0,0,0]"
    ),
    "dh": lambda t: t.replace("translation = [0.3, 0, 0]", "dh = { a = 0.3 }"),
    "comments": lambda t: t.replace("\n", " # really\n"),
}


@pytest.mark.parametrize("change", LOADS.values(), ids=LOADS)
def test_equivalent_files_describe_the_same_robot(change, write_file, tmp_path):
    expected = read_robot(write_file(FOUR_BAR))
    changed = change(FOUR_BAR)
    assert changed != FOUR_BAR
    assert_same_robot(read_robot(write_file(changed)), expected)


@pytest.mark.parametrize("seed", range(5))
def test_home_pose_does_not_depend_on_frame_order(seed, write_file):
    head, *frames = FOUR_BAR.split("[[frame]]")
    frames[-1], closure = frames[-1].split("[[closure]]")
    mixed = np.random.default_rng(seed).permutation(len(frames))
    text = "[[frame]]".join([head, *(frames[i] for i in mixed)])
    robot = read_robot(write_file(f"{text}[[closure]]{closure}"))
    expected = read_robot(write_file(FOUR_BAR))
    assert {f.name for f in robot.frames} == {f.name for f in expected.frames}
    here, there = home_posture(robot), home_posture(expected)
    np.testing.assert_allclose(here.platform, there.platform, rtol=0, atol=1e-12)


def test_dh_transform_equals_product_of_four_factors(write_file):
    """The factors are Rot(z, theta) Trans(z, d) Trans(x, a) Rot(x, alpha)."""
    text = SLIDER.replace("translation = [0.3, 0.0, 0.2]\n", "").replace(
        "rotation = [0.0, 1.5707963267948966, 0.0]",
        "dh = { theta = 0.3, d = 0.1, a = 0.2, alpha = -1.1 }",
    )
    robot = read_robot(write_file(text))
    c, s, ca, sa = math.cos(0.3), math.sin(0.3), math.cos(-1.1), math.sin(-1.1)
    turn_z = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]])
    turn_x = np.array([[1, 0, 0, 0.2], [0, ca, -sa, 0], [0, sa, ca, 0], [0, 0, 0, 1]])
    T = robot.fixed_transforms[robot.index("tool")]
    np.testing.assert_allclose(T, turn_z @ turn_x, rtol=0, atol=1e-15)


def test_beam_length_equals_distance_of_origins_at_home(write_file):
    """The length is sqrt(0.3^2 + 0.4^2) m with a slide coordinate of 0.2 m."""
    link = read_robot(write_file(SLIDER)).frame("tool").link
    assert link.length == pytest.approx(0.5, rel=1e-15)
    # the frame is rotated by 90 degrees about y relative to the slide
    np.testing.assert_allclose(link.axis, [-0.8, 0.0, 0.6], rtol=0, atol=1e-15)
    at_zero = read_robot(write_file(SLIDER.replace("position = 0.2", ""))).frame("tool")
    assert at_zero.link.length is None


def test_mesh_after_a_slide_with_nonzero_coordinate_is_rejected(write_file):
    path = write_file(SLIDER.replace("beam = { radius = 0.01 }", mesh()))
    with pytest.raises(
        BadInput, match=r'"tool"\.link\.mesh: found a mesh on a frame after'
    ):
        read_robot(path)


def test_rounded_stiffness_matrix_is_made_symmetric(write_file):
    K = rows({(1, 2): 0.1234567, (2, 1): 0.1234568})
    path = write_file(FOUR_BAR.replace(LINK, f"link = {{ stiffness = {K} }}"))
    K = read_robot(path).frame("coupler").link.stiffness
    np.testing.assert_array_equal(K, K.T)


def test_relative_paths_refer_to_folder_of_robot_file(write_file, tmp_path):
    for path, expected in [
        ("meshes/x.stl", tmp_path / "meshes/x.stl"),
        ("../x.stl", tmp_path / "../x.stl"),
        ("/meshes/x.stl", Path("/meshes/x.stl")),
    ]:
        file = write_file(FOUR_BAR.replace(BEAM, mesh(path)))
        assert read_robot(file).frame("coupler").link.surface == expected
        file = write_file(FOUR_BAR.replace(LINK, f'link = {{ library = "{path}#k" }}'))
        assert read_robot(file).frame("coupler").link == LibraryLink(expected, "k")


def test_written_path_is_relative_to_new_robot_file(write_file, tmp_path, monkeypatch):
    """The robot is read from one folder and written to a subfolder."""
    write_file(FOUR_BAR.replace(BEAM, mesh()))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    write_robot(read_robot("robot.toml"), "out/b.toml")
    assert 'surface = "../x.stl"' in (tmp_path / "out/b.toml").read_text()


def assert_same_robot(robot, expected):
    """Check that all fields of two robots are identical."""
    for key in ("name", "platform", "closures", "description"):
        assert getattr(robot, key) == getattr(expected, key)
    assert len(robot.frames) == len(expected.frames)
    for a, b in zip(robot.frames, expected.frames, strict=True):
        for key, value in vars(b).items():
            here = getattr(a, key)
            if isinstance(value, MatrixLink):
                here, value = here.stiffness, value.stiffness
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(here, value)
            else:
                assert here == value, key


PLANE = {"plane": {"point": [0, 0, 1.5], "normal": [0, 0, 1]}, "radius": 0.1}
BORE = {"bore": {"point": [0, 0, 0], "axis": [0, 1, 0], "radius": 0.01}}
SECTIONS = (
    {"radius": 0.1}, {"radius": 0.1, "inner_radius": 1 / 30},
    {"width": 1 / 3, "height": 0.2},
    {"area": 1e-3, "I_y": 1e-7, "I_z": 2e-7, "J": 3e-7, "shear_y": 0.7, "shear_z": 0.9},
)  # fmt: skip


def every_link(rng):
    """Yield links of all types."""
    K = np.diag(rng.uniform(1, 1e8, 6))
    for section in SECTIONS:
        yield BeamLink(section, *rng.uniform(1e9, 2e11, 1), rng.uniform(-0.9, 0.49))
    yield BeamLink(
        {"radius": 0.1}, 7e10, 0.3, density=2700.1, theory="euler", length=0.3,
        axis=(1.0, 0.5, 0.0), up=(0.0, 1.0, 2.0),
    )  # fmt: skip
    yield MatrixLink(K)
    yield LibraryLink(Path("/a #b/c.nc"), "ü")
    for tip in ("z=0.452", PLANE, BORE):
        yield MeshLink(
            Path("/meshes/ü.stl"), "z=0", tip, 1e9 / 7, 0.3, unit="mm",
            up=(1.0, 0.0, 0.0), frame_up=(0.0, 0.0, 1.0), interface="distributing",
            parts=("z=0..0.1/young=1e9,poisson=0.3",),
        )  # fmt: skip
    yield None


def every_joint(rng):
    """Yield the keys of joints of all types."""
    K = np.diag(rng.uniform(1, 1e8, 6))
    bearing, slide, locked = K.copy(), K.copy(), np.diag([math.inf] * 6)
    bearing[2, 2] = slide[5, 5] = 0.0
    yield {}
    yield {"joint": "revolute", "actuated": True, "limits": (-1.5, 2.0)}
    yield {"joint": "prismatic", "clearance": Clearance(1e-30, None, 0.0, 1.0)}
    yield {"joint": "revolute", "clearance": Clearance(spin=0.2, ball=1 / 7)}
    yield {"joint": "revolute", "joint_stiffness": bearing}
    yield {"joint": "prismatic", "joint_stiffness": slide, "drive_force": -1 / 3}
    yield {"joint": "prismatic", "actuated": True, "joint_stiffness": locked}
    yield {"joint": "revolute", "joint_stiffness": K, "clearance": Clearance(1 / 3)}


def moments(rng):
    """Return a random valid inertia matrix, (3, 3) [kg m^2]."""
    arm = rng.normal(size=3)
    return (arm @ arm + rng.uniform()) * np.eye(3) - np.outer(arm, arm)


@pytest.mark.parametrize("seed", range(8))
def test_links_and_joints_are_equal_after_writing_and_reading(seed, tmp_path):
    """Each seed combines the links of a serial arm with different joints."""
    rng, frames, parent = np.random.default_rng(seed), [], "base"
    joints = list(every_joint(rng))
    for k, link in enumerate(every_link(rng)):
        name = f"{k} ü\"\\#'.="
        frames.append(Frame(
            name, parent, rng.normal(size=3) + [0, 0, 50], rng.normal(size=3),
            geometric_error=rng.normal(size=6), tolerance=rng.uniform(size=6),
            link=link, mass=rng.uniform(), centre_of_mass=rng.normal(size=3),
            inertia=moments(rng),
            **joints[(k + seed) % len(joints)],
        ))  # fmt: skip
        parent = name
    tool = Frame("tool", parent, [0, 0, 1 / 3])
    robot = Robot("ß'", "tool", (*frames, tool), (), 'two\nlines, a "quote", \t')
    write_robot(robot, tmp_path / "robot.toml")
    assert_same_robot(read_robot(tmp_path / "robot.toml"), robot)


def test_robot_in_documentation_has_closed_loops(write_file):
    text = (Path(__file__).parents[3] / "docs" / "robot_files.md").read_text("utf-8")
    robot = read_robot(write_file(text.split("```toml\n")[1].split("```")[0]))
    posture = home_posture(robot)
    assert posture.mismatch < 1e-9
    # both legs are mirror images, so that the platform is in the plane x = 0
    assert posture.platform[0, 3] == pytest.approx(0.0, abs=1e-9)
    assert {f.joint for f in robot.frames} == {"fixed", "revolute"}


def test_bearing_in_documentation_has_data_sheet_stiffness(write_file):
    """The displacement is the clearance plus F / k for F = 60 N.

    The stiffness k is 1.2e8 N/m in radial and 6e7 N/m in axial direction.
    """
    text = (Path(__file__).parents[3] / "docs" / "robot_files.md").read_text("utf-8")
    example = text.split("```toml\n")[2].split("```")[0]
    alone = 'platform = "hub_flange"\n[[frame]]\nname = "hub_flange"\nparent = "hub"\n'
    robot = read_robot(write_file(alone + example.replace('"right.elbow"', '"base"')))
    hub = robot.frame("hub")
    assert not hub.compliant
    assert hub.own_stiffness == 0.0
    up = solve_assembly(home_posture(robot), [0, 0, 0, 60.0, 0, 0])
    assert up.platform_screw[3] == pytest.approx(5e-6 + 60 / 1.2e8, rel=1e-9)
    along = solve_assembly(home_posture(robot), [0, 0, 0, 0, 0, 60.0])
    assert along.platform_screw[5] == pytest.approx(8e-6 + 60 / 6e7, rel=1e-9)
    assert mobility(home_posture(robot)).locked_freedoms == 1
    with pytest.raises(FreeMotion):
        solve_assembly(home_posture(robot), [0, 0, 1.0, 0, 0, 0])


def test_nut_in_documentation_has_clearance_and_stiffness(write_file):
    """A force F and a moment -h F along z displace the nut by b + F / k.

    The lead is h, the clearance is b, and the stiffness is k.
    """
    text = (Path(__file__).parents[3] / "docs" / "robot_files.md").read_text("utf-8")
    example = text.split("```toml\n")[3].split("```")[0]
    tip = 'platform = "tip"\n[[frame]]\nname = "tip"\nparent = "nut"\n'
    robot = read_robot(write_file(tip + example.replace('"screw"', '"base"')))
    h = 0.004 / (2 * np.pi)
    moved = solve_assembly(home_posture(robot), [0, 0, -100 * h, 0, 0, 100.0])
    along = moved.platform_screw[5] - h * moved.platform_screw[2]
    assert along == pytest.approx(25e-6 + 100 / 1e8, rel=1e-9)
    with pytest.raises(FreeMotion):
        solve_assembly(home_posture(robot), [0, 0, 0, 0, 0, 100.0])


def test_missing_dh_alpha_is_reported(write_file, run):
    """The default value of the Denavit-Hartenberg parameter alpha is 0."""
    text = """
platform = "tool"
[[frame]]
name = "arm"
parent = "base"
dh = { a = 0.3 }
[[frame]]
name = "tool"
parent = "arm"
dh = { a = 0.2, alpha = 0.0 }
"""
    told = 'dh without alpha, which is set to 0: "arm"'
    file = write_file(text)
    assert read_robot(file).remarks == (told,)
    _, out, _ = run("assembly", "solve", file)
    assert f"\nnote: {told}\n" in out
    _, out, _ = run("assembly", "solve", file, "--json", "-")
    assert json.loads(out)["remarks"] == [told]
    full = text.replace("a = 0.3", "a = 0.3, alpha = 0")
    assert read_robot(write_file(full)).remarks == ()
