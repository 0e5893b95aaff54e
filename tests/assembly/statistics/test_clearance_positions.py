"""Play sampled uniformly and at contact, against known volumes and rejection."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import home_posture, place_robot
from assembly.model.error_distributions import draw_generator, tolerance_sources
from assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from assembly.robots import load_robot
from assembly.statistics.clearance_positions import (
    clearance_constraints,
    free_starts,
    loaded_clearances,
    position_clearances,
)
from assembly.statistics.linear_response import linear_response
from assembly.statistics.posture_margins import prepare_margins
from assembly.statistics.uniform_clearance import (
    diagnose,
    sample_uniform_position,
)
from tests.robots_for_tests import in_millimetres


def generators(count, seed=3):
    return [draw_generator(seed, draw, 9) for draw in range(count)]


def walked(rows, starts, count=1500, start=None):
    """Many points, by default from the middle; all must be mixed."""
    starts = np.array(starts)
    u = np.zeros((count, starts[-1])) if start is None else np.tile(start, (count, 1))
    rows = np.array(rows, dtype=float).reshape(-1, starts[-1])
    Z = np.ascontiguousarray(np.linalg.svd(rows)[2][len(rows) :].T)
    to_screw = np.zeros((6, starts[-1]))
    to_screw[:, : min(6, starts[-1])] = np.eye(6)[:, : starts[-1]]
    for v, rng in zip(u, generators(count), strict=True):
        assert sample_uniform_position(Z, starts, to_screw, v, rng)
    return u


def test_in_a_disc_the_squared_radius_is_uniform():
    u = walked([], [0, 2], start=[0.9, 0.0])
    assert stats.kstest((u**2).sum(axis=1), "uniform").pvalue > 1e-3
    assert stats.kstest(np.arctan2(*u.T) / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-3


@pytest.mark.slow
def test_in_a_box_every_side_is_uniform():
    u = walked([], [0, 1, 2, 3], start=[-0.99, 0.99, 0.0])
    for side in u.T:
        assert stats.kstest(side, stats.uniform(-1, 2).cdf).pvalue > 1e-3


@pytest.mark.slow
def test_a_cut_disc_agrees_with_rejection():
    """Row u0 = u2 / 2 with |u2| <= 1 leaves the strip |u0| <= 1/2 of the unit disc."""
    u = walked([[1, 0, -0.5]], [0, 2, 3])
    assert np.abs(u[:, 0] - u[:, 2] / 2).max() < 1e-12
    rng = np.random.default_rng(1)
    tried = rng.uniform(-1, 1, size=(60_000, 2))
    kept = tried[(np.hypot(*tried.T) <= 1) & (abs(tried[:, 0]) <= 0.5)]
    # the strip's area is 2 (1/2 sqrt(3)/2 + asin(1/2)) = 1.913 of the square's 4
    area = np.sqrt(3) / 2 + np.pi / 3
    assert len(kept) / len(tried) == pytest.approx(area / 4, abs=0.01)
    for own, other in zip(u.T, kept.T, strict=False):
        assert stats.ks_2samp(own, other).pvalue > 1e-3


@pytest.mark.slow
def test_a_simplex_like_section_of_a_cube_has_its_known_mean():
    """|u_i| <= 1 with u0 + u1 + u2 = 2.4: a triangle with centroid (0.8, 0.8, 0.8)."""
    u = walked([[1, 1, 1]], [0, 1, 2, 3], start=[0.9, 0.9, 0.6])
    np.testing.assert_allclose(u.sum(axis=1), 2.4, rtol=1e-12)
    # barycentric coordinates of a uniform point: mean 1/3, variance 1/18
    part = (1 - u) / 0.6
    for one in part.T:
        assert stats.kstest(one, stats.beta(1, 2).cdf).pvalue > 1e-3


@pytest.mark.parametrize(
    "thin", [pytest.param(t, marks=pytest.mark.slow) for t in (1e-1, 1e-3, 1e-5)]
)
def test_a_thin_cap_of_a_disc_beside_long_sides_keeps_its_marginals(thin):
    """Row u0 - thin u2 = 1 with |u2| <= 1 leaves the disc's cap 1 - thin <= u0; two
    sides stay free.  A walk with steps alike in all directions would take 1 / thin^2 of
    them.  The density of u0 is as the width of the cap, sqrt(1 - u0^2).
    """
    u = walked(
        [[1, 0, -thin, 0, 0]], [0, 2, 3, 4, 5], start=[1 - thin / 2, 0, -0.5, 0.9, -0.9]
    )
    for side in u[:, 3:].T:
        assert stats.kstest(side, stats.uniform(-1, 2).cdf).pvalue > 1e-3

    # area of the cap beyond height x: acos(x) - x sqrt(1 - x^2)
    def beyond(x):
        x = np.clip(x, -1, 1)
        return np.arccos(x) - x * np.sqrt(1 - x**2)

    low = 1 - thin
    assert u[:, 0].min() >= low * (1 - 1e-12)
    share = 1 - beyond(u[:, 0]) / beyond(low)
    assert stats.kstest(share, "uniform").pvalue > 1e-3


@pytest.mark.slow
def test_a_thin_segment_between_long_sides_is_uniform_along_all():
    """u0 + u1 = 2 - 1e-4 leaves a segment; five sides of 2 stay beside it."""
    rows = [[1, 1, 0, 0, 0, 0, 0]]
    u = walked(rows, [0, 1, 2, 3, 4, 5, 6, 7], start=[1 - 5e-5] * 2 + [0.99] * 5)
    assert stats.kstest((1 - u[:, 0]) / 1e-4, "uniform").pvalue > 1e-3
    for side in u[:, 2:].T:
        assert stats.kstest(side, stats.uniform(-1, 2).cdf).pvalue > 1e-3


def test_the_diagnosis_knows_independent_draws_and_a_slow_walk():
    """AR(1) of correlation r is worth (1 - r) / (1 + r) of its draws."""
    rng = np.random.default_rng(1)
    x = rng.normal(size=(4, 20_000))
    r_hat, effective = diagnose(x)
    assert r_hat == pytest.approx(1.0, abs=1e-3)
    assert effective == pytest.approx(x.size, rel=0.1)
    for t in range(1, x.shape[1]):
        x[:, t] = 0.9 * x[:, t - 1] + np.sqrt(1 - 0.81) * x[:, t]
    r_hat, effective = diagnose(x)
    assert effective == pytest.approx(x.size * 0.1 / 1.9, rel=0.15)
    # chains about 0 and 1: between them is as much as within, and more
    assert diagnose(x + np.array([[0.0], [1], [0], [1]]))[0] > 1.1


def test_a_walk_that_is_not_mixed_says_so():
    """No inside at all; and no walk of its own, where none may be made longer."""
    starts, rng = np.array([0, 1, 2]), generators(1)[0]
    along = np.array([[1.0], [1.0]]) / np.sqrt(2)
    corner, to_screw = np.array([1.0, -1.0]), np.eye(6)[:, :2].copy()
    assert not sample_uniform_position(along, starts, to_screw, corner, rng)
    np.testing.assert_array_equal(corner, [1.0, -1.0])
    middle = np.zeros(2)
    assert not sample_uniform_position(along, starts, to_screw, middle, rng, 0)
    assert sample_uniform_position(along, starts, to_screw, middle, rng)


def test_two_clearances_of_two_sizes_leave_the_platform_what_both_let_it():
    """Along z a pin of 2 mm on one side and of 1 mm on the other, errors 0.5 mm apart.

    The platform, on the first, moves from -2 to 2 mm, and on the second from 0.5 - 1 to
    0.5 + 1: what both let is -0.5 to 1.5, not even about the least clearances.
    """
    shift = [0.0, 0.0, 0.0, 0.0, 0.0, 5e-4]
    steel = MatrixLink(np.eye(6) * 1e6)
    frames = (
        Frame("one", link=steel, clearance=Clearance(axial=2e-3)),
        Frame(
            "two", link=steel, clearance=Clearance(axial=1e-3), geometric_error=shift
        ),
    )
    robot = Robot("two pins", "one", frames, (("one", "two"),))
    prepared = linear_response(home_posture(robot))
    draws = prepared.solve(np.repeat(robot.errors[None], 300, axis=0))
    assert draws.energy.max() == 0.0
    screws, mixed = position_clearances(prepared, draws, "uniform", generators(300))
    assert mixed.all()
    z = screws[:, 5] * 1e3
    assert stats.kstest((z + 0.5) / 2, "uniform").pvalue > 1e-3


@pytest.mark.parametrize(("kind", "first"), [("radial", 3), ("tilt", 0)])
def test_pushed_from_anywhere_a_pin_rests_anywhere_on_the_narrower_rim(kind, first):
    """Two pins on one axis, of 2 and 1 mm or mrad: the contacts are a circle of 1."""
    steel = MatrixLink(np.eye(6) * 1e6)
    frames = (
        Frame("one", link=steel, clearance=Clearance(**{kind: 2e-3})),
        Frame("two", link=steel, clearance=Clearance(**{kind: 1e-3})),
    )
    robot = Robot("two pins", "one", frames, (("one", "two"),))
    prepared = linear_response(home_posture(robot))
    draws = prepared.solve(np.zeros((300, 2, 6)))
    screws, mixed = position_clearances(prepared, draws, "contact", generators(300))
    assert mixed.all()
    x, y = screws[:, first], screws[:, first + 1]
    np.testing.assert_allclose(np.hypot(x, y), 1e-3, rtol=1e-6)
    angle = np.arctan2(y, x) / (2 * np.pi) + 0.5
    assert stats.kstest(angle, "uniform").pvalue > 1e-3
    # twice an angle: nor does it prefer an axis
    assert stats.kstest(angle * 2 % 1, "uniform").pvalue > 1e-3
    assert stats.kstest(angle * 4 % 1, "uniform").pvalue > 1e-3


def near_the_edge(margin):
    """The paper's robot with errors of which play takes up all but a little."""
    robot = load_robot("irsbot2")
    posture = place_robot(robot, pose={"tx": 0.1, "tz": -0.5})
    rng = np.random.default_rng(1)
    touched = np.array([f.link is not None for f in robot.frames])
    errors = rng.normal(size=(len(robot.frames), 6)) * ([5e-3] * 3 + [2e-4] * 3)
    errors *= touched[:, None]
    errors *= margin / prepare_margins(posture, "rigid").solve(errors[None]).margin[0]
    return linear_response(posture), errors


