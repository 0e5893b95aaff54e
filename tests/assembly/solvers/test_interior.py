"""A step of the interior-point method: its equations, and how far it may go."""

import numpy as np
import pytest

from assembly.solvers.interior import (
    Programme,
    System,
    _cholesky,
    _direction,
    _dual,
    _fill_system,
    _in_layers,
    _longest,
    _predict,
    _root,
    _violation,
    interior_point,
)
from assembly.solvers.layers import layers_of
from assembly.solvers.nesterov_todd import Point, Scaling, Sides, correct, scale

# as Python, loops warn of what they then look at
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
STARTS = np.array([0, 2, 3, 6, 7])  # cones of two, one, three and one column
SPRINGS, ROWS, WIDTH = 3, 2, 16  # seven columns padded to sixteen
FAR = 1e30


def step_of(rng):
    """A point within all cones, its scaling, and an empty step and system for it."""
    nu, cones = STARTS[-1], len(STARTS) - 1
    programme = Programme(
        rng.normal(size=(SPRINGS, nu)), rng.normal(size=SPRINGS), rng.normal(size=nu),
        rng.normal(size=(ROWS, nu)), rng.normal(size=ROWS), STARTS,
    )  # fmt: skip
    order, layers = layers_of(STARTS)
    M, linear = _in_layers(programme, order)
    assert M.shape == (SPRINGS + ROWS, WIDTH)
    u, z1 = np.zeros((2, WIDTH))
    u[:nu], z1[:nu] = rng.uniform(-0.5, 0.5, size=(2, nu))
    point = Point(u, 1.0 + rng.uniform(size=cones), z1)
    scaling = Scaling(
        layers, *np.zeros((2, cones)), np.zeros(WIDTH), np.zeros(cones),
        np.zeros(WIDTH), *np.zeros((2, cones)), np.zeros((6, cones)),
    )  # fmt: skip
    assert scale(point, scaling)
    m = SPRINGS + ROWS
    system = System(
        M, np.zeros((m, WIDTH)), np.zeros((m, m)), np.zeros(ROWS), np.zeros(m),
        *np.zeros((2, WIDTH)),
    )  # fmt: skip
    step = Point(np.zeros(WIDTH), np.zeros(cones), np.zeros(WIDTH))
    sides = Sides(np.zeros(cones), np.zeros(WIDTH), np.zeros(cones))
    return programme, order, linear, point, scaling, system, step, sides


def columns_of(order, c):
    """Of the cone whose head is the c-th: heads are sorted as the first layer is."""
    cone = np.searchsorted(STARTS, order[c])
    return slice(STARTS[cone], STARTS[cone + 1])


def by_cone(values, order, c):
    own = np.empty(STARTS[-1])
    own[order] = values[: STARTS[-1]]
    return own[columns_of(order, c)]


def scaling_matrix(scaling, order, c):
    """W = eta [w0, w1'; w1, 1 + w1 w1' / (1 + w0)]."""
    w0, w1 = scaling.w0[c], by_cone(scaling.w1, order, c)
    inner = np.eye(len(w1)) + np.outer(w1, w1) / (1 + w0)
    return scaling.eta[c] * np.block([[np.array([[w0]]), w1[None]],
                                      [w1[:, None], inner]])  # fmt: skip


def test_columns_in_layers_are_those_of_the_programme(rng):
    programme, order, linear, *_, system, _, _ = step_of(rng)
    assert np.array_equal(linear[:7], -programme.d[order])
    stacked = np.vstack([programme.G, programme.H])
    assert np.array_equal(system.M[:, :7], stacked[:, order])
    assert not linear[7:].any()
    assert not system.M[:, 7:].any()


def test_the_worst_row_is_the_violation_and_all_are_kept(rng):
    programme, _, _, point, _, system, _, _ = step_of(rng)
    wanted = programme.k - system.M[SPRINGS:] @ point.u
    assert _violation(system, programme.k, point.u) == pytest.approx(
        np.abs(wanted).max(), rel=1e-12
    )
    assert system.residual == pytest.approx(wanted, rel=1e-12)


def test_the_dual_is_what_multipliers_pull_along_the_columns(rng):
    _, _, linear, _, _, system, _, _ = step_of(rng)
    y, z1 = rng.normal(size=SPRINGS + ROWS), rng.normal(size=WIDTH)
    _dual(system.M, y, linear, z1)
    assert z1 == pytest.approx(system.M.T @ y + linear, rel=1e-12)


def test_the_system_is_that_of_the_eliminated_columns(rng):
    """S = M D^-1 M' + 1 for springs, and B is a root of it."""
    _, order, _, _, scaling, system, _, _ = step_of(rng)
    _fill_system(system, scaling)
    D_inverse = np.zeros((7, 7))
    for c in range(len(STARTS) - 1):
        W = scaling_matrix(scaling, order, c)
        own = columns_of(order, c)
        # of W^-2 what stays once the head of the step is zero
        D_inverse[own, own] = np.linalg.inv(np.linalg.inv(W @ W)[1:, 1:])
    wanted = system.M[:, :7] @ D_inverse[np.ix_(order, order)] @ system.M[:, :7].T
    wanted[:SPRINGS, :SPRINGS] += np.eye(SPRINGS)
    inverse = system.B @ system.B.T
    inverse[:SPRINGS, :SPRINGS] += np.eye(SPRINGS)
    lower = np.tril_indices(len(wanted))
    assert system.S[lower] == pytest.approx(inverse[lower], rel=1e-12)
    assert system.S[lower] == pytest.approx(wanted[lower], rel=1e-10)


