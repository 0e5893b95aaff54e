"""The search for a body's farthest screw: each step by hand, and bodies known."""

from itertools import pairwise, product

import numpy as np
import pytest

from assembly.solvers.farthest import (
    DONE,
    GAVE_UP,
    NEEDED,
    _add_plane,
    _first_direction,
    _improve,
    _learn_opposite,
    _set_side,
    _start_boxing,
    advance,
    begin,
    begin_search,
    choose,
    learn,
    search_on,
)
from assembly.solvers.majorant import majorant_bound
from assembly.solvers.polytope import empty_polytope, farthest_corner
from assembly.solvers.support import ConvexBody, screw_at, support

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
NONE = np.zeros(0)
CLIMBING, BOXING, CUTTING = range(3)


def body_of(rng, starts, rows=0, symmetric=False, size=1.0):
    nv = starts[-1]
    H = np.linalg.qr(rng.normal(size=(nv, rows)))[0].T.copy()
    start = 0.3 * rng.uniform(-1, 1, nv)
    start -= symmetric * H.T @ (H @ start)
    return ConvexBody(
        size * rng.normal(size=6), size * rng.normal(size=(6, nv)), H, start,
        np.array(starts),
    )  # fmt: skip


def lengths(body, w):
    return np.array([np.linalg.norm(w[a:b]) for a, b in pairwise(body.starts)])


def search_of(body, half=0, tolerance=1e-3):
    return begin(body, half, tolerance, empty_polytope())