@pytest.mark.parametrize("margin", [0.9, pytest.param(0.99, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_near_the_edge_of_a_zone_longer_walks_change_no_distribution(margin):
    """All mixed; and four mixed walks in a row end nowhere else."""
    one, errors = near_the_edge(margin)
    found = one.solve(np.repeat(errors[None], 200, axis=0))
    some, mixed = position_clearances(one, found, "uniform", generators(200, 3))
    assert mixed.all()
    more = [settle_longer(one, found, rng) for rng in generators(200, 4)]
    for a, b in zip(some.T, np.array(more).T, strict=True):
        assert stats.ks_2samp(a, b).pvalue > 1e-3


def settle_longer(one, found, rng):
    """Platform screw after four mixed walks, one from where the other ended."""
    free = ~loaded_clearances(one, found)[0]
    rows = clearance_constraints(one, ~free)[:, free]
    Z = np.ascontiguousarray(np.linalg.svd(rows)[2][len(rows) :].T)
    to_screw = np.ascontiguousarray(one.screws[:, : len(free)][:, free])
    u = found.clearances[0][free].copy()
    for _ in range(4):
        sample_uniform_position(Z, free_starts(one, free), to_screw, u, rng)
    return found.platform_screw[0] + to_screw @ (u - found.clearances[0][free])


DRAWN = 200


@pytest.fixture(scope="module")
def drawn():
    robot = load_robot("irsbot2")
    sources = tolerance_sources(robot, [1e-3] * 3 + [1e-4] * 3)
    one = linear_response(place_robot(robot))
    errors = sources.errors(sources.draw(0, DRAWN, seed=2))
    return one, one.solve(errors)


@pytest.mark.parametrize("play", ["uniform", "contact"])
def test_play_changes_neither_energy_nor_bounds(drawn, play):
    """Screws moved by clearances that leave every spring as it was."""
    one, found = drawn
    loaded = loaded_clearances(one, found)
    assert not loaded[found.energy < 1e-20].any()
    assert loaded[found.energy > 1e-8].any()
    settled, mixed = position_clearances(one, found, play, generators(DRAWN))
    assert mixed.all()
    assert np.isfinite(settled).all()
    assert np.abs(settled - found.platform_screw).max() > 1e-5


@pytest.mark.slow
def test_contact_goes_at_least_as_far_along_its_push_as_uniform_play(drawn):
    one, found = drawn
    push = np.array([rng.normal(size=6) for rng in generators(DRAWN)])
    size = size_of(one.posture.robot)
    push[:, 3:] /= size
    at_contact, anywhere = (
        position_clearances(one, found, play, generators(DRAWN))[0]
        for play in ("contact", "uniform")
    )
    reach = (push * at_contact).sum(axis=1) - (push * anywhere).sum(axis=1)
    assert reach.min() > -1e-9


def test_the_least_clearances_are_those_of_the_solution(drawn):
    one, found = drawn
    screws, mixed = position_clearances(one, found, "least", [])
    np.testing.assert_array_equal(screws, found.platform_screw)
    assert mixed.shape == (DRAWN,)
    assert mixed.all()


@pytest.mark.parametrize("play", ["most", "worst"])
def test_an_unknown_way_is_refused(drawn, play):
    """The worst is no one place, but many."""
    one, found = drawn
    with pytest.raises(ValueError, match=f"clearance is '{play}'") as error:
        position_clearances(one, found, play, generators(DRAWN))
    assert str(error.value).endswith("expected one of ('uniform', 'contact', 'least')")


def test_draws_that_alternate_are_worth_no_more_than_the_cap(rng):
    """Stan's: of n draws, n log10 n at most, however they cancel; here all but none."""
    alternating = np.tile([1.0, -1.0], (4, 32)) + 1e-3 * rng.normal(size=(4, 64))
    r_hat, effective = diagnose(alternating)
    assert r_hat < 1.0
    assert effective == pytest.approx(256 * np.log10(256))


def test_slow_chains_are_worth_as_much_as_their_correlation_says(rng):
    """AR(1) of coefficient a: n (1 - a) / (1 + a) independent draws."""
    a, x = 0.8, np.zeros((4, 20_000))
    noise = rng.normal(size=x.shape)
    for t in range(1, x.shape[1]):
        x[:, t] = a * x[:, t - 1] + noise[:, t]
    r_hat, effective = diagnose(x)
    assert 1.0 <= r_hat < 1.01 or r_hat == pytest.approx(1.0, abs=1e-3)
    assert effective == pytest.approx(x.size * (1 - a) / (1 + a), rel=0.15)


def test_contact_play_knows_no_unit_of_length():
    """The same random pushes in metres and in millimetres: the same positions."""
    robot = load_robot("3rrr")
    frames = (replace(f, link=None, joint_stiffness=None) for f in robot.frames)
    robot, screws = replace(robot, frames=tuple(frames)), []
    for one in (robot, in_millimetres(robot)):
        prepared = linear_response(home_posture(one))
        found = prepared.solve(np.zeros((5, len(one.frames), 6)))
        moved, _ = position_clearances(prepared, found, "contact", generators(5))
        screws.append(moved)
    here, there = screws
    assert np.abs(here).max(axis=1).min() > 1e-6
    assert there[:, :3] == pytest.approx(here[:, :3], rel=1e-6, abs=1e-12)
    assert there[:, 3:] == pytest.approx(1e3 * here[:, 3:], rel=1e-6, abs=1e-9)
