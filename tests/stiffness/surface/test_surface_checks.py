"""Tests of the checks and the repairs of surfaces."""

import re

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface import surface as surface_module
from forcefit.stiffness.surface.surface import (
    Surface,
    check_surface,
    directed_edges,
    read_surface,
)
from tests.solids_for_tests import CUBE, CUBE_TRIANGLES, cylinder

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
CORNERS = 0.1 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


def test_surface_digest_depends_on_the_geometry_only():
    """It depends on every bit of the coordinates, but not on the name or the memory
    layout."""
    one = Surface(CUBE, CUBE_TRIANGLES, "one")
    same = Surface(np.asfortranarray(CUBE), CUBE_TRIANGLES.astype(np.int32), "other")
    assert one.digest() == same.digest()
    moved, turned = CUBE.copy(), CUBE_TRIANGLES.copy()
    moved[3, 1] = np.nextafter(moved[3, 1], 1)
    turned[5] = turned[5][[1, 2, 0]]
    assert len({one.digest(), Surface(moved, CUBE_TRIANGLES, "one").digest(),
                Surface(CUBE, turned, "one").digest()}) == 3  # fmt: skip


@pytest.mark.parametrize(("size", "unit", "hint"), [
    (19.99, "m", None), (20.01, "m", "mm"), (20.01, "mm", "m"),
    (1.001e-3, "mm", None), (0.999e-3, "mm", "m"), (0.999e-3, "m", "m"),
])  # fmt: skip
def test_part_of_implausible_size_is_rejected_with_a_likely_unit(size, unit, hint):
    """Plausible sizes are from 1 mm to 20 m."""
    points = CUBE * size / (0.1 * np.sqrt(3))
    if hint is None:
        check_surface(points, CUBE_TRIANGLES, "part", unit)
        return
    words = f'part: the size of the part is {size:.4g} m with unit = "{unit}"; '
    words += f'is the unit of the file "{hint}"?'
    with pytest.raises(BadInput, match="^" + re.escape(words) + "$"):
        check_surface(points, CUBE_TRIANGLES, "part", unit)


def test_unit_option_is_ignored_for_a_step_file(tmp_path, monkeypatch):
    """A STEP file contains its unit."""
    points, triangles = cylinder()
    monkeypatch.setattr(
        surface_module, "_read_triangles", lambda *_: (points, triangles, None)
    )
    assert read_surface("bar.STEP", "mm").diagonal == pytest.approx(
        read_surface("bar.stl", "m").diagonal
    )
    tenth = read_surface("bar.stl", "dm").diagonal
    assert tenth == pytest.approx(0.1 * read_surface("bar.stp", "dm").diagonal)


def test_points_that_belong_to_no_triangle_are_ignored():
    """The coordinates of this point are NaN or very large."""
    points = np.concatenate([[[np.nan] * 3, [1e6, 0, 0]], CUBE])
    surface = check_surface(points, CUBE_TRIANGLES + 2, "cube")
    assert surface.volume == pytest.approx(1e-3)
    assert len(surface.points) == 8
    assert surface.repairs == ()


@pytest.mark.parametrize("pair", [[0, 0, 1], [0, 1, 1], [1, 0, 1]])
def test_triangle_with_two_equal_corners_is_removed_and_reported(pair):
    triangles = np.concatenate([CUBE_TRIANGLES, [pair]])
    surface = check_surface(CUBE, triangles, "cube")
    assert len(surface.triangles) == 12
    assert surface.repairs == ("1 triangles without an area removed",)


@pytest.mark.parametrize("turned", [1, 5, 7, 11])
@pytest.mark.parametrize("hollow", [False, True])
def test_reversed_triangles_are_repaired_and_reported(rng, turned, hollow):
    """First, the smaller group of triangles is reversed, then a whole shell."""
    mixed = CUBE_TRIANGLES.copy()
    some = rng.choice(12, turned, replace=False)
    mixed[some] = mixed[some][:, ::-1]
    points, triangles, expected = CUBE, mixed, 1e-3
    if hollow:  # the triangles of a cavity with the correct orientation
        points = np.concatenate([CUBE, 0.5 * CUBE + 0.025])
        triangles = np.concatenate([mixed, CUBE_TRIANGLES[:, ::-1] + 8])
        expected = 1e-3 * 7 / 8
    surface = check_surface(points, triangles, "cube")
    assert surface.volume == pytest.approx(expected)
    words = [
        f"{min(turned, 12 - turned)} triangles reoriented to agree with their "
        "neighbours"
    ]
    if turned > 6:
        words.append("the surface was inside out and has been reoriented")
    assert surface.repairs == tuple(words)
    edges = {tuple(edge) for edge in directed_edges(surface.triangles)}
    assert edges == {(b, a) for a, b in edges}


