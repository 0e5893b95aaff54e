"""Tests of meshes of slender and thin-walled bars."""

import numpy as np
import pytest

from forcefit.stiffness.fem.fea import FemOptions, solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.mesh.slender_bar import slender_bar
from forcefit.stiffness.screws import rotation_matrix
from forcefit.stiffness.surface.beam_surfaces import shape_surface
from forcefit.stiffness.surface.interface import Interface, parse_interface
from forcefit.stiffness.surface.surface import check_surface
from tests.solids_for_tests import cylinder
from tests.stiffness.surface.test_recognition import revolved

E, NU = 70e9, 0.3
G = E / (2 + 2 * NU)


def tube(outer, inner, length):
    """Return the surface of a tube along z."""
    return revolved([outer, outer, inner, inner], [0, length, length, 0], 48, True)


def box(width, height, length):
    """Return the surface of a solid bar along z."""
    lengths = {"width": width, "height": height, "length": length}
    return shape_surface("rectangle", lengths)


def ends(length):
    return parse_interface("z=0"), parse_interface(f"z={length}")


@pytest.mark.slow
@pytest.mark.parametrize(("surface", "length", "J", "A"), [
    (check_surface(*cylinder(0.75e-3, 1.0, 32), "rod"), 1.0,
     np.pi / 2 * 0.75e-3**4, np.pi * 0.75e-3**2),
    (tube(0.01, 0.0097, 0.2), 0.2,
     np.pi / 2 * (0.01**4 - 0.0097**4), np.pi * (0.01**2 - 0.0097**2)),
])  # fmt: skip
def test_stiffness_of_a_rod_and_a_thin_tube_agrees_with_closed_forms(
    surface, length, J, A, tmp_path
):
    """Torsion is exact. In tension, the rigid ends cannot contract, so K exceeds E A /
    L by at most the ratio of width to length.
    """
    options = FemOptions(0.01, cache=tmp_path)
    link = solve_link(surface, *ends(length), [Material(E, NU)], options=options).link
    error = link.relative_error_estimate
    assert link.mesh["reached"]
    assert link.mesh["drawn_out"]
    assert link.stiffness[2, 2] == pytest.approx(G * J / length, rel=error)
    stretch = link.stiffness[5, 5] * length / (E * A)
    assert 1 - error < stretch < 1.01 + error


def test_slender_bar_mesh_has_the_pose_of_its_surface():
    """The volume, the centre and the positions of the ends are compared."""
    turn = rotation_matrix(np.array([0.3, -0.7, 1.1]))
    shift = np.array([0.2, -0.1, 0.4])
    for made, area in ((box(0.002, 0.005, 0.4), 1e-5), (tube(0.01, 0.0097, 0.4), None)):
        surface = check_surface(made.points @ turn.T + shift, made.triangles, "bar")
        base = Interface("plane", shift, turn[:, 2], np.inf)
        tip = Interface("plane", shift + 0.4 * turn[:, 2], -turn[:, 2], np.inf)
        solid = slender_bar(surface, base, tip)
        for patch, interface in ((0, base), (1, tip)):
            corners = solid.points[solid.faces[solid.patch == patch]]
            assert interface.distance(corners).max() < 1e-12
        middle = shift + 0.2 * turn[:, 2]
        np.testing.assert_allclose(solid.points.mean(axis=0), middle, atol=1e-9)
        assert (solid.volumes() > 0).all()
        volume = surface.volume if area is None else area * 0.4
        assert solid.volumes().sum() == pytest.approx(volume, rel=0.03)


def twisted_tube(outer, inner, length, facets=48, levels=4):
    """Return the surface of a tube with no triangle edges along the axis, as in STEP
    files.
    """
    step = 2 * np.pi / facets
    rings = [(outer, k) for k in range(levels)]
    rings += [(inner, k) for k in reversed(range(levels))]
    points = []
    for radius, k in rings:
        angle = step * (np.arange(facets) + 0.5 * k)
        z = np.full(facets, length * k / (levels - 1))
        points.append(
            np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
        )
    i, j = np.arange(facets), (np.arange(facets) + 1) % facets
    triangles = []
    for k in range(len(rings)):
        a, b = k * facets, (k + 1) % len(rings) * facets
        far, near = (i, j) if k < levels - 1 else (j, i)
        triangles += [np.column_stack([i + a, j + a, far + b])]
        triangles += [np.column_stack([near + a, j + b, i + b])]
    return check_surface(np.concatenate(points), np.concatenate(triangles), "tube")


def test_thin_tube_with_corners_between_its_ends_is_extruded():
    solid = slender_bar(twisted_tube(0.01, 0.0097, 0.2), *ends(0.2))
    volume = np.pi * (0.01**2 - 0.0097**2) * 0.2
    assert solid.volumes().sum() == pytest.approx(volume, rel=0.03)


def test_slender_bar_mesh_is_not_used_for_other_parts():
    """The parts are a short bar, a tapered bar, a short tube, and a bar with an
    interface on its side."""
    stubby = check_surface(*cylinder(0.02, 0.1), "bar")
    assert slender_bar(stubby, *ends(0.1)) is None
    tapered = check_surface(*cylinder(1e-3, 1.0, 32, 0.8e-3), "taper")
    assert slender_bar(tapered, *ends(1.0)) is None
    assert slender_bar(tube(0.01, 0.008, 0.2), *ends(0.2)) is None
    square = box(0.002, 0.005, 0.4)
    assert slender_bar(square, *ends(0.4)) is not None
    side = parse_interface("x=0.001")
    assert slender_bar(square, parse_interface("z=0"), side) is None
