"""Positions within joint clearances for all clearance models."""

import numpy as np
import pytest
from scipy import stats

from forcefit import Clearance, Frame, MatrixLink, Robot, load_robot
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.model.error_distributions import (
    draw_generator,
    tolerance_sources,
)
from forcefit.assembly.solvers.uniform_clearance import sample_uniform_position
from forcefit.assembly.statistics.clearance_positions import (
    loaded_clearances,
    position_clearances,
)
from forcefit.assembly.statistics.contact_positions import move_to_contact
from forcefit.assembly.statistics.linear_response import linear_response
from tests.tolerances_for_tests import ARM, arm


def generators(count, seed=3):
    return [draw_generator(seed, draw, 9) for draw in range(count)]


def walked(rows, starts, count=1500, start=None):
    """Return uniform samples of a set of clearance positions."""
    starts = np.array(starts)
    u = np.zeros((count, starts[-1])) if start is None else np.tile(start, (count, 1))
    rows = np.array(rows, dtype=float).reshape(-1, starts[-1])
    Z = np.ascontiguousarray(np.linalg.svd(rows)[2][len(rows) :].T)
    to_screw = np.zeros((6, starts[-1]))
    to_screw[:, : min(6, starts[-1])] = np.eye(6)[:, : starts[-1]]
    for v, rng in zip(u, generators(count), strict=True):
        assert sample_uniform_position(Z, starts, to_screw, v, rng)
    return u


def test_uniform_model_in_a_disc_has_uniform_squared_radius():
    u = walked([], [0, 2], start=[0.9, 0.0])
    assert stats.kstest((u**2).sum(axis=1), "uniform").pvalue > 1e-3
    assert stats.kstest(np.arctan2(*u.T) / (2 * np.pi) + 0.5, "uniform").pvalue > 1e-3


@pytest.mark.slow
def test_uniform_model_in_a_strip_agrees_with_rejection_sampling():
    """The equation u0 = u2 / 2 restricts the unit disc to the strip |u0| <= 1/2."""
    u = walked([[1, 0, -0.5]], [0, 2, 3])
    assert np.abs(u[:, 0] - u[:, 2] / 2).max() < 1e-12
    rng = np.random.default_rng(1)
    tried = rng.uniform(-1, 1, size=(60_000, 2))
    kept = tried[(np.hypot(*tried.T) <= 1) & (abs(tried[:, 0]) <= 0.5)]
    # The area of the strip is sqrt(3)/2 + pi/3 = 1.913, and that of the square is 4.
    area = np.sqrt(3) / 2 + np.pi / 3
    assert len(kept) / len(tried) == pytest.approx(area / 4, abs=0.01)
    for own, other in zip(u.T, kept.T, strict=False):
        assert stats.ks_2samp(own, other).pvalue > 1e-3


@pytest.mark.parametrize(
    "thin", [pytest.param(t, marks=pytest.mark.slow) for t in (1e-1, 1e-3, 1e-5)]
)
def test_random_walk_mixes_near_the_zone_boundary(thin):
    """The equation u0 - thin u2 = 1 with |u2| <= 1 restricts the unit disc to the cap
    u0 >= 1 - thin. The density of u0 is proportional to sqrt(1 - u0^2), the width of
    the cap. A random walk with isotropic steps would need about 1 / thin^2 steps.
    """
    u = walked(
        [[1, 0, -thin, 0, 0]], [0, 2, 3, 4, 5], start=[1 - thin / 2, 0, -0.5, 0.9, -0.9]
    )
    for side in u[:, 3:].T:
        assert stats.kstest(side, stats.uniform(-1, 2).cdf).pvalue > 1e-3

    # The area of the cap with u0 >= x is acos(x) - x sqrt(1 - x^2).
    def beyond(x):
        x = np.clip(x, -1, 1)
        return np.arccos(x) - x * np.sqrt(1 - x**2)

    low = 1 - thin
    assert u[:, 0].min() >= low * (1 - 1e-12)
    share = 1 - beyond(u[:, 0]) / beyond(low)
    assert stats.kstest(share, "uniform").pvalue > 1e-3


def test_random_walk_that_does_not_mix_is_reported():
    """Either the set has no interior, or the walk is too short."""
    starts, rng = np.array([0, 1, 2]), generators(1)[0]
    along = np.array([[1.0], [1.0]]) / np.sqrt(2)
    corner, to_screw = np.array([1.0, -1.0]), np.eye(6)[:, :2].copy()
    assert not sample_uniform_position(along, starts, to_screw, corner, rng)
    np.testing.assert_array_equal(corner, [1.0, -1.0])
    middle = np.zeros(2)
    assert not sample_uniform_position(along, starts, to_screw, middle, rng, 0)
    assert sample_uniform_position(along, starts, to_screw, middle, rng)


