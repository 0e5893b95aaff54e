"""Farthest points of one set along many directions: closed forms and proofs."""

import numpy as np
import pytest
from scipy.optimize import linprog

from forcefit.assembly.solvers.cones import cone_sizes, cone_starts
from forcefit.assembly.solvers.one_problem import farthest_points

GROUP = np.array([0, 0, 1, 2, 2, 2])  # cones of two, one and three columns


def rows_of(rng, count, nu=6):
    return np.linalg.qr(rng.normal(size=(nu, count)))[0].T.copy()


def directions_of(rng, count, nu=6):
    d = rng.normal(size=(count, nu))
    return d / np.linalg.norm(d, axis=1)[:, None]


def found(rows, group, d, right, tolerance=1e-9):
    return farthest_points(
        rows, cone_starts(group), d, right, np.full(len(d), tolerance)
    )


def test_farthest_point_without_constraint_rows_is_on_the_boundary_of_each_cone(rng):
    d = directions_of(rng, 20)
    points, multipliers, solved = found(
        np.zeros((0, 6)), GROUP, d, np.zeros((20, 0)), 1e-12
    )
    assert solved.all()
    assert multipliers.shape == (20, 0)
    for one, point in zip(d, points, strict=True):
        np.testing.assert_allclose(
            point, one / cone_sizes(one, GROUP)[GROUP], atol=2e-6
        )


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_multipliers_prove_that_no_point_is_farther(rng, rows):
    """d.u is at most n.e + sum |(d - H^T n)_k| for every u of the set and any n."""
    H, d = rows_of(rng, rows), directions_of(rng, 20)
    start = rng.uniform(-0.4, 0.4, size=(20, 6))
    points, multipliers, solved = found(H, GROUP, d, start @ H.T)
    # rounding of several rows may end some a little before
    assert solved.all() if rows == 1 else solved.sum() > 12
    assert np.abs((points - start)[solved] @ H.T).max() < 1e-12
    for i in np.flatnonzero(solved).tolist():
        assert cone_sizes(points[i], GROUP).max() <= 1
        gradient = d[i] - H.T @ multipliers[i]
        most = multipliers[i] @ H @ start[i] + cone_sizes(gradient, GROUP).sum()
        assert -1e-12 <= most - d[i] @ points[i] <= 1.1e-9
        assert d[i] @ points[i] >= d[i] @ start[i] - 1e-9


def test_farthest_points_of_intervals_equal_a_linear_programme(rng):
    H, d = rows_of(rng, 2), directions_of(rng, 8)
    start = rng.uniform(-0.5, 0.5, size=(8, 6))
    points, _, solved = found(H, np.arange(6), d, start @ H.T)
    assert solved.all()
    for i in range(8):
        least = linprog(-d[i], A_eq=H, b_eq=H @ start[i], bounds=[(-1, 1)] * 6)
        assert d[i] @ points[i] == pytest.approx(-least.fun, abs=1e-8)


def test_infeasible_rows_are_reported_as_not_solved(rng):
    H, d = rows_of(rng, 1), directions_of(rng, 3)
    _, _, solved = found(H, GROUP, d, np.array([[0.1], [10.0], [-0.2]]))
    assert solved.tolist() == [True, False, True]


def test_farthest_point_does_not_depend_on_other_directions(rng):
    """In another order, among others, and alone: bit-identical results."""
    H, d = rows_of(rng, 2), directions_of(rng, 30)
    right = rng.uniform(-0.4, 0.4, size=(30, 6)) @ H.T
    tolerance = 10 ** rng.uniform(-11, -4, 30)
    whole = farthest_points(H, cone_starts(GROUP), d, right, tolerance)
    for order in [rng.permutation(30) for _ in range(3)] + [[i] for i in range(8)]:
        other = farthest_points(
            H, cone_starts(GROUP), d[order], right[order], tolerance[order]
        )
        for one, expected in zip(other, whole, strict=True):
            assert np.array_equal(one, expected[order])
