"""The billiard walk against reflections by hand with the same random numbers."""

import numpy as np
import pytest

from forcefit.assembly.model.error_distributions import draw_generator
from forcefit.assembly.solvers.billiard_walk import Positions

FLIGHT = 2.0  # mean time of a trajectory


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
    positions = Positions(M, starts, to_screw)
    positions.walk(u, every, draw_generator(seed, 0, 9), trace)
    return u, trace, draw_generator(seed, 0, 9)


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
def test_billiard_trajectory_equals_reflections_computed_by_hand(seed, rng):
    """In the coordinates of Dikin's ellipsoid, for any axes; also for a thin one."""
    starts = [0, 2, 3, 5]
    for M in (np.eye(5), rng.normal(size=(5, 5)), rng.normal(size=(5, 3))):
        start = np.array([0.6, -0.5, 0.2, 0.0, 0.1])
        u, _, numbers = walked(starts, M, start, seed=seed)
        speed = numbers.standard_normal(M.shape[1])
        left = FLIGHT * numbers.standard_exponential()
        expected = reflected(starts, M, start, speed, left)
        np.testing.assert_allclose(u, expected, atol=1e-7)
        assert max(sizes(starts, u)) <= 1 + 1e-9


def test_cone_of_coordinates_that_do_not_move_does_not_bound_the_random_walk(rng):
    """Also if it is on its bound: the other cones determine the range of the starts."""
    starts, centre = np.array([0, 2, 3]), np.array([0.6, 0.8, 0.5])
    M, walks = np.array([[0.0], [0.0], [0.3]]), np.empty((8, 3))
    positions = Positions(M, starts, np.zeros((6, 3)))
    positions.start_chains(centre, draw_generator(2, 0, 9), walks)
    ends = centre[2] + (walks[:, 2] - centre[2]) / 0.9
    np.testing.assert_allclose(np.abs(ends), 1.0, rtol=1e-12)
    np.testing.assert_array_equal(walks[:, :2], np.tile(centre[:2], (8, 1)))
    # where nothing moves, a trajectory ends where it began
    still, _, _ = walked(starts, np.zeros((3, 1)), centre)
    np.testing.assert_array_equal(still, centre)


def test_random_walk_from_a_point_that_is_outside_by_rounding_returns_inside():
    starts, outside = [0, 1], [1 + 1e-15]
    for seed in range(6):
        u, _, _ = walked(starts, [[0.5]], outside, seed=seed)
        assert abs(u[0]) <= 1 + 2e-15