@pytest.mark.parametrize("half", [0, 3])
def test_a_body_of_one_point_is_its_centre(half):
    centre = np.array([1.0, 2.0, 2.0, 2.0, 3.0, 6.0])
    one = ConvexBody(
        centre, np.zeros((6, 0)), np.zeros((0, 0)), NONE, np.zeros(1, np.int64)
    )
    search = begin_search(one, half, 1e-3)
    assert search.bounds.tolist() == [[3.0, 7.0][half // 3]] * 2
    assert search_on(one, search, 0.0, NONE, NONE) == DONE
    assert np.array_equal(search.best, centre)


@pytest.mark.parametrize("half", [0, 3])
@pytest.mark.parametrize("off", [0.0, 0.3, 30.0])
@pytest.mark.parametrize("rows", [0, 2])
def test_the_first_direction_reaches_farthest_of_axes_and_centre(rng, half, off, rows):
    """|middle| + sum of the cones' own reach, without their part along the rows."""
    for _ in range(4):
        body = body_of(rng, [0, 2, 3, 6, 8], rows)
        body = body._replace(centre=off * body.centre)
        free = body.map[half : half + 3] @ (np.eye(8) - body.rows.T @ body.rows)
        centre = body.centre[half : half + 3]
        candidates = [*np.linalg.eigh(free @ free.T)[1].T]
        if off:
            candidates.append(centre / np.linalg.norm(centre))
        middles = [d @ (centre - free @ body.start) for d in candidates]
        reaches = [lengths(body, free.T @ d).sum() for d in candidates]
        best = int(np.argmax(np.abs(middles) + reaches))
        search = search_of(body, half)
        assert search.bounds[0] == pytest.approx(np.linalg.norm(centre), rel=1e-14)
        assert search.bounds[1] == np.inf
        assert np.isnan(search.heights).all()
        search.direction[:] = 0.0
        _first_direction(body, search)
        wanted = np.sign(middles[best]) * candidates[best]
        np.testing.assert_allclose(search.direction, wanted, atol=1e-7)


def test_a_body_about_nothing_is_searched_along_its_longest_axis():
    X = np.zeros((6, 3))
    X[:3] = np.diag([1.0, 3.0, 2.0])
    body = ConvexBody(
        np.zeros(6), X, np.zeros((0, 3)), np.zeros(3), np.array([0, 1, 2, 3])
    )
    assert np.array_equal(search_of(body).direction, [0.0, 1.0, 0.0])


@pytest.mark.parametrize("least", range(3))
def test_a_box_has_the_last_direction_and_what_is_known_of_its_sides(rng, least):
    """Right-handed; the second axis is that of the least component, made normal."""
    own = np.array([0.6, -0.7, 0.5])
    own[least] = -0.1
    own /= np.linalg.norm(own)
    search = search_of(body_of(rng, [0, 3]))
    search.direction[:] = own
    search.counts[2] = 3
    search.cuts[:3] = [[*own, 2.0], [*-own, -0.5], [0.0, 0.0, 1.0, 9.0]]
    _start_boxing(search)
    second = np.eye(3)[least] - own[least] * own
    second /= np.linalg.norm(second)
    wanted = [own, second, np.cross(own, second)]
    np.testing.assert_allclose(search.axes, wanted, atol=1e-15)
    assert search.counts[0] == BOXING
    nan = np.nan
    np.testing.assert_array_equal(search.heights, [[0.5, nan, nan], [2.0, nan, nan]])


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [0, 1])
def test_a_plane_along_an_axis_is_its_side_and_no_other(rng, axis, side):
    search = search_of(body_of(rng, [0, 3]))
    search.axes[:] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    sign = 2 * side - 1
    _set_side(search, sign * search.axes[axis], 0.7)
    wanted = np.full((2, 3), np.nan)
    wanted[side, axis] = sign * 0.7
    np.testing.assert_array_equal(search.heights, wanted)
    for differs in range(3):
        beside = search.axes[axis].copy()
        beside[differs] += 1e-9
        _set_side(search, beside, 0.1)
        _set_side(search, -beside, 0.1)
    np.testing.assert_array_equal(search.heights, wanted)


def test_planes_are_kept_for_the_box_while_there_is_room(rng):
    search = search_of(body_of(rng, [0, 3]))
    for i in range(34):
        _add_plane(search, np.full(3, float(i)), i + 0.5)
    assert search.counts[2] == 32
    np.testing.assert_array_equal(search.cuts, np.arange(32)[:, None] + [0, 0, 0, 0.5])


@pytest.mark.parametrize("half", [0, 3])
def test_only_a_farther_screw_is_kept_and_only_a_gain_that_counts_goes_on(rng, half):
    """A thousandth of the tolerance."""
    search = search_of(body_of(rng, [0, 3]), half, tolerance=1e-3)
    search.bounds[0] = 2.0
    before = search.best.copy()
    for size, improved, kept in (
        (1.9, 0, False), (2.0 + 0.9e-6, 0, True), (2.0 + 2.1e-6, 1, True),
    ):  # fmt: skip
        screw = rng.normal(size=6)
        own = screw[half : half + 3]
        own *= size / np.linalg.norm(own)
        search.counts[3] = 0
        _improve(search, screw)
        assert search.counts[3] == improved
        assert np.array_equal(search.best, screw if kept else before)
        assert search.bounds[0] == pytest.approx(max(size, 2.0), rel=1e-15)


@pytest.mark.parametrize("half", [0, 3])
def test_a_support_bounds_from_both_sides_and_is_counted(rng, half):
    body = body_of(rng, [0, 2, 4, 5], 1)
    search = search_of(body, half)
    own = slice(half, half + 3)
    height, v, gradient, _ = support(body, half, search.direction, 1e-9)
    screw = screw_at(body, v)
    search.counts[3] = 1
    low = search.bounds[0]
    learn(body, search, height, screw, gradient)
    size = np.linalg.norm(screw[own])
    assert search.counts.tolist() == [CLIMBING, 1, 1, int(size > low)]
    assert search.bounds[0] == pytest.approx(max(low, size), rel=1e-14)
    bound = majorant_bound(
        body.centre[own], body.map[own], body.rows, body.start, body.starts, gradient
    )
    assert search.bounds[1] == bound
    np.testing.assert_array_equal(search.cuts[0], [*search.direction, height])
    # a screw that is no farther, with a bound that is looser: both bounds stay
    low = search.bounds[0]
    learn(body, search, height, np.zeros(6), 3 * gradient)
    assert search.bounds.tolist() == [low, bound]
    assert search.counts.tolist() == [CLIMBING, 2, 2, 0]
    # rounding may not cross them
    learn(body, search, height, 1e3 * screw, gradient)
    assert search.bounds[1] == search.bounds[0] > bound


@pytest.mark.parametrize("half", [0, 3])
@pytest.mark.parametrize("rows", [0, 2])
def test_of_a_symmetric_body_one_support_is_two(rng, half, rows):
    """The opposite plane is the support of the opposite direction."""
    body = body_of(rng, [0, 2, 3, 6, 8], rows, symmetric=True)
    search = search_of(body, half)
    d = search.direction.copy()
    _, v, gradient, _ = support(body, half, d, 1e-9)
    search.bounds[0] = 0.0
    _learn_opposite(body, search, v, gradient)
    height, other, _, _ = support(body, half, -d, 1e-9)
    np.testing.assert_array_equal(search.cuts[0, :3], -d)
    assert search.cuts[0, 3] == pytest.approx(height, abs=2e-9)
    screw = screw_at(body, other)
    np.testing.assert_allclose(search.best, screw, atol=1e-3)
    size = np.linalg.norm(search.best[half : half + 3])
    assert search.bounds[0] == pytest.approx(size, rel=1e-14)
    assert search.counts[1] == 0
    # where rounding has the point above its proof, the plane is at the point
    _learn_opposite(body, search, v, 0.0 * gradient)
    reached = -d @ search.best[half : half + 3]
    assert search.cuts[1, 3] == max(reached, -d @ body.centre[half : half + 3])


@pytest.mark.parametrize("half", [0, 3])
def test_the_stages_climb_then_box_then_cut(rng, half):
    search = search_of(body_of(rng, [0, 3]), half)
    best = search.best[half : half + 3]
    best[:] = 0.0, 3.0, 4.0
    search.counts[1], search.counts[3] = 7, 1
    choose(search)  # it gained: on, towards the point
    np.testing.assert_allclose(search.direction, [0.0, 0.6, 0.8], rtol=1e-15)
    assert search.counts[0] == CLIMBING
    search.counts[1] = 8  # often enough
    _add_plane(search, np.array([1.0, 0.0, 0.0]), 0.5)
    _add_plane(search, search.direction, 6.0)
    choose(search)
    assert search.counts[0] == BOXING
    axes = search.axes.copy()
    np.testing.assert_allclose(axes, [[0, 0.6, 0.8], [1, 0, 0], [0, 0.8, -0.6]])
    # sides not known yet, low before high; the two planes were sides
    sides = [(0, 0, -4.0), (1, 0, -3.0), (2, 0, -1.0), (2, 1, 2.0)]
    for axis, side, at in sides:
        sign = 2 * side - 1
        np.testing.assert_allclose(search.direction, sign * axes[axis], atol=1e-15)
        assert search.counts[0] == BOXING
        _add_plane(search, search.direction, sign * at)
        search.counts[3] = 0
        choose(search)
    assert search.counts[0] == CUTTING
    assert search.heights.tolist() == [[-4.0, -3.0, -1.0], [6.0, 0.5, 2.0]]
    # the corner farthest of the box, which the kept planes have not changed
    corner = np.array([6.0, -3.0, 2.0]) @ axes
    assert search.bounds[1] == pytest.approx(7.0, rel=1e-14)
    np.testing.assert_allclose(search.direction, corner / 7.0, atol=1e-14)
    np.testing.assert_allclose(farthest_corner(search.outer), corner, atol=1e-13)
    # a cut at 5 along it; where that gained, next the point's own direction
    _add_plane(search, search.direction, 5.0)
    search.counts[3] = 1
    choose(search)
    np.testing.assert_allclose(search.direction, [0.0, 0.6, 0.8], rtol=1e-15)
    assert 5.0 < search.bounds[1] < 7.0
    # never below the lower bound
    search.bounds[0] = 20.0
    choose(search)
    assert search.bounds[1] == 20.0


def test_a_plane_kept_before_the_box_cuts_it(rng):
    search = search_of(body_of(rng, [0, 3]))
    oblique = np.ones(3) / np.sqrt(3)
    _add_plane(search, oblique, 1.0)
    search.counts[0] = BOXING
    search.axes[:], search.heights[0], search.heights[1] = np.eye(3), -0.5, 3.0
    choose(search)
    assert search.outer.used[1] == 7
    corners = search.outer.corners[: search.outer.used[0]]
    assert (corners @ oblique <= 1 + 1e-12).all()
    # (1.., -0.5, -0.5) on the plane
    farthest = np.array([np.sqrt(3) + 1.0, -0.5, -0.5])
    assert search.bounds[1] == pytest.approx(np.linalg.norm(farthest), rel=1e-12)


def searched(body, half, tolerance):
    search = search_of(body, half, tolerance)
    assert advance(body, search) == DONE
    assert search.bounds[1] - search.bounds[0] <= tolerance
    size = np.linalg.norm(search.best[half : half + 3])
    assert size == pytest.approx(search.bounds[0], rel=1e-13)
    return search


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("half", [0, 3])
def test_of_intervals_the_farthest_is_one_of_all_corners(seed, half):
    rng = np.random.default_rng(seed)
    body = body_of(rng, list(range(7)))
    corners = np.array(list(product([-1.0, 1.0], repeat=6)))
    own = body.map[half : half + 3]
    points = body.centre[half : half + 3] + (corners - body.start) @ own.T
    farthest = np.linalg.norm(points, axis=1).max()
    search = searched(body, half, 0.01 * farthest)
    assert search.bounds[0] <= farthest * (1 + 1e-13)
    assert search.bounds[1] >= farthest * (1 - 1e-13)
    assert search.bounds[0] == pytest.approx(farthest, rel=1e-12)  # it is a corner
    assert search.counts[1] < 40


def test_of_an_ellipse_two_supports_tell_all():
    """|x|, |y|, |z| <= 1, 3, 2 in a ball, with v_y = v_z: sqrt((9 + 4) / 2)."""
    X = np.zeros((6, 3))
    X[3:] = np.diag([1.0, 3.0, 2.0])
    H = np.array([[0.0, 1.0, -1.0]]) / np.sqrt(2)
    body = ConvexBody(np.zeros(6), X, H, np.zeros(3), np.array([0, 3]))
    search = searched(body, 3, 1e-6)
    assert search.bounds[0] == pytest.approx(np.sqrt(6.5), abs=1e-6)
    assert search.counts[1] <= 2


def test_a_search_ends_where_it_may_or_says_what_it_needs(rng):
    body = body_of(rng, [0, 2, 3], 1)
    search = search_of(body)
    search.counts[1] = 400
    assert advance(body, search) == GAVE_UP
    search.bounds[1] = search.bounds[0] + 0.9e-3
    assert advance(body, search) == DONE
    assert search.counts[1] == 400
    # rows that are no numbers: the support proves nothing
    unknown = body._replace(rows=np.full((1, 3), np.nan))
    search = search_of(body)
    assert advance(unknown, search) == NEEDED
    assert search.counts[1] == 0
    # it takes what it is given, which was the first of several supports, and goes on
    body = body_of(rng, list(range(7)))
    search = search_of(body)
    d = search.direction.copy()
    height, v, gradient, _ = support(body, 0, d, 1e-9)
    given = height + 0.5, screw_at(body, v), gradient
    assert search_on(body, search, *given) == DONE
    np.testing.assert_array_equal(search.cuts[0], [*d, height + 0.5])
    assert search.counts[1] > 2
