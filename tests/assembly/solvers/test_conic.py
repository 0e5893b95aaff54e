"""Optimality conditions and proofs of minimum energies and factors."""

import numpy as np
import pytest

from forcefit.assembly.solvers.cones import cone_sizes
from forcefit.assembly.solvers.conic import least_factor, minimise_energy
from forcefit.assembly.solvers.pressed_cones import refine

GROUP = np.array([0, 0, 1, 2, 2])


@pytest.fixture
def rng():
    """Return a generator of problems that the interior-point method solves to 1e-11."""
    return np.random.default_rng(3)


def test_minimum_energy_is_between_zero_and_that_without_clearance(rng):
    G, H, h = rng.normal(size=(2, 5)), rng.normal(size=(1, 5)), np.array([3.0, 4.0])
    none = minimise_energy(G, 0 * h, np.zeros(5), H, np.zeros(1), GROUP)
    assert (none.value, none.bound, none.feasible) == (0.0, 0.0, True)
    assert [len(x) for x in (none.clearances, none.springs)] == [5, 2]
    assert not none.clearances.any()
    empty = np.zeros((2, 0)), h, np.zeros(0), np.zeros((0, 0)), np.zeros(0)
    rigid = minimise_energy(*empty, np.zeros(0, np.int64))
    assert (rigid.value, rigid.bound, rigid.gap) == (12.5, 12.5, 0.0)
    assert np.array_equal(rigid.springs, h)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 30.0])
def test_solution_inside_all_cones_satisfies_linear_equations(rng, unit, scale):
    """The equations are G'(G u + h) - d = H'n and H u = k."""
    G, H = rng.normal(size=(6, 5)), scale * np.array([[1.0], [7.0]]) * np.eye(2, 5)
    u, n = np.array([0.1, 0.2, -0.3, 0.1, 0.2]), np.array([0.4, -0.3]) / scale
    h = 0.2 * rng.normal(size=6)
    d = G.T @ (G @ u + h) - H.T @ n
    units = np.sqrt(unit)
    least = minimise_energy(units * G, units * h, unit * d, H, H @ u, GROUP)
    np.testing.assert_allclose(least.clearances, u, atol=1e-7)
    np.testing.assert_allclose(least.springs, units * (G @ u + h), atol=1e-7 * units)
    np.testing.assert_allclose(
        least.rigid_multipliers, unit * n, atol=1e-6 * unit / scale
    )
    value = unit * (np.sum((G @ u + h) ** 2) / 2 - d @ u)
    assert least.value == pytest.approx(value, abs=1e-11 * unit)
    assert 0 <= least.gap + 1e-15 * unit <= 1e-8 * unit


@pytest.mark.parametrize("row", [1e-5, 1.0, 1e4])
@pytest.mark.parametrize("fixed", [False, True])
def test_multipliers_give_a_tight_bound_on_the_factor(rng, row, fixed):
    """The bound n.right <= t sum_scaled |(B'n)_k| + sum_fixed |(B'n)_k| is attained."""
    B, scaled = rng.normal(size=(2, 5)), ~(fixed & (GROUP == 1))
    right = B @ np.array([3.0, 4.0, 0.0, 1.0, 2.0]) + B[:, 2]
    lengths = np.array([row, 7.0 * row])
    t, u, n = least_factor(lengths[:, None] * B, lengths * right, GROUP, scaled)
    alone, _, _ = least_factor(B, right, GROUP, scaled)
    assert t == pytest.approx(alone, rel=1e-8)
    np.testing.assert_allclose(B @ u, right, atol=1e-8)
    assert (cone_sizes(u, GROUP) <= np.where(scaled, t, 1.0)[[0, 2, 3]] + 1e-8).all()
    n = n * lengths
    reach = cone_sizes(B.T @ n, GROUP)
    own = scaled[[0, 2, 3]]
    assert reach[own].sum() == pytest.approx(1.0, abs=1e-7)
    assert n @ right - reach[~own].sum() == pytest.approx(t, rel=1e-7)


@pytest.mark.parametrize("reach", [1.2, 1.9, 30.0])
def test_infeasible_equation_without_scaled_cones_has_no_factor(reach):
    """The first equation contains only an interval that is not scaled."""
    B = np.array([[3.0, 0.0], [50.0, 0.02]])
    right = np.array([3.0 * reach, 0.01])
    t, u, n = least_factor(B, right, np.array([0, 1]), np.array([False, True]))
    assert t is None
    assert not u.any() | n.any()
    right = np.array([3.0 * 0.9, 50.0 * 0.9 + 0.01])
    t, _, _ = least_factor(B, right, np.array([0, 1]), np.array([False, True]))
    assert t == pytest.approx(0.5, rel=1e-7)


NONE = np.zeros((0, 2))


@pytest.mark.parametrize("off", [0.0, 1e-3, 1e-2])
def test_loaded_disc_is_at_the_point_nearest_to_the_target(off):
    """The minimum of |u - a| over |u| <= 1 is a / |a|, with the force |a| - 1 = 12."""
    a = np.array([5.0, 12.0])
    guess = (1.0 - off) * np.array([np.cos(1.17 + off), np.sin(1.17 + off)])
    problem = (np.eye(2), -a, np.zeros(2), NONE, np.zeros(0), np.zeros(2, np.int64))
    u, y, n = next(refine(problem, guess, np.zeros(0)))
    assert u == pytest.approx(a / 13, abs=1e-9)
    assert y == pytest.approx(a / 13 - a, abs=1e-8)
    assert len(n) == 0


def test_loaded_interval_is_at_its_bound():
    """The maximum of 3 u_1 + u_2 with u_1 + u_2 = 1 / 2 is at (1, -1 / 2)."""
    H, k = np.array([[1.0, 1.0]]), np.array([0.5])
    problem = (NONE, np.zeros(0), np.array([3.0, 1.0]), H, k, np.array([0, 1]))
    u, y, n = next(refine(problem, np.array([0.999, -0.498]), np.array([-1.01])))
    assert u == pytest.approx([1.0, -0.5], abs=1e-12)
    assert len(y) == 0
    assert n == pytest.approx([-1.0], abs=1e-9)