@pytest.mark.parametrize("corrected", [False, True])
def test_a_direction_closes_the_rows_balances_and_solves_the_scaled_cones(
    rng, corrected
):
    """H du = k - H u; dz1 = M'(G du, dn); W dz + W^-1 ds = t in every cone."""
    programme, order, _, point, scaling, system, step, sides = step_of(rng)
    _violation(system, programme.k, point.u)
    _fill_system(system, scaling)
    assert _cholesky(system.S)
    _predict(point, scaling, sides)
    if corrected:
        past = Point(*(rng.normal(size=len(part)) for part in point))
        past.u[7:] = past.z1[7:] = 0.0
        correct(scaling, past, 0.4, sides)
    _direction(system, scaling, sides, point, step)
    M, right = system.M, system.right
    assert M[SPRINGS:] @ step.u == pytest.approx(system.residual, rel=1e-9)
    assert right[:SPRINGS] == pytest.approx(M[:SPRINGS] @ step.u, rel=1e-9)
    assert step.z1 == pytest.approx(M.T @ right, rel=1e-12, abs=1e-14)
    for c in range(len(STARTS) - 1):
        W = scaling_matrix(scaling, order, c)
        dz = np.r_[step.z0[c], by_cone(step.z1, order, c)]
        ds = np.r_[0.0, by_cone(step.u, order, c)]
        t = np.r_[sides.t0[c], by_cone(sides.t1, order, c)]
        assert W @ dz + np.linalg.solve(W, ds) == pytest.approx(t, rel=1e-9, abs=1e-12)
        # the predictor heads for complementarity: t = -l
        if not corrected:
            l = np.r_[scaling.l0[c], by_cone(scaling.l1, order, c)]
            assert t == pytest.approx(-l, rel=1e-13)
            z = np.r_[point.z0[c], by_cone(point.z1, order, c)]
            s = np.r_[1.0, by_cone(point.u, order, c)]
            assert sides.r0[c] == pytest.approx(-s @ z, rel=1e-13)


def test_a_factor_times_its_transpose_is_the_system(rng):
    root = rng.normal(size=(5, 5))
    S = root @ root.T
    L = S.copy()
    assert _cholesky(L)
    factor = np.tril(L, -1) + np.diag(1 / np.diag(L))
    assert factor @ factor.T == pytest.approx(S, rel=1e-10)


def test_a_row_lost_to_rounding_is_left_alone_and_no_number_is_refused():
    """Twice the same row: the second unknown is held by a huge pivot."""
    S = np.array([[4.0, 4.0], [4.0, 4.0]])
    assert _cholesky(S)
    assert S[1, 1] == 1e-64
    assert S[0, 0] == pytest.approx(0.5, rel=1e-15)
    assert S[1, 0] == pytest.approx(2.0, rel=1e-15)
    # a row that is nothing is lost likewise
    nothing = np.diag([1.0, 0.0])
    assert _cholesky(nothing)
    assert nothing[1, 1] == 1e-64
    # 1e-14 of the diagonal is still a pivot, in any unit
    for unit in (2.0**-40, 1.0, 2.0**40):
        near = unit * np.array([[1.0, 1.0], [1.0, 1.0 + 1e-14]])
        assert _cholesky(near)
        assert 1e6 < near[1, 1] * np.sqrt(unit) < 1e8
    assert not _cholesky(np.diag([1.0, np.nan]))
    assert not _cholesky(np.diag([1.0, -1.0]))


@pytest.mark.parametrize(
    ("roots", "smallest"),
    [((-2.0, 3.0), 3.0), ((-0.1, 0.2), 0.2), ((1e-9, -5.0), 1e-9), ((2.0, 0.5), 0.5)],
)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 7.0])
def test_the_smallest_positive_root_of_a_quadratic_is_found(roots, smallest, scale):
    """a (t - r) (t - s) that is negative at 0, or bends back there."""
    r, s = roots
    a = -scale if r * s > 0 else scale
    found = _root(a, -a * (r + s) / 2, a * r * s)
    assert found == pytest.approx(smallest, rel=1e-9)


def test_where_a_quadratic_stays_negative_there_is_no_root():
    assert _root(-1.0, 0.1, -1.0) == FAR  # no real one
    assert _root(-1.0, -2.0, -1.0) == FAR  # both behind
    assert _root(0.0, -1.0, -1.0) == FAR
    assert _root(0.0, 0.0, -1.0) == FAR
    assert _root(0.0, 2.0, -1.0) == pytest.approx(0.25)  # a line
    assert _root(-1.0, 1.0, -1.0) == pytest.approx(1.0)  # it touches


