"""Newton's method on the dual: where it starts, when it is done, when it gives up."""

import numpy as np
import pytest

from assembly.solvers.dual_newton import Dual, _solve, dual_newton
from assembly.solvers.interior import Programme, interior_point

# as Python, loops warn of what they then look at
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
STARTS = np.array([0, 2, 3, 5, 6])  # discs and intervals
SPRINGS = 4


def programme(seed, rows):
    rng = np.random.default_rng(seed)
    H = np.linalg.qr(rng.normal(size=(6, rows)))[0].T.copy()
    return Programme(
        rng.normal(size=(SPRINGS, 6)) / 3, rng.normal(size=SPRINGS),
        0.05 * rng.normal(size=6), H, H @ (0.2 * rng.uniform(-1, 1, 6)), STARTS,
    )  # fmt: skip


def dual_of(p, relative=1e-10, absolute=1e-13):
    return Dual(
        np.vstack([p.G, p.H]).T.copy(), np.r_[p.h, -p.k], p.d, SPRINGS, STARTS,
        relative, absolute,
    )  # fmt: skip


def gap_of(p, u, y):
    """Of u and any multipliers: |G u + h - y|^2 / 2 + sum (|z| + z.u), rows' work."""
    springs, n = y[:SPRINGS], y[SPRINGS:]
    z = p.G.T @ springs + p.H.T @ n - p.d
    open_ = p.G @ u + p.h - springs
    sizes = np.sqrt(np.add.reduceat(z * z, STARTS[:-1]))
    return open_ @ open_ / 2 + sizes.sum() + z @ u - n @ (p.H @ u - p.k)


def energy_of(p, u):
    return float(np.sum((p.G @ u + p.h) ** 2) / 2)


def guess(p):
    u, n, _ = interior_point(p, 1e-5, 0.0)
    return u, np.r_[np.zeros(SPRINGS), n]


def solved(seed, rows):
    """A problem made from its solution: every cone presses, with a force z of 1 to 2.

    u = -z / |z| there, and z = G^T y + H^T n - d, h = y - G u, k = H u.
    """
    rng = np.random.default_rng(seed)
    G, y = rng.normal(size=(SPRINGS, 6)) / 3, rng.normal(size=SPRINGS)
    H = np.linalg.qr(rng.normal(size=(6, rows)))[0].T.copy()
    n = rng.normal(size=rows)
    z = rng.normal(size=6)
    sizes = np.repeat(np.sqrt(np.add.reduceat(z * z, STARTS[:-1])), np.diff(STARTS))
    u = -z / sizes
    z *= np.repeat(rng.uniform(1, 2, len(STARTS) - 1), np.diff(STARTS)) / sizes
    return Programme(
        G, y - G @ u, G.T @ y + H.T @ n - z, H, H @ u, STARTS
    ), u, np.r_[y, n]  # fmt: skip


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_newton_converges_from_near_where_every_cone_presses(rows):
    """There the dual is smooth; rows are closed to the 1e-13 that it accepts."""
    for seed in range(8):
        p, expected, multipliers = solved(seed, rows)
        away = np.random.default_rng(seed).uniform(-1e-3, 1e-3, (2, 6))
        u, y = (1 - 1e-3) * expected + away[0] / 10, multipliers.copy()
        y[SPRINGS:] += away[1, :rows]
        taken = dual_newton(dual_of(p), 60, 1e4, u, y)
        assert taken > 0
        assert np.abs(p.H @ u - p.k).max(initial=0.0) < 3e-13
        assert gap_of(p, u, y) <= 1.01e-10 * energy_of(p, u) + 1e-12
        # the dual curves by 1 along the springs: |y - y*|^2 / 2 is no more than the gap
        assert y[:SPRINGS] == pytest.approx(multipliers[:SPRINGS], abs=1e-4)
        assert energy_of(p, u) - p.d @ u == pytest.approx(
            energy_of(p, expected) - p.d @ expected, abs=1e-9
        )