@pytest.mark.parametrize(("kind", "first"), [("radial", 3), ("tilt", 0)])
def test_contact_positions_are_uniform_on_the_smaller_circle(kind, first):
    """Of two coaxial pins with clearances of 2 and 1 mm (or mrad), the second is in
    contact, so the positions are on a circle of radius 1.
    """
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
    # Multiples of the angle are also uniform, so no axis is preferred.
    assert stats.kstest(angle * 2 % 1, "uniform").pvalue > 1e-3
    assert stats.kstest(angle * 4 % 1, "uniform").pvalue > 1e-3


DRAWN = 200


@pytest.fixture(scope="module")
def drawn():
    robot = load_robot("irsbot2")
    sources = tolerance_sources(robot, [1e-3] * 3 + [1e-4] * 3)
    one = linear_response(place_robot(robot))
    errors = sources.errors(sources.draw(0, DRAWN, seed=2))
    return one, one.solve(errors)


@pytest.mark.parametrize("play", ["uniform", "contact"])
def test_clearance_models_move_the_platform_of_irsbot2(drawn, play):
    """Joints transmit forces only in draws with elastic energy."""
    one, found = drawn
    loaded = loaded_clearances(one, found)
    assert not loaded[found.energy < 1e-20].any()
    assert loaded[found.energy > 1e-8].any()
    settled, mixed = position_clearances(one, found, play, generators(DRAWN))
    assert mixed.all()
    assert np.isfinite(settled).all()
    assert np.abs(settled - found.platform_screw).max() > 1e-5


@pytest.mark.slow
def test_contact_position_is_farthest_along_its_wrench(drawn):
    one, found = drawn
    push = np.array([rng.normal(size=6) for rng in generators(DRAWN)])
    size = size_of(one.posture.robot)
    push[:, 3:] /= size
    at_contact, anywhere = (
        position_clearances(one, found, model, generators(DRAWN))[0]
        for model in ("contact", "uniform")
    )
    reach = (push * at_contact).sum(axis=1) - (push * anywhere).sum(axis=1)
    assert reach.min() > -1e-9


@pytest.mark.parametrize("play", ["most", "worst"])
def test_unknown_clearance_model_is_rejected(drawn, play):
    """The model "worst" is rejected because it does not define a single position."""
    one, found = drawn
    with pytest.raises(ValueError, match=f"clearance is '{play}'") as error:
        position_clearances(one, found, play, generators(DRAWN))
    assert str(error.value).endswith("expected one of ('uniform', 'contact', 'least')")


def moved(directions, starts, rows=(), free=None, positions=None):
    """Return the farthest positions in the given directions."""
    directions, starts = np.array(directions, dtype=float), np.array(starts)
    nu = starts[-1]
    free = np.ones(nu, dtype=bool) if free is None else np.array(free)
    positions = np.zeros(directions.shape) if positions is None else positions
    rows = np.array(rows, dtype=float).reshape(-1, nu)
    return move_to_contact(rows, starts, free, np.array(positions), directions)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_farthest_positions_in_discs_and_intervals_equal_closed_forms(size, rng):
    """The maximum of d.u is at d / |d| on a disc and at sign(d) on an interval."""
    directions = rng.normal(size=(6, 3)) + 0.1
    expected = np.column_stack([
        directions[:, :2] / np.linalg.norm(directions[:, :2], axis=1)[:, None],
        np.sign(directions[:, 2]),
    ])
    found = moved(size * directions, [0, 2, 3])
    np.testing.assert_allclose(found, expected, atol=1e-4)


@pytest.mark.parametrize("length", [0.05, 0.4, 5.0])
def test_contact_length_is_the_ratio_of_moments_to_forces(length):
    """A pin along z with tilt clearance t has an arm of length L along x.

    The moments M_x and M_y - L F_z at the pin have standard deviations 1 and s = sqrt(1
    + (L / length)^2). The tilt is parallel to the moment, so the median displacement of
    the platform along z is L t s / sqrt(1 + s^2).
    """
    tilt = 2e-3
    prepared = linear_response(home_posture(arm(tilt=tilt)))
    draws = prepared.solve(np.zeros((4000, 2, 6)))
    rngs = [draw_generator(3, i, 9) for i in range(4000)]
    screws, _ = position_clearances(prepared, draws, "contact", rngs, length)
    s = np.hypot(1.0, ARM / length)
    expected = ARM * tilt * s / np.hypot(1.0, s)
    assert np.median(np.abs(screws[:, 5])) == pytest.approx(expected, rel=0.03)
