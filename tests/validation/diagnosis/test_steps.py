"""Steps of bounded least squares, and slopes updated by them, one by one."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from validation.diagnosis.least_squares import _step, _updated, least_squares

FREE = np.full(4, np.inf)


@pytest.mark.parametrize("damping", [1e-9, 1e-3, 10.0])
def test_a_step_is_the_least_of_the_damped_squares(damping, rng):
    """-(J'J + damping D^2)^-1 J'r, D the norms of columns of any units."""
    J = rng.normal(size=(12, 4)) * [1.0, 1e6, 1e-6, 30.0]
    r = rng.normal(size=12)
    d, promised = _step(J, r, damping, (-FREE, FREE))
    D = np.linalg.norm(J, axis=0)
    expected = -np.linalg.solve(J.T @ J + damping * np.diag(D**2), J.T @ r)
    np.testing.assert_allclose(d * D, expected * D, rtol=1e-6)
    assert promised == pytest.approx(r @ r - np.sum((r + J @ d) ** 2), rel=1e-9)


def test_a_step_stays_within_its_room_and_is_the_best_there(rng):
    for _ in range(20):
        J, r = rng.normal(size=(9, 4)) * [1.0, 5.0, 0.2, 1.0], rng.normal(size=9)
        room = -rng.uniform(0, 0.3, 4), rng.uniform(0, 0.3, 4)
        d, _ = _step(J, r, 1e-9, room)
        best = lsq_linear(J, -r, room, method="bvls", tol=1e-14).x
        np.testing.assert_allclose(d, best, atol=1e-6)


def test_a_column_that_is_nothing_takes_no_step(rng):
    """And two that are equal share one."""
    a = rng.normal(size=(9, 1))
    J = np.hstack([a, a, 0 * a])
    d, promised = _step(J, -3 * a[:, 0], 0.0, (-FREE[:3], FREE[:3]))
    assert d == pytest.approx([1.5, 1.5, 0.0], rel=1e-3)
    assert promised == pytest.approx(9 * float(a[:, 0] @ a[:, 0]))


def test_updated_slopes_say_what_a_step_did_and_change_least(rng):
    """Of all such slopes the nearest, unknowns measured by what they do."""
    J = rng.normal(size=(7, 3)) * [1.0, 100.0, 0.01]
    step, change = rng.normal(size=3) / [1.0, 100.0, 0.01], rng.normal(size=7)
    found = _updated(J, step, change)
    np.testing.assert_allclose(found @ step, change)
    D = np.linalg.norm(J, axis=0)
    least = np.outer(change - J @ step, np.linalg.pinv((D * step)[:, None])[0])
    np.testing.assert_allclose((found - J) / D, least, rtol=1e-9)
    np.testing.assert_array_equal(_updated(J, np.zeros(3), np.zeros(7)), J)


def counted(residual, slopes, start, bounds, most=8, converged=1e-9):
    """Where a search ended, and how often it asked for either."""
    asked = {"residual": 0, "slopes": 0}

    def r(x):
        asked["residual"] += 1
        return residual(x)

    def J(x):
        asked["slopes"] += 1
        return slopes(x)

    begin = start, slopes(start)
    return least_squares(r, J, begin, bounds, converged, most), asked


def test_a_linear_model_takes_one_step(rng):
    """To the least, and once more to see that nothing is left to gain."""
    A, b = rng.normal(size=(20, 4)), rng.normal(size=20)
    found, asked = counted(lambda x: A @ x - b, lambda x: A, np.zeros(4), (-FREE, FREE))
    np.testing.assert_allclose(found.x, np.linalg.lstsq(A, b)[0], rtol=1e-6)
    np.testing.assert_allclose(found.residual, A @ found.x - b)
    assert asked["residual"] <= 3
    assert asked["slopes"] <= 1


def test_newton_steps_are_enough_where_slopes_are_right():
    """exp(x) = 3 and 1.5, a reading of 0.5 beside them that nothing explains."""
    goal = np.array([3.0, 1.5])

    def residual(x):
        return np.append(np.exp(x) - goal, 0.5)

    found, asked = counted(
        residual, lambda x: np.diag(np.append(np.exp(x), 0.0))[:, :2],
        np.array([0.8, 0.6]), (-FREE[:2], FREE[:2]), converged=1e-10,
    )  # fmt: skip
    assert found.x == pytest.approx(np.log(goal), rel=1e-5)
    assert asked["residual"] <= 8
    assert asked["slopes"] <= 2


def test_a_search_at_its_end_stays_there(rng):
    """Nothing is left to gain: one step is tried, no slopes are taken."""
    A = rng.normal(size=(9, 4))
    x = rng.normal(size=4)
    found, asked = counted(
        lambda y: A @ (y - x) + 0.0, lambda y: A, x, (-FREE, FREE), converged=1e-6
    )
    assert found.x == pytest.approx(x)
    assert asked == {"residual": 2, "slopes": 0}


def test_a_step_led_astray_is_shortened():
    """A well between walls: a full step by its slopes leads far beyond."""

    def residual(x):
        return np.array([np.arctan(5 * x[0]), 0.1])

    def slopes(x):
        return np.array([[5 / (1 + 25 * x[0] ** 2)], [0.0]])

    found, asked = counted(
        residual, slopes, np.array([1.5]), (-FREE[:1], FREE[:1]), 40, 1e-10
    )
    assert found.x == pytest.approx([0.0], abs=1e-4)
    assert asked["residual"] < 40