@pytest.mark.parametrize("rows", [0, 1])
def test_what_newton_calls_done_from_a_near_guess_is_proved(rows):
    """Where cones are inactive it may give up on rows, and says so."""
    for seed in range(8):
        p = programme(seed, rows)
        u, y = guess(p)
        taken = dual_newton(dual_of(p), 60, 1e4, u, y)
        assert np.sqrt(np.add.reduceat(u * u, STARTS[:-1])).max() <= 1 + 1e-14
        if rows and taken < 0:
            continue
        assert taken > 0
        assert np.abs(p.H @ u - p.k).max(initial=0.0) < 3e-13
        assert gap_of(p, u, y) <= 1.01e-10 * energy_of(p, u) + 1e-12
        best, _, _ = interior_point(p, 1e-10, 0.0)
        assert energy_of(p, u) - p.d @ u == pytest.approx(
            energy_of(p, best) - p.d @ best, abs=1e-8
        )


def test_rows_that_are_open_are_not_done_however_large_a_gap_may_be():
    p = programme(3, 1)
    u, y = 0 * p.d, np.zeros(SPRINGS + 1)
    assert dual_newton(dual_of(p, 0.0, 100.0), 60, 1e-3, u, y) != 0
    assert dual_newton(dual_of(p, 0.0, 100.0), 0, 1e-3, 0 * u, y) == -1
    # closed by a guess, it is done at once
    u = np.linalg.lstsq(p.H, p.k)[0]
    y = np.zeros(SPRINGS + 1)
    assert dual_newton(dual_of(p, 0.0, 100.0), 60, 1e-25, u, y) == 0


@pytest.mark.parametrize("seed", range(3))
def test_of_its_own_solution_it_takes_no_step(seed):
    """The springs' multipliers follow from the clearances: G u + h."""
    p = programme(seed, 0)
    u, y = guess(p)
    assert dual_newton(dual_of(p), 60, 1e4, u, y) > 0
    found, again = u.copy(), np.full(SPRINGS, 7.0)
    assert dual_newton(dual_of(p, 1e-8, 1e-10), 60, 1.0, u, again) == 0
    assert u == pytest.approx(found, abs=1e-5)
    assert again == pytest.approx(y, abs=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_what_is_small_enough_is_a_part_of_the_energy_and_a_gap(seed):
    """Asked for less than the first guess leaves, it goes on; for more, it does not."""
    p = programme(seed, 0)
    u, _ = guess(p)
    u *= 0.99
    y = p.G @ u + p.h
    # sigma so small that u stays where it is
    gap, energy = gap_of(p, u, y), energy_of(p, u)
    for relative, absolute, enough in (
        (0.0, 1.01 * gap, True), (0.0, 0.99 * gap, False),
        (1.01 * gap / energy, 0.0, True), (0.99 * gap / energy, 0.0, False),
        (0.5 * gap / energy, 0.51 * gap, True), (0.5 * gap / energy, 0.49 * gap, False),
    ):  # fmt: skip
        own = u.copy()
        taken = dual_newton(dual_of(p, relative, absolute), 60, 1e-9, own, y.copy())
        assert (taken == 0) == enough


def test_too_few_steps_are_no_answer():
    """None is done where some are asked for, and as many as asked for are enough."""
    p = programme(0, 0)
    u, y = np.zeros((2, 6))
    needed = dual_newton(dual_of(p), 60, 1e2, u, y[:SPRINGS])
    assert needed > 2
    for steps, expected in ((needed - 1, -1), (needed, needed)):
        u, y = np.zeros((2, 6))
        assert dual_newton(dual_of(p), steps, 1e2, u, y[:SPRINGS]) == expected


@pytest.mark.parametrize("count", [1, 2, 5])
def test_the_system_is_solved_from_its_lower_half(rng, count):
    root = rng.normal(size=(count, count))
    S, g, x = root @ root.T + np.eye(count), rng.normal(size=count), np.zeros(count)
    lower = np.tril(S) + np.triu(np.full((count, count), np.nan), 1)
    assert _solve(lower, g, x)
    assert x == pytest.approx(np.linalg.solve(S, g), rel=1e-10)
    assert not _solve(np.zeros((count, count)), g, x)
