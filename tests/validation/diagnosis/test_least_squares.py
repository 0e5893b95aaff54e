"""Known minima of the literature, linear problems with bounds, and what is asked for.

Starts, minima and bounds: Moré, Garbow, Hillstrom (1981), Testing unconstrained
optimization software, ACM TOMS 7, problems 1, 3, 5, 11, 15 and 21.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares as by_scipy
from scipy.optimize import lsq_linear

from validation.diagnosis.least_squares import least_squares

CONVERGED = 1e-10
FREE = (-np.inf, np.inf)
KOWALIK = np.array([
    (0.1957, 4.0), (0.1947, 2.0), (0.1735, 1.0), (0.1600, 0.5), (0.0844, 0.25),
    (0.0627, 0.1670), (0.0456, 0.125), (0.0342, 0.1), (0.0323, 0.0833),
    (0.0235, 0.0714), (0.0246, 0.0625),
])  # fmt: skip


def rosenbrock(x):
    return np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def badly_scaled(x):
    return np.array([1e4 * x[0] * x[1] - 1, np.exp(-x[0]) + np.exp(-x[1]) - 1.0001])


def beale(x):
    return np.array([
        y - x[0] * (1 - x[1] ** k) for k, y in ((1, 1.5), (2, 2.25), (3, 2.625))
    ])


def kowalik_and_osborne(x):
    y, u = KOWALIK.T
    return y - x[0] * (u**2 + u * x[1]) / (u**2 + u * x[2] + x[3])


def rosenbrock_of_many(x):
    return np.concatenate([rosenbrock(pair) for pair in x.reshape(-1, 2)])


PROBLEMS = [  # residual, start, squares at the minimum
    (rosenbrock, [-1.2, 1.0], 0.0),
    (badly_scaled, [0.0, 1.0], 0.0),
    (beale, [1.0, 1.0], 0.0),
    (kowalik_and_osborne, [0.25, 0.39, 0.415, 0.39], 3.07505e-4),
    (rosenbrock_of_many, [-1.2, 1.0] * 5, 0.0),
]


def slopes_of(residual, step=1e-7):
    """Forward differences."""

    def slopes(x):
        shifted = [residual(x + step * e) for e in np.eye(len(x))]
        return (np.array(shifted) - residual(x)).T / step

    return slopes


def solved(residual, start, bounds=FREE, most=200):
    start = np.array(start)
    slopes = slopes_of(residual)
    lower, upper = (np.broadcast_to(b, len(start)).astype(float) for b in bounds)
    return least_squares(
        residual, slopes, (start, slopes(start)), (lower, upper), CONVERGED, most
    )


@pytest.mark.parametrize(("residual", "start", "least"), PROBLEMS)
def test_minima_of_the_literature(residual, start, least):
    found = solved(residual, start)
    assert found.residual == pytest.approx(residual(found.x), abs=0)
    assert found.residual @ found.residual == pytest.approx(least, rel=1e-5, abs=1e-9)


@given(
    st.integers(0, 10**6), st.integers(1, 6),
    st.sampled_from(["free", "between", "at a bound"]),
)  # fmt: skip
def test_a_linear_problem_takes_one_step(seed, k, kind):
    """Its answer by bounded linear least squares; slopes are never taken anew."""
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(12, k)) * 10.0 ** rng.uniform(-3, 3, k), rng.normal(size=12)
    aim = np.linalg.lstsq(A, b)[0]
    lower, upper = np.full(k, -np.inf), np.full(k, np.inf)
    if kind != "free":
        lower, upper = -1.5 * np.abs(aim), 1.5 * np.abs(aim)
    if kind == "at a bound":
        upper[0], lower[0] = (aim[0] - abs(aim[0]), -9 * abs(aim[0]))
    start = np.clip(np.zeros(k), lower, upper)
    asked = []

    def residual(x):
        asked.append(x)
        return A @ x - b

    found = least_squares(
        residual, lambda x: pytest.fail("asked"), (start, A), (lower, upper), 1e-6, 0
    )
    expected = lsq_linear(A, b, (lower, upper), method="bvls")
    r = A @ expected.x - b
    assert found.residual @ found.residual <= (r @ r) * (1 + 1e-6)
    assert np.all((found.x >= lower) & (found.x <= upper))
    assert len(asked) <= 3


@given(st.integers(0, 10**6))
def test_another_method_gets_no_further_from_where_it_ends(seed):
    """A sum of curves with noise, some at their bounds; scipy's TRF goes on from there.

    There are several minima, so that both need not end in the same one from afar.
    """
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 4, 30)
    true = rng.uniform(0.2, 2.0, 4)
    data = true[0] * np.exp(-true[1] * t) + true[2] * t / (t + true[3])
    data += rng.normal(size=30) * 0.01
    lower, upper = np.zeros(4), np.array([true[0] * rng.choice([0.7, 3.0]), 4, 4, 4])
    start = np.array([0.5 * upper[0], 1.0, 1.0, 1.0])

    def residual(x):
        return x[0] * np.exp(-x[1] * t) + x[2] * t / (t + x[3] + 1e-6) - data

    found = solved(residual, start, (lower, upper))
    other = by_scipy(residual, found.x, bounds=(lower, upper), xtol=1e-12, ftol=1e-12)
    squares = found.residual @ found.residual
    assert squares <= 2 * other.cost * (1 + 1e-6)
    assert squares <= residual(start) @ residual(start)


def test_slopes_are_those_where_the_search_ended():
    found = solved(kowalik_and_osborne, PROBLEMS[3][1])
    there = slopes_of(kowalik_and_osborne)(found.x)
    assert np.linalg.norm(found.slopes - there) < 1e-3 * np.linalg.norm(there)


def test_updated_slopes_save_evaluations():
    """Less than half as often taken as residuals are."""
    count = {"residual": 0, "slopes": 0}

    def residual(x):
        count["residual"] += 1
        return kowalik_and_osborne(x)

    slopes = slopes_of(kowalik_and_osborne)

    def counted(x):
        count["slopes"] += 1
        return slopes(x)

    start, free = np.array(PROBLEMS[3][1]), np.full(4, np.inf)
    least_squares(residual, counted, (start, slopes(start)), (-free, free), 1e-6, 200)
    assert count["slopes"] < count["residual"] / 2


def test_slopes_are_taken_anew_as_often_as_is_allowed():
    """A wrong slope leads nowhere; one that is taken anew leads to the minimum."""
    wrong = np.array([[1.0, 0.3], [0.2, -1.0]])
    free = (np.full(2, -np.inf), np.full(2, np.inf))
    start, asked = np.array([0.5, 0.5]), []

    def slopes(x):
        asked.append(x)
        return slopes_of(rosenbrock)(x)

    for most in (0, 1, 40):
        asked.clear()
        found = least_squares(rosenbrock, slopes, (start, wrong), free, 1e-10, most)
        assert len(asked) <= most
        assert found.residual @ found.residual <= rosenbrock(start) @ rosenbrock(start)
    assert found.x == pytest.approx([1, 1], abs=1e-4)