@pytest.mark.parametrize("part", ["u", "z", "both", "heads"])
@pytest.mark.parametrize("seed", range(6))
def test_the_longest_step_is_where_the_first_cone_is_left(seed, part):
    """By halving: |u_k| <= 1 and |z_k| <= z0_k in all cones before, not after."""
    rng = np.random.default_rng(seed)
    _, order, _, point, scaling, _, step, _ = step_of(rng)
    if part in {"u", "both"}:
        step.u[:7] = rng.normal(size=7)
    if part in {"z", "both"}:
        step.z1[:7] = rng.normal(size=7)
    if part != "u":
        step.z0[:] = rng.normal(size=4) - 0.5 * (part == "heads")

    def within(t):
        u, z0, z1 = (a + t * b for a, b in zip(point, step, strict=True))
        return all(
            np.linalg.norm(by_cone(u, order, c)) <= 1
            and np.linalg.norm(by_cone(z1, order, c)) <= z0[c]
            for c in range(4)
        )

    low, high = 0.0, 1e4
    assert within(low)
    assert not within(high)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if within(middle) else (low, middle)
    assert _longest(scaling, point, step) == pytest.approx(low, rel=1e-9)


def test_of_no_step_any_multiple_is_allowed(rng):
    *_, point, scaling, _, step, _ = step_of(rng)
    assert _longest(scaling, point, step) == FAR
    step.z0[:] = 1.0  # into the cone
    assert _longest(scaling, point, step) == FAR


@pytest.mark.parametrize("rows", [0, 2])
def test_a_start_that_solves_the_problem_takes_no_iteration(rows):
    """No load and nothing to close: u = 0, its gap the starting multipliers' heads."""
    nu, cones = STARTS[-1], len(STARTS) - 1
    p = Programme(
        np.zeros((0, nu)), np.zeros(0), np.zeros(nu), np.eye(nu)[:rows].copy(),
        np.zeros(rows), STARTS,
    )  # fmt: skip
    u, n, taken = interior_point(p, cones + 0.5, 0.0)
    assert taken == 0
    assert not u.any()
    assert not n.any()
    assert len(n) == rows
    # one less is asked for: the heads alone are one each
    assert interior_point(p, cones - 0.5, 0.0)[2] > 0


def test_rows_that_no_clearance_closes_break_the_method_down():
    p = Programme(
        np.zeros((0, 2)), np.zeros(0), np.zeros(2), np.array([[1.0, 0.0]]),
        np.array([3.0]), np.array([0, 2]),
    )  # fmt: skip
    u, _, taken = interior_point(p, 1e-9, 0.0)
    assert taken == -1
    assert np.linalg.norm(u) <= 1 + 1e-9


def programme(seed, rows):
    rng = np.random.default_rng(seed)
    nu = STARTS[-1]
    H = np.linalg.qr(rng.normal(size=(nu, rows)))[0].T.copy()
    return Programme(
        rng.normal(size=(SPRINGS, nu)), 2.0 * rng.normal(size=SPRINGS),
        0.3 * rng.normal(size=nu), H, H @ (0.3 * rng.uniform(-1, 1, nu)), STARTS,
    )  # fmt: skip


def gap_and_energy(p, u, n):
    """|G u + h|^2 / 2 - d.u above what y = G u + h and n prove, and the first term."""
    y = p.G @ u + p.h
    z = p.G.T @ y + p.H.T @ n - p.d
    sizes = np.sqrt(np.add.reduceat(z * z, STARTS[:-1]))
    return z @ u + sizes.sum(), y @ y / 2


@pytest.mark.parametrize("rows", [0, 2])
@pytest.mark.parametrize("seed", range(3))
def test_the_method_stops_at_the_first_gap_that_is_small_enough(seed, rows):
    """Asked a little less than it left, it takes one more step; a little more, none.

    The gap in z0, s.z over all cones, is at least that which u and n prove; near the
    end of a step the two are as good as the same.
    """
    p = programme(seed, rows)
    u, n, taken = interior_point(p, 1e-3, 0.0)
    gap, energy = gap_and_energy(p, u, n)
    assert 0 < gap <= 1e-3
    low, high = 0.0, 1e-3
    for _ in range(20):
        middle = (low + high) / 2
        same = interior_point(p, middle, 0.0)[2] == taken
        low, high = (low, middle) if same else (middle, high)
    assert gap <= high
    # the same with parts of the springs' energy, alone and beside a gap
    for share in (0.0, 0.5):
        beside = (1 - share) * high / energy
        for factor, more in ((1.01, 0), (0.99, 1)):
            asked = factor * share * high, factor * beside
            assert interior_point(p, *asked)[2] == taken + more


@pytest.mark.parametrize("seed", range(3))
def test_however_large_a_gap_may_be_rows_are_closed(seed):
    p = programme(seed, 2)
    u, _, taken = interior_point(p, 100.0, 0.0)
    assert taken > 0
    assert np.abs(p.H @ u - p.k).max() < 1e-12
