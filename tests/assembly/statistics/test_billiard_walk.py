"""The walk against straight lines reflected by hand, with the same random numbers."""

import numpy as np
import pytest

from assembly.model.error_distributions import draw_generator
from assembly.statistics.billiard_walk import (
    FLIGHT,
    Positions,
    _distance_to_bound,
    start_chains,
    walk,
)


def sizes(starts, u):
    """Size of each cone."""
    return [
        np.linalg.norm(u[a:b]) for a, b in zip(starts[:-1], starts[1:], strict=True)
    ]


def walked(starts, M, u, every=1, kept=1, seed=1, to_screw=None):
    """The point after a walk, its screws, and a generator as it was before."""
    M, starts = np.ascontiguousarray(M, dtype=float), np.array(starts)
    to_screw = np.zeros((6, len(M))) if to_screw is None else to_screw
    u, trace = np.array(u, dtype=float), np.empty((kept, 6))
    positions = Positions(M, M @ M.T, starts, to_screw)
    walk(positions, u, every, draw_generator(seed, 0, 9), trace)
    return u, trace, draw_generator(seed, 0, 9)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("size", [0.1, 1.0, 5.0])
def test_in_a_box_every_side_is_a_folded_straight_line(seed, size):
    """A random direction, normal, for a random time, exponential; each side folds."""
    M, start = size * np.diag([1.0, 0.5, 2.0]), np.array([0.9, -0.3, 0.0])
    u, _, rng = walked([0, 1, 2, 3], M, start, seed=seed)
    way = M @ rng.standard_normal(3) * FLIGHT * rng.standard_exponential()
    folded = np.abs((start + way - 1) % 4 - 2) - 1
    np.testing.assert_allclose(u, folded, atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_on_a_segment_a_line_folds_unless_it_is_reflected_too_often(seed):
    """Beyond forty times the point stays where it was."""
    u, _, rng = walked([0, 1], [[3.0]], [0.25], seed=seed)
    way = 3.0 * rng.standard_normal() * FLIGHT * rng.standard_exponential()
    assert u[0] == pytest.approx(np.abs((0.25 + way - 1) % 4 - 2) - 1, abs=1e-9)
    assert u[0] != 0.25
    still, _, _ = walked([0, 1], [[3e4]], [0.25], seed=seed)
    assert still[0] == 0.25


def reflected(starts, M, u, speed, left):
    """The same in coordinates y of u = M y, where reflections are those of mirrors."""
    for _ in range(1000):
        w, reach, wall = M @ speed, left, None
        for k, (a, b) in enumerate(zip(starts[:-1], starts[1:], strict=True)):
            # |u_k + t w_k| = 1
            roots = np.roots([
                w[a:b] @ w[a:b],
                2 * u[a:b] @ w[a:b],
                u[a:b] @ u[a:b] - 1,
            ])
            if np.max(roots) < reach:
                reach, wall = np.max(roots), k
        u = u + reach * w
        if wall is None:
            return u
        left -= reach
        a, b = starts[wall], starts[wall + 1]
        normal = M[a:b].T @ u[a:b]
        speed = speed - 2 * (normal @ speed) / (normal @ normal) * normal
    raise AssertionError("too many reflections")


@pytest.mark.parametrize("seed", range(5))
def test_a_trajectory_is_reflected_at_discs_and_sides_as_by_mirrors(seed, rng):
    """In the coordinates of Dikin's ellipsoid, whatever its axes; also a thin one."""
    starts = [0, 2, 3, 5]
    for M in (np.eye(5), rng.normal(size=(5, 5)), rng.normal(size=(5, 3))):
        start = np.array([0.6, -0.5, 0.2, 0.0, 0.1])
        u, _, numbers = walked(starts, M, start, seed=seed)
        speed = numbers.standard_normal(M.shape[1])
        left = FLIGHT * numbers.standard_exponential()
        expected = reflected(starts, M, start, speed, left)
        np.testing.assert_allclose(u, expected, atol=1e-7)
        assert max(sizes(starts, u)) <= 1 + 1e-9


def test_screws_are_kept_after_every_so_many_trajectories(rng):
    to_screw = rng.normal(size=(6, 3))
    asked = {"starts": [0, 2, 3], "M": np.eye(3), "u": np.zeros(3)}
    u, all_, _ = walked(**asked, kept=12, to_screw=to_screw)
    same, some, _ = walked(**asked, every=3, kept=4, to_screw=to_screw)
    np.testing.assert_array_equal(some, all_[2::3])
    np.testing.assert_array_equal(u, same)
    np.testing.assert_allclose(all_[-1], to_screw @ u, rtol=1e-12)
    assert len(np.unique(all_[:, 0])) == 12


def test_the_nearest_bound_is_where_a_cone_has_size_one(rng):
    starts, spread = np.array([0, 2, 3, 5]), np.inf
    for _ in range(20):
        v, w = rng.uniform(-0.6, 0.6, 5), rng.normal(size=5)
        reach, wall = _distance_to_bound(starts, v, w, spread)
        there = sizes(starts, v + reach * w)
        assert there[wall] == pytest.approx(1.0, rel=1e-12)
        assert max(there) <= 1 + 1e-12
        assert reach > 0
        assert _distance_to_bound(starts, v, w, 0.9 * reach) == (0.9 * reach, -1)
        near, same = _distance_to_bound(starts, v, w, 1.1 * reach)
        assert (near, same) == (reach, wall)


def test_a_cone_that_does_not_move_is_no_bound():
    """Even where it stands on its bound; a point outside by rounding turns back."""
    starts, v = np.array([0, 2, 3]), np.array([0.6, 0.8, 0.5])
    reach, wall = _distance_to_bound(starts, v, np.array([0.0, 0.0, -0.5]), np.inf)
    assert (reach, wall) == (pytest.approx(3.0), 1)
    assert _distance_to_bound(starts, v, np.zeros(3), 7.0) == (7.0, -1)
    outside, inward = v * (1 + 1e-15), np.array([-0.6, -0.8, 0.0])
    assert _distance_to_bound(starts, outside, inward, np.inf)[0] == pytest.approx(2.0)
    outward = _distance_to_bound(starts, outside, -inward, np.inf)
    assert outward == (pytest.approx(0.0, abs=1e-12), 0)


def test_chains_start_at_nine_tenths_of_the_way_to_the_boundary(rng):
    starts, centre = np.array([0, 2, 3]), np.array([0.3, -0.2, 0.1])
    walks, M = np.empty((6, 3)), 0.2 * rng.normal(size=(3, 3))
    start_chains(M, starts, centre, draw_generator(4, 0, 9), walks)
    for point in walks:
        assert max(sizes(starts, centre + (point - centre) / 0.9)) == pytest.approx(1.0)
    numbers = draw_generator(4, 0, 9)
    for point in walks:
        direction = M @ numbers.standard_normal(3)
        along = (point - centre) / direction
        np.testing.assert_allclose(along, along[0], rtol=1e-9)
        assert along[0] > 0
