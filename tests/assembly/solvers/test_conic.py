"""Least energies and factors: optimality written out, proofs, and which is kept."""

import numpy as np
import pytest

from assembly.solvers import conic
from assembly.solvers.cones import cone_sizes, cone_starts
from assembly.solvers.conic import (
    ConeProgramme,
    _certified,
    _certify,
    _compiled,
    least_factor,
    minimise_energy,
)

GROUP = np.array([0, 0, 1, 2, 2])


@pytest.fixture
def rng():
    """Of problems whose rows the interior-point method closes to 1e-11."""
    return np.random.default_rng(3)


def programme(rng, push=1.0, rows=1):
    """Of size 1, with a point within the cones that closes the rows."""
    H = np.linalg.qr(rng.normal(size=(5, rows)))[0].T.copy()
    return ConeProgramme(
        rng.normal(size=(4, 5)) / 3, push * rng.normal(size=4) / 2,
        0.1 * rng.normal(size=5), H, H @ np.array([0.3, -0.2, 0.4, 0.1, 0.2]), GROUP,
    )  # fmt: skip


def test_nothing_to_close_costs_nothing_and_no_clearance_costs_all(rng):
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
def test_within_all_cones_the_solution_is_that_of_linear_equations(rng, unit, scale):
    """G'(G u + h) - d = H'n, H u = k: in any unit of energy and any length of rows."""
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


def test_every_solver_of_the_chain_proves_the_same(rng):
    p = programme(rng)
    least = minimise_energy(*p)
    for solve in conic._SOLVERS["compiled"]:
        u, rigid, status = solve(*p)
        assert status in {"Solved", "AlmostSolved"}
        np.testing.assert_allclose(p.H @ u, p.k, atol=1e-11)
        own = _certify(p, conic.into_cones(u, GROUP), p.G @ u + p.h, rigid)
        assert own.value == pytest.approx(least.value, abs=1e-10)
        assert own.gap <= 1e-10


@pytest.mark.parametrize(
    ("push", "rows"), [(0.2, 0), (1.0, 0), (5.0, 0), (1.0, 1), (5.0, 1)]
)
def test_newton_proves_what_a_poor_guess_does_not(rng, push, rows):
    p = programme(rng, push, rows)
    u, n, _ = _compiled(*p)
    value = _certify(p, u, p.G @ u + p.h, n).value
    poor, refined = _certified(p, 0.9 * u, 0.9 * n, "compiled")
    assert poor.gap > 1e-4
    assert refined.gap <= 1e-9 * (abs(refined.value) + 0.01 * p.h @ p.h)
    assert refined.value == pytest.approx(value, abs=1e-9)
    np.testing.assert_allclose(p.H @ refined.clearances, p.k, atol=1e-11)
    # the multipliers are those of the optimum, with their signs
    slope = p.G.T @ refined.springs - p.d - p.H.T @ refined.rigid_multipliers
    force = -np.bincount(GROUP, slope * refined.clearances)
    np.testing.assert_allclose(slope, -force[GROUP] * refined.clearances, atol=1e-4)


def test_without_loads_any_multiple_of_multipliers_proves_as_much(rng):
    """f gain - f^2 cost / 2 is best at gain / cost, at 0 if nothing is gained."""
    p = programme(rng)._replace(d=np.zeros(5))
    u, n, _ = _compiled(*p)
    springs = p.G @ u + p.h
    for size in (1e-3, 0.3, 1.0, 20.0):
        y, m = size * springs, size * n
        gain = y @ p.h + m @ p.k - cone_sizes(p.G.T @ y - p.H.T @ m, GROUP).sum()
        assert gain > 0.0
        own = _certify(p, u, y, m)
        assert own.bound == pytest.approx(gain**2 / (2 * y @ y), rel=1e-9)
        # the multipliers kept are those of the proof
        z = p.G.T @ own.springs - p.H.T @ own.rigid_multipliers
        proof = own.springs @ p.h + own.rigid_multipliers @ p.k
        proof -= own.springs @ own.springs / 2 + cone_sizes(z, GROUP).sum()
        assert own.bound == pytest.approx(proof, rel=1e-12)
        assert _certify(p, u, -y, -m).bound == pytest.approx(0.0, abs=1e-15)
    assert _certify(p, u, 0 * springs, 5.0 * np.sign(p.k) * -1.0).bound == 0.0


def test_columns_of_cones_begin_where_their_number_does():
    assert cone_starts(GROUP).tolist() == [0, 2, 3, 5]


@pytest.mark.parametrize("row", [1e-5, 1.0, 1e4])
@pytest.mark.parametrize("fixed", [False, True])
def test_the_least_factor_is_proved_by_its_multipliers(rng, row, fixed):
    """n.B u = n.right <= t sum_scaled |(B'n)_k| + sum_fixed |(B'n)_k|, equal at t."""
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


def test_a_factor_of_1_is_found_at_the_first_attempt(monkeypatch):
    """u = 5 along a disc of (3, 4)."""
    solve, calls = conic._clarabel, []

    def counted(*given):
        calls.append(given[-1])
        return solve(*given)

    monkeypatch.setattr(conic, "_clarabel", counted)
    B, all_scaled = np.array([[0.6, 0.8]]), np.array([True, True])
    t, u, _ = least_factor(B, np.array([5.0]), np.zeros(2, np.int64), all_scaled)
    assert t == pytest.approx(5.0, rel=1e-10)
    np.testing.assert_allclose(u, [3.0, 4.0], rtol=1e-6)
    assert calls == [0.0]


@pytest.mark.parametrize("reach", [1.2, 1.9, 30.0])
def test_no_factor_helps_where_what_it_scales_does_not_reach(reach):
    """The interval that is not scaled alone enters the first row."""
    B = np.array([[3.0, 0.0], [50.0, 0.02]])
    right = np.array([3.0 * reach, 0.01])
    t, u, n = least_factor(B, right, np.array([0, 1]), np.array([False, True]))
    assert t is None
    assert not u.any() | n.any()
    right = np.array([3.0 * 0.9, 50.0 * 0.9 + 0.01])
    t, _, _ = least_factor(B, right, np.array([0, 1]), np.array([False, True]))
    assert t == pytest.approx(0.5, rel=1e-7)
