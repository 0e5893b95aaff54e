"""Least energies and factors: optimality written out, proofs, and which is kept."""

from types import SimpleNamespace

import clarabel
import numpy as np
import pytest

from assembly.solvers import conic, one_problem
from assembly.solvers.cones import cone_sizes, cone_starts
from assembly.solvers.conic import (
    GAP,
    GAP_WITHOUT_CLEARANCE,
    ConeProgramme,
    ConicSolution,
    _certified,
    _certify,
    _compiled,
    _proved,
    _proves_no_point,
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


def solution_of(u, n, status="Solved"):
    return lambda *p: (u, n, status)


def test_the_smallest_gap_is_kept_and_a_proof_ends_the_search(rng, monkeypatch):
    p = programme(rng)
    u, n, _ = _compiled(*p)
    asked = []

    def fails(*p):
        asked.append("failed")
        return None, n, "NumericalError"

    def refused(*p):
        raise AssertionError

    good = solution_of(u, n)
    monkeypatch.setitem(conic._SOLVERS, "compiled", (fails, good, refused))
    assert minimise_energy(*p).gap <= 1e-10
    assert asked == ["failed"]
    # without a proof all are asked, and the best one counts wherever it comes
    monkeypatch.setattr(conic, "_proved", lambda *_: False)
    poor, worse = solution_of(0.9 * u, 0.9 * n), solution_of(0.5 * u, 0.0 * n)
    monkeypatch.setattr(conic, "_certified", lambda p, u, n, _: [
        _certify(p, u, p.G @ u + p.h, n)
    ])  # fmt: skip
    for order in ((worse, good, poor), (good, poor), (poor, worse, good)):
        monkeypatch.setitem(conic._SOLVERS, "compiled", order)
        np.testing.assert_allclose(minimise_energy(*p).clearances, u, atol=1e-9)
    monkeypatch.setitem(conic._SOLVERS, "compiled", (fails, fails))
    with pytest.raises(conic.SolverFailed, match="NumericalError"):
        minimise_energy(*p)


def test_a_proof_is_a_tenth_of_the_gap_that_counts():
    h = np.array([3.0, 4.0])
    for value in (0.0, -2.0, 7.0):
        most = (GAP * abs(value) + GAP_WITHOUT_CLEARANCE * 12.5) / 10
        for share, proved in ((0.9, True), (1.1, False)):
            none = np.zeros(0)
            least = ConicSolution(none, none, none, share * most, 0.0)
            least = ConicSolution(none, none, none, value, value - least.value)
            # what value itself cannot resolve
            if value == 0.0 or most > 1e-9:
                assert _proved(least, h) is proved


@pytest.mark.parametrize("where", ["u", "n", "rows"])
def test_a_compiled_solution_that_is_none_or_leaves_rows_open_is_refused(
    rng, monkeypatch, where
):
    p = programme(rng, rows=2)
    u, n, _ = _compiled(*p)
    assert u is not None
    given = u.copy(), n.copy()
    if where == "rows":
        given[0][:] += 1e-9 * p.H[0]
    else:
        given["un".index(where)][0] = np.nan
    monkeypatch.setattr(one_problem, "interior_point", lambda *_: given)
    assert _compiled(*p)[0] is None
    # rows count without a sign, and there need be none
    given = u - 1e-9 * p.H[0], n
    assert _compiled(*p)[0] is None
    free = p._replace(H=np.zeros((0, 5)), k=np.zeros(0))
    given = u, np.zeros(0)
    assert _compiled(*free)[0] is u


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


def test_newton_is_for_discs_and_intervals_and_its_ends_are_looked_at(rng, monkeypatch):
    p = programme(rng)
    u, n, _ = _compiled(*p)
    ball = p._replace(group=np.array([0, 0, 0, 1, 1]))
    assert len(list(_certified(ball, 0.1 * u, n, "compiled"))) == 1
    seen, change = [], [0.0, 0.0]

    def newton(problem, starts, limits, at, y):
        seen.append(limits)
        at[:], y[:] = u + change[0], np.r_[p.G @ u + p.h, -n] + change[1]
        return True

    monkeypatch.setattr(one_problem, "newton", newton)
    for change[:], candidates in (
        ((0.0, 0.0), 2), ((np.nan, 0.0), 1), ((0.0, np.nan), 1),
        ((1e-9 * p.H[0], 0.0), 1), ((-1e-9 * p.H[0], 0.0), 1),
    ):  # fmt: skip
        assert len(list(_certified(p, 0.1 * u, n, "compiled"))) == candidates
    limits = seen[0]  # the same part of both parts of the gap that counts
    least = GAP_WITHOUT_CLEARANCE * np.sum(p.h**2) / 2
    assert limits.relative / GAP == pytest.approx(limits.absolute / least, rel=1e-12)


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


@pytest.mark.parametrize(
    ("status", "x", "usable"),
    [
        ("Solved", 0.5, True),
        ("InsufficientProgress", 0.5, True),
        ("Solved", np.nan, False),
        ("NumericalError", 0.5, False),
    ],
)
@pytest.mark.parametrize("z", [0.0, np.nan])
def test_clarabels_end_is_used_where_it_is_a_number(monkeypatch, status, x, usable, z):
    end = SimpleNamespace(status=status, x=[x], z=[z])
    solver = SimpleNamespace(solve=lambda: end)
    monkeypatch.setattr(clarabel, "DefaultSolver", lambda *_: solver)
    cones = conic._Cones(equal=1, group=np.zeros(1, np.int64))
    found, dual, said = conic._clarabel(None, None, None, None, cones, 0.0)
    assert (found is not None) == (usable and z == 0.0)
    assert said == status
    assert len(dual) == 1


def test_a_proof_that_no_point_exists_is_above_its_rounding():
    """|u| <= 1 does not reach 1 + 4e-13; the terms' rounding is 2e-13."""
    H, group = np.array([[0.6, 0.8]]), np.zeros(2, np.int64)
    for n, beyond, proves in (
        (1.0, 0.0, False), (1.0, 1e-13, False), (1.0, 2e-13, False),
        (1.0, 4e-13, True), (100.0, 2e-13, False), (100.0, 4e-13, True),
        (0.01, 2e-13, False), (0.01, 4e-13, True), (-1.0, 4e-13, False),
    ):  # fmt: skip
        given = np.array([n]), H, np.array([1.0 + beyond]), group, np.ones(1)
        assert _proves_no_point(*given) is proves
