"""Cut boxes against closed forms and Qhull."""

import numpy as np
import pytest
from scipy.spatial import HalfspaceIntersection

from assembly.solvers.polytope import cut, empty_polytope, farthest_corner, start_box
from stiffness.screws import rotation_matrix

LOW, HIGH = np.array([-1.0, -2.0, -0.5]), np.array([1.5, 2.0, 3.0])


@pytest.fixture
def box():
    body = empty_polytope()
    start_box(body, np.eye(3), LOW, HIGH)
    return body


def corners(body):
    return body.corners[: body.used[0]]


def test_a_box_has_its_eight_corners_each_on_three_sides():
    axes = rotation_matrix([0.3, -0.5, 0.7])
    body = empty_polytope()
    start_box(body, axes, LOW, HIGH)
    assert body.used.tolist() == [8, 6]
    along = corners(body) @ axes.T
    wanted = {
        (x, y, z) for x in (LOW[0], HIGH[0]) for y in (-2.0, 2.0) for z in (-0.5, 3.0)
    }
    assert {tuple(row.round(12)) for row in along} == wanted
    for own, planes in zip(along, body.planes[:8], strict=True):
        for axis, plane in enumerate(planes):
            assert plane == 2 * axis + (own[axis] > LOW[axis] + 1e-9)
    # made again, it is the same: nothing of the last one is left
    start_box(body, axes, LOW, HIGH)
    np.testing.assert_allclose(corners(body) @ axes.T, along, atol=1e-14)


def test_a_corner_cut_off_leaves_a_triangle(box):
    normal = np.ones(3) / np.sqrt(3)
    height = normal @ HIGH - 0.3 / np.sqrt(3)  # 0.3 along each edge
    assert cut(box, normal, height)
    assert box.used.tolist() == [10, 7]
    new = corners(box)[(box.planes[:10] == 6).any(axis=1)]
    wanted = HIGH - 0.3 * np.eye(3)
    order = np.lexsort(new.round(9).T)
    np.testing.assert_allclose(
        new[order], wanted[np.lexsort(wanted.round(9).T)], atol=1e-12
    )


def test_a_plane_outside_cuts_nothing_and_one_through_a_corner_neither(box):
    before = corners(box).copy()
    assert cut(box, np.array([1.0, 0.0, 0.0]), 2.0)
    assert cut(box, np.ones(3) / np.sqrt(3), float(HIGH.sum()) / np.sqrt(3))
    np.testing.assert_array_equal(corners(box), before)
    assert box.used.tolist() == [8, 8]


@pytest.mark.parametrize("unit", [1.0, 1e-14, 1e9])
@pytest.mark.parametrize("seed", range(4))
def test_many_cuts_leave_the_corners_that_qhull_says(seed, unit):
    """In whatever unit: what is rounding is measured by the corners."""
    rng = np.random.default_rng(seed)
    body = empty_polytope()
    start_box(body, np.eye(3), unit * LOW, unit * HIGH)
    half = [*np.c_[np.eye(3), -HIGH], *np.c_[-np.eye(3), LOW]]
    for _ in range(12):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        height = rng.uniform(0.4, 1.5)
        assert cut(body, normal, unit * height)
        half.append(np.r_[normal, -height])
    truth = HalfspaceIntersection(np.array(half), np.zeros(3)).intersections
    gaps = np.linalg.norm(truth[:, None] - corners(body)[None] / unit, axis=2)
    assert gaps.min(axis=0).max() < 1e-9
    assert gaps.min(axis=1).max() < 1e-9
    largest = np.linalg.norm(truth, axis=1).max()
    found = np.linalg.norm(farthest_corner(body))
    assert found == pytest.approx(unit * largest, rel=1e-12, abs=0)


def test_no_new_corner_lies_beyond_the_edge_that_it_is_on(box):
    """Both ends above the plane, one by rounding: that one is the new corner."""
    start_box(box, np.eye(3), np.full(3, -1000.0), np.full(3, 1000.0))
    # at x = 1000 above by 1e-11 +- 4e-12; 1e-14 of the size counts as none
    assert cut(box, np.array([1.0, 4e-15, 0.0]), 1000.0 - 1e-11)
    assert np.abs(corners(box)).max() <= 1000.0
    assert (corners(box)[:, 0] > 999.0).sum() >= 4


def test_without_room_the_corners_stay():
    body = empty_polytope()
    start_box(body, np.eye(3), LOW, HIGH)
    body.used[0] = len(body.corners)  # as if all were used; the others lie together
    body.planes[8:] = body.planes[0]
    body.corners[8:] = body.corners[0]
    before = body.corners.copy()
    assert not cut(body, np.array([1.0, 0.0, 0.0]), 0.0)
    np.testing.assert_array_equal(body.corners, before)
    assert body.used[0] == len(body.corners)
