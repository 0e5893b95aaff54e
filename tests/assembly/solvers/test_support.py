"""Supporting planes of a convex body of screws: closed forms, certificates, points."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize_scalar

from assembly.solvers.support import (
    ConvexBody,
    gradient_along,
    screw_at,
    support,
    symmetric,
    within,
)

STARTS = np.array([0, 2, 3, 6])  # cones of two, one and three columns


def cone_sizes(v, starts=STARTS):
    return np.sqrt(np.add.reduceat(np.asarray(v) ** 2, starts[:-1]))


def body(rng, rows, starts=STARTS, share=0.5):
    """Rows orthonormal, the start within all cones."""
    nv = starts[-1]
    start = rng.normal(size=nv)
    start *= share / cone_sizes(start, starts).max()
    H = np.linalg.qr(rng.normal(size=(nv, rows)))[0].T.copy()
    return ConvexBody(
        rng.normal(size=6), rng.normal(size=(6, nv)), H, start, starts
    )  # fmt: skip


def direction(rng):
    d = rng.normal(size=3)
    return d / np.linalg.norm(d)


def proof(one, part, d, n):
    """d.(centre - X start) + n.H start + sum |(X'd - H'n)_k|, and that gradient."""
    X = one.map[part : part + 3]
    gradient = X.T @ d - one.rows.T @ n
    height = d @ (one.centre[part : part + 3] - X @ one.start)
    return (
        height + n @ one.rows @ one.start + cone_sizes(gradient, one.starts).sum(),
        gradient,
    )


@pytest.mark.parametrize("part", [0, 3])
def test_without_rows_each_cone_is_at_its_end_along_its_gradient(rng, part):
    """d.centre - X'd . start + sum |X'd|_k, at v_k = (X'd)_k / |(X'd)_k|."""
    one, d = body(rng, 0), direction(rng)
    height, v, gradient, n = support(one, part, d, 1e-9)
    expected, slope = proof(one, part, d, np.zeros(0))
    assert height == pytest.approx(expected, rel=1e-13)
    assert gradient == pytest.approx(slope, rel=1e-13)
    assert gradient_along(one, part, d, 1e-9) == pytest.approx(slope, rel=1e-13)
    assert cone_sizes(v) == pytest.approx(np.ones(3), rel=1e-13)
    assert d @ screw_at(one, v)[part : part + 3] == pytest.approx(height, rel=1e-12)
    assert len(n) == 0


@pytest.mark.parametrize("units", [1e-6, 1.0])
@pytest.mark.parametrize("rows", [1, 3])
def test_with_rows_height_and_point_meet_to_the_tolerance(rng, rows, units):
    one, d = body(rng, rows), direction(rng)
    one = one._replace(map=units * one.map, centre=units * one.centre)
    tolerance = 1e-7 * units
    height, v, gradient, n = support(one, 3, d, tolerance)
    expected, slope = proof(one, 3, d, n)
    assert height == pytest.approx(expected, rel=1e-12)
    assert gradient == pytest.approx(slope, rel=1e-12, abs=1e-14 * units)
    assert cone_sizes(v).max() < 1 + 1e-12
    assert np.abs(one.rows @ (v - one.start)).max() < 1e-13
    reached = d @ screw_at(one, v)[3:]
    assert -1e-13 * units < height - reached < 2 * tolerance


def test_one_row_has_the_multiplier_that_bounds_best(rng):
    """The certified height is convex in n: its least by a search along a line."""
    one, d = body(rng, 1), direction(rng)
    least = minimize_scalar(
        lambda n: proof(one, 0, d, np.array([n]))[0], (-1, 1), tol=1e-12
    )
    height, *_ = support(one, 0, d, 1e-9)
    assert height == pytest.approx(least.fun, abs=1e-8)


def test_intervals_alone_are_a_linear_programme(rng):
    one, d = body(rng, 2, np.arange(7)), direction(rng)
    slope = one.map[3:].T @ d
    least = linprog(
        -slope, A_eq=one.rows, b_eq=one.rows @ one.start, bounds=[(-1, 1)] * 6
    )
    expected = d @ (one.centre[3:] - one.map[3:] @ one.start) - least.fun
    assert support(one, 3, d, 1e-9)[0] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("rows", [0, 1])
def test_where_nothing_moves_along_a_direction_the_body_is_as_high_as_its_start(
    rng, rows
):
    one = body(rng, rows)
    flat = one.map.copy()
    flat[3] = 0.0
    one = one._replace(map=flat)
    height, v, gradient, n = support(one, 3, np.array([1.0, 0.0, 0.0]), 1e-9)
    assert height == pytest.approx(one.centre[3], rel=1e-14)
    assert v == pytest.approx(one.start, rel=1e-14)
    assert not gradient.any()
    assert not n.any()
    assert screw_at(one, v) == pytest.approx(one.centre, rel=1e-14)


@pytest.mark.parametrize("rows", [0, 2])
@pytest.mark.parametrize("away", [1e-2, 1.5, 100.0])
@pytest.mark.parametrize("seed", range(4))
def test_what_is_outside_is_drawn_towards_the_start_until_a_cone_is_met(
    seed, away, rows
):
    """Along the part of the way that the rows leave, and no farther."""
    rng = np.random.default_rng(seed)
    one = body(rng, rows, share=0.9)
    v = one.start + away * rng.normal(size=6)
    free = np.eye(6) - one.rows.T @ one.rows
    whole, found = free @ (v - one.start), within(one, v)
    share = (found - one.start) @ whole / (whole @ whole)
    assert found == pytest.approx(one.start + share * whole, abs=1e-13)
    if cone_sizes(one.start + whole).max() <= 1:
        assert share == pytest.approx(1.0, rel=1e-12)
    else:
        assert cone_sizes(found).max() == pytest.approx(1.0, abs=1e-12)
        assert 0 < share < 1


@pytest.mark.parametrize("to", [1.05, -1.05, 1.3, -1.3])
@pytest.mark.parametrize("at", [0.5, -0.5, 0.0])
def test_an_interval_ends_at_one_on_either_side(at, to):
    one = ConvexBody(
        np.zeros(6), np.zeros((6, 1)), np.zeros((0, 1)), np.array([at]), np.arange(2)
    )
    assert within(one, np.array([to]))[0] == pytest.approx(np.sign(to), rel=1e-12)


def test_what_is_within_stays(rng):
    one = body(rng, 0)
    v = 0.99 * np.array([0.6, 0.8, -1.0, 0.0, 0.6, -0.8])
    assert within(one, v) == pytest.approx(v, abs=1e-15)
    # against its start, across it and beyond the middle
    for sign in (1.0, -1.0):
        one = one._replace(start=sign * 0.9 * v)
        assert within(one, v) == pytest.approx(v, abs=1e-15)


def test_a_start_in_a_cones_corner_moves_nowhere_out_of_it():
    """At the bound and asked outwards: the start, not a step backwards."""
    start = np.array([0.6, 0.8 + 1e-13])
    one = ConvexBody(
        np.zeros(6), np.zeros((6, 2)), np.zeros((0, 2)), start, np.array([0, 2])
    )
    assert within(one, 3 * start) == pytest.approx(start, abs=1e-14)


def test_a_body_is_symmetric_where_its_rows_pass_through_the_middle(rng):
    one = body(rng, 2)
    assert not symmetric(one)
    assert not symmetric(one._replace(start=one.start * 1e-6))
    along = one.start - one.rows.T @ (one.rows @ one.start)
    assert symmetric(one._replace(start=along))
    assert symmetric(body(rng, 0))
    # each row counts, above the middle or below
    for sign in (1.0, -1.0):
        for row in one.rows:
            assert not symmetric(one._replace(start=along + sign * 0.1 * row))