def test_overlapping_body_is_not_read_as_a_cavity():
    """No edge of one box passes through the interior of a triangle of the other.

    The corners of each box are ordered by x, then y, then z.
    """
    box = np.array([[x, y, z] for x in (0, 2) for y in (0, 1) for z in (0, 10)]) * 0.01
    faces = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1],
                      [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])  # fmt: skip
    halves = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    points = np.concatenate([box, box + [0.01, 0.005, 0]])
    triangles = np.concatenate([halves, halves + 8])
    with pytest.raises(BadInput, match="found 2 separate bodies"):
        check_surface(points, triangles, "cubes")


def test_second_body_is_rejected_with_the_position_of_its_centre():
    far = CUBE + [0.3, 0.4, 0.5]
    points = np.concatenate([2 * CUBE, far])
    triangles = np.concatenate([CUBE_TRIANGLES, CUBE_TRIANGLES + 8])
    words = "cubes: found 2 separate bodies, the second near (0.3"
    with pytest.raises(BadInput, match=re.escape(words)) as no:
        check_surface(points, triangles, "cubes")
    place = np.array([float(v) for v in re.findall(r"0\.\d+", str(no.value))])
    corners = far[CUBE_TRIANGLES].reshape(-1, 3).mean(axis=0)
    np.testing.assert_allclose(place, corners, rtol=1e-3)


def with_corner(corner):
    """Return the triangles of a cube with a changed corner."""
    triangles = CUBE_TRIANGLES.copy()
    triangles[-1, 0] = corner
    return triangles


CUBES = np.concatenate([CUBE_TRIANGLES, CUBE_TRIANGLES + 8])
SLIVERS = np.concatenate([TETRAHEDRON[:3], [[0, 0, 3], [3, 1, 1], [2, 1, 2]]])
BELOW = np.array([[0, 1, 4], [1, 2, 4], [2, 0, 4]])[:, ::-1]
DUST = 1e-9 * np.random.default_rng(0).normal(size=(60_000, 3))
REFUSED = [
    (CUBE, with_corner(-1), "a triangle has a corner that is not among the points"),
    (CUBE, with_corner(8), "a triangle has a corner that is not among the points"),
    (CUBE, CUBE_TRIANGLES[:0], "contains no triangles"),
    (np.where(CUBE == CUBE[3], [0, np.nan, 0], CUBE), CUBE_TRIANGLES, "not finite"),
    (CORNERS, TETRAHEDRON[:3], "found 3 triangles with an area"),
    (CORNERS, SLIVERS, "found 3 triangles with an area"),
    (
        CUBE, CUBE_TRIANGLES[:-1],
        r"open: 3 edges belong to only one triangle, .*near \(0, 0.05, 0.1\)",
    ),
    (  # two cubes with a common edge
        np.concatenate([CUBE, CUBE + [0.1, 0.1, 0]]), CUBES,
        r"1 edges are shared by more than two .*near \(0.1, 0.1, 0.05\)",
    ),
    (  # two tetrahedra with a single common base
        np.concatenate([CORNERS, [[0.02, 0.02, -0.1]]]),
        np.concatenate([TETRAHEDRON, BELOW]),
        "3 edges are shared by more than two",
    ),
    (  # two billion pairs of vertices would need 32 GB
        np.concatenate([CUBE, DUST]),
        np.concatenate([CUBE_TRIANGLES, np.arange(8, 60_008).reshape(-1, 3)]),
        "most of its 60008 vertices are less than",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("points", "triangles", "message"), REFUSED)
def test_invalid_surface_is_rejected(points, triangles, message):
    with pytest.raises(BadInput, match=f"part: .*{message}"):
        check_surface(points, triangles, "part")


def test_position_of_a_self_intersection_is_reported():
    """A pyramid that points up or down replaces the top of the cube. The reported
    position is the midpoint of two intersecting triangles.
    """
    sides = [t for t in CUBE_TRIANGLES if not (CUBE[t][:, 2] == 0.1).all()]
    bottom = [t for t in CUBE_TRIANGLES if (CUBE[t][:, 2] == 0.0).all()]
    ring = [1, 5, 7, 3, 1]
    spike = [[a, b, 8] for a, b in zip(ring, ring[1:], strict=False)]
    triangles = np.array([*sides, *spike])
    up = np.concatenate([CUBE, [[0.06, 0.03, 0.15]]])
    assert check_surface(up, triangles, "spike").volume == pytest.approx(7e-3 / 6)
    down = np.concatenate([CUBE, [[0.06, 0.03, -0.05]]])
    with pytest.raises(BadInput, match=r"intersects itself at \d+ pairs") as no:
        check_surface(down, triangles, "spike")
    named = re.search(r"first near \((.*)\) m; unite the parts", str(no.value))
    place = [float(v) for v in named[1].split(", ")]
    middles = [down[[*a, *b]].mean(axis=0) for a in spike for b in bottom]
    assert np.abs(np.array(middles) - place).max(axis=1).min() < 1e-4
