"""Registration, tangents and refit, on a bar whose answers are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.stats import binom

from assembly.kinematics.posture import place_robot
from assembly.measurement.predict import predict
from assembly.model.robot import Frame, Robot
from forcefit.inputs.table import BadInput
from tests.bar_for_tests import (
    BEAM,
    LENGTH,
    LONGER,
    SOFTER,
    TURNED,
    WARMER,
    along,
    bar,
    fit_of,
    gives_way,
)
from tests.planar_arm_for_tests import SIGMA
from validation.diagnosis.diagnose import diagnose
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.refit import refit
from validation.diagnosis.registration import coarse_frame, register
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import Tangents, conditions_of, whiten
from validation.diagnosis.small_terms import SPRINGS, SmallTerm, with_small

# registration


@pytest.mark.parametrize("turn", [[0.6, -0.5, 0.62], [0.0, 3.0, 0.0]])
@pytest.mark.parametrize("cells", ["all", "points", "one rotation"])
def test_a_device_anywhere_in_the_room_is_found_exactly(turn, cells):
    """p' = R p + t and R' = R, noise-free: 1 rad and 3 m, by points or by rotations."""
    campaign = bar()
    R, t = Rotation.from_rotvec(turn), np.array([2.0, -2.0, 1.0])
    p = LENGTH * along(campaign)
    seen = np.hstack([np.tile(turn, (8, 1)), R.apply(p) + t - p])
    if cells == "points":
        seen[:, :3] = np.nan
    if cells == "one rotation":
        seen[1:, :3] = np.nan
    campaign = bar(measured=seen)
    # without errors of the model a first guess is right already
    guess = coarse_frame(campaign, conditions_of(campaign))
    assert list(guess.values()) == pytest.approx([*turn, *t], abs=1e-8)
    found = register(campaign, conditions_of(campaign))
    assert found.base[:3] == pytest.approx(turn, abs=1e-9)
    assert found.base[3:] == pytest.approx(t, abs=1e-9)


def test_a_device_that_cannot_be_located_is_said():
    """Two positions, and no rotation."""
    seen = np.zeros((2, 6))
    seen[:, :3] = np.nan
    campaign = bar(measured=seen, rows=2)
    with pytest.raises(BadInput, match="registration is unknown, and there are no"):
        register(campaign, conditions_of(campaign))


def test_points_on_a_line_anywhere_do_not_say_how_a_device_is_turned():
    """Five places of a slide half a metre beside the base, no rotation read."""
    robot = Robot("slide", "tip", (
        Frame("rail", translation=[0.3, 0.5, -0.2], rotation=[0.4, 0.2, 0]),
        Frame("slide", "rail", joint="prismatic", actuated=True),
        Frame("tip", "slide", [0.1, 0, 0]),
    ))  # fmt: skip
    placed = [place_robot(robot, joints={"slide": 0.1 * k}) for k in range(5)]
    seen = np.zeros((5, 6))
    seen[:, :3] = np.nan
    campaign = replace(
        bar(rows=5, measured=seen), robot=robot,
        coordinates=np.stack([p.coordinates for p in placed]),
        transforms=np.stack([p.transforms for p in placed]),
    )  # fmt: skip
    with pytest.raises(BadInput, match="measured points off one line"):
        register(campaign, conditions_of(campaign))


def test_a_device_is_found_beside_errors_that_the_model_knows():
    """The declared tip is 4 mm off: that is the machine's, and not the device's."""
    plain = bar()
    errors = np.zeros((2, 6))
    errors[1] = [0, 0, 0, 1e-3, 4e-3, -2e-3]
    robot = plain.robot.with_errors(errors)
    turn, t = np.array([0.3, -0.2, 0.5]), np.array([1.0, 0.5, -2.0])
    R = Rotation.from_rotvec(turn)
    q = plain.coordinates[:, 0]
    off = Rotation.from_rotvec(np.outer(q, [0, 0, 1])).apply(errors[1, 3:])
    p = LENGTH * along(plain)
    seen = np.hstack([np.full((8, 3), np.nan), R.apply(p + off) + t - p])
    campaign = replace(bar(measured=seen), robot=robot)
    guess = coarse_frame(campaign, conditions_of(campaign))
    assert list(guess.values()) == pytest.approx([*turn, *t], abs=1e-8)


def test_each_session_has_a_device_of_its_own():
    """Two places in the room, two sessions; rows without any are all of one."""
    plain, sessions = bar(), np.array(["a", "b"] * 4)
    p, seen = LENGTH * along(plain), np.zeros((8, 6))
    seen[:, :3] = np.nan
    where = {"a": ([0.1, 0.2, -0.3], [1.0, 2.0, 0.5]), "b": ([0, 0, 1.0], [-1.0, 0, 0])}
    for k, name in enumerate(sessions):
        turn, t = where[name]
        seen[k, 3:] = Rotation.from_rotvec(turn).apply(p[k]) + t - p[k]
    campaign = replace(bar(measured=seen), session=sessions)
    found = register(campaign, conditions_of(campaign))
    left = campaign.measured - predict(found).deviation
    assert np.abs(left[:, 3:]).max() < 1e-9
    unknown = replace(campaign, session=np.array(["a"] * 8))
    with pytest.raises(BadInput, match='session "b" has no row'):
        register(unknown, conditions_of(campaign))


# tangents


@pytest.mark.parametrize("x", [0.0, 3e-4, -2e-3])
def test_a_length_has_the_same_tangent_about_any_value(x):
    """1 / sigma along the bar, and nothing at zero; another length beside it too."""
    campaign = bar(link=BEAM)
    tangents = Tangents(campaign, conditions_of(campaign))
    expected = whiten(campaign, fit_of(campaign, 1.0))
    beside = {"encoder_offset": {"drive": 1e-9}}
    for found in (
        tangents.at_start(LONGER),
        tangents.about(LONGER, np.array([x]), {}),
        tangents.about(LONGER, np.array([x]), beside),
    ):
        assert found.columns[:, 0] == pytest.approx(expected, abs=1e-6 * expected.max())
        assert found.offset == pytest.approx(np.zeros(len(expected)), abs=1e-6)


def test_a_tangent_about_an_upper_bound_is_taken_below_it():
    """Of an expansion: the bar's length times 5 K, and never more than allowed."""
    heat = {"temperature": np.full(8, 5.0)}
    campaign = bar(link=BEAM, **heat)
    tangents = Tangents(campaign, conditions_of(campaign))
    model, tried = tangents.model, []

    def watched(effects):
        tried.append(effects["thermal_expansion"]["tip"])
        return model(effects)

    tangents.model = watched
    most = WARMER.slots[0].unknown.upper
    found = tangents.about(WARMER, np.array([most]), {})
    assert max(tried) == most
    expected = 5.0 * whiten(campaign, fit_of(campaign, LENGTH))
    assert found.columns[:, 0] == pytest.approx(expected, rel=1e-6, abs=1e-3)


def test_wrenches_are_as_small_as_their_loads():
    """Zero is what is rounding beside the largest, and not beside 1 N."""
    load = np.array([0, 0, 3.0, 0, 5.0, 0])
    one = responses(conditions_of(bar(load, link=BEAM)))
    tiny = responses(conditions_of(bar(1e-12 * load, link=BEAM)))
    assert np.abs(one.wrenches).max() > 1.0
    assert 1e12 * tiny.wrenches == pytest.approx(one.wrenches, rel=1e-9, abs=1e-9)
    assert tiny.screws == pytest.approx(one.screws)


# refit


@pytest.mark.parametrize("start", [0.0, 1e-19, -1e-3])
def test_a_length_is_the_mean_of_the_readings_along_the_bar(start):
    """And its standard deviation sigma / sqrt(R): rotations have no say."""
    plain = bar(link=BEAM)
    noise = np.random.default_rng(4).normal(size=(8, 6)) * SIGMA
    seen = noise + np.hstack([np.zeros((8, 3)), 3e-4 * along(plain)])
    campaign = bar(link=BEAM, measured=seen)
    fit = refit(campaign, conditions_of(campaign), [LONGER], np.array([start]))
    ((name, value, std),) = fit.parameters(0)
    assert name == "tip"
    mean = np.einsum("ri,ri->r", seen[:, 3:], along(plain)).mean()
    assert value == pytest.approx(mean, rel=1e-7)
    assert std == pytest.approx(SIGMA[3] / np.sqrt(8), rel=1e-6)
    assert fit.rss == pytest.approx(
        np.sum(((seen - fit_of(campaign, value)) / SIGMA) ** 2)
    )


def test_uncertainty_of_a_stiffness_follows_from_that_of_its_compliance():
    """Turn M/k and arc M L/k in every row; std k = k^2 std(1/k)."""
    M, k = 30.0, 2e5
    campaign = gives_way(M, k)
    fit = refit(campaign, conditions_of(campaign), [SOFTER], np.array([1e-6]))
    ((name, value, std),) = fit.parameters(0)
    assert name == "drive"
    assert value == pytest.approx(k, rel=1e-4)  # arcs are chords to first order
    J = 8 * ((M / SIGMA[2]) ** 2 + (M * LENGTH / SIGMA[3]) ** 2)
    assert std == pytest.approx(k**2 / np.sqrt(J), rel=1e-3)


def test_a_standard_deviation_is_that_of_the_slopes_where_the_fit_ends():
    """Only x is read: L (cos(q + e) - cos q), of slope -L sin(q + e), e = 0.4 rad."""
    e, plain = 0.4, bar()
    q = plain.coordinates[:, 0]
    seen = np.full((8, 6), np.nan)
    seen[:, 3] = LENGTH * (np.cos(q + e) - np.cos(q))
    campaign = bar(measured=seen)
    here = replace(conditions_of(campaign), exact=True)
    fit = refit(campaign, here, [TURNED], np.zeros(1))
    ((_, value, std),) = fit.parameters(0)
    assert value == pytest.approx(e, rel=1e-6)
    slope = LENGTH * np.sin(q + e) / SIGMA[3]
    assert np.abs(fit.slopes[:, 0]) == pytest.approx(np.abs(slope), rel=1e-3)
    assert std == pytest.approx(1 / np.linalg.norm(slope), rel=1e-3)


@pytest.mark.parametrize(
    ("earlier", "end"), [(None, 0.4), (-0.39, -0.4), (-1.2, 0.4), (0.41, 0.4)]
)
def test_a_fit_goes_on_from_an_earlier_one_if_that_leaves_less(earlier, end):
    """Of a bar along x only x is read, L cos e: it may be turned either way."""
    seen = np.full((1, 6), np.nan)
    seen[0, 3] = LENGTH * (np.cos(0.4) - 1)
    campaign = bar(measured=seen, rows=1)
    here = replace(conditions_of(campaign), exact=True)
    begun = None if earlier is None else np.array([earlier])
    fit = refit(campaign, here, [TURNED], np.array([0.1]), earlier=begun)
    assert fit.values == pytest.approx([end], rel=1e-5)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """One standard deviation in 68 %, of 60 campaigns."""
    rng = np.random.default_rng(8)
    inside = 0
    shape = fit_of(bar(link=BEAM), 2e-5)
    here = conditions_of(bar(link=BEAM))
    for _ in range(60):
        campaign = bar(link=BEAM, measured=shape + rng.normal(size=(8, 6)) * SIGMA)
        ((_, value, std),) = refit(campaign, here, [LONGER], np.zeros(1)).parameters(0)
        inside += abs(value - 2e-5) < std
    assert 1e-3 < binom.cdf(inside, 60, 0.6827) < 1 - 1e-3


def test_a_drive_that_turns_against_its_load_is_rigid():
    """The compliance stays at its bound."""
    M = 30.0
    seen = np.tile([0, 0, -M / 1e5, 0, 0, 0], (8, 1))
    campaign = bar([0, 0, M, 0, 0, 0], seen)
    fit = refit(campaign, conditions_of(campaign), [SOFTER], np.array([1e-6]))
    assert fit.values == pytest.approx([0.0], abs=1e-9)
    assert fit.effects == {"drive_compliance": {}}
    assert fit.parameters(0) == []


def test_an_offset_beside_finite_motions_is_exact():
    """The drive turns by a where K (a - e) = F L cos(q + a), far from straight."""
    K, F, e = 2e3, 150.0, 4e-3
    spring = np.diag([np.inf, np.inf, K, np.inf, np.inf, np.inf])
    plain = bar([0, 0, 0, 0, F, 0], spring=spring)
    q = plain.coordinates[:, 0]
    turn = np.array([
        brentq(lambda a, b=b: K * (a - e) - F * LENGTH * np.cos(b + a), -1, 1)
        for b in q
    ])
    seen = np.zeros((8, 6))
    seen[:, 2] = turn
    seen[:, 3] = LENGTH * (np.cos(q + turn) - np.cos(q))
    seen[:, 4] = LENGTH * (np.sin(q + turn) - np.sin(q))
    campaign = bar([0, 0, 0, 0, F, 0], seen, spring=spring)
    here = conditions_of(campaign)
    finite = Hypothesis("geometric_stiffening", (), ())
    fit = refit(campaign, here, [TURNED, finite], np.zeros(1))
    assert fit.values == pytest.approx([e], rel=1e-4)
    assert np.abs(fit.residual).max() < 0.5  # sigma
    assert fit.conditions.exact
    linear = refit(campaign, here, [TURNED], np.zeros(1))
    assert abs(linear.values[0] - e) > 1e-4


# finite motions on request


def test_what_finite_motions_explain_needs_no_effect_once_they_are_declared():
    """K a = F L cos(q + a): a quarter turn of the load's arm is no first order."""
    K, F, rows = 2e3, 150.0, 20
    spring = np.diag([np.inf, np.inf, K, np.inf, np.inf, np.inf])
    plain = bar([0, 0, 0, 0, F, 0], rows=rows, spring=spring)
    q = plain.coordinates[:, 0]
    turn = np.array([
        brentq(lambda a, b=b: K * a - F * LENGTH * np.cos(b + a), -1, 1) for b in q
    ])
    seen = np.random.default_rng(5).normal(size=(rows, 6)) * SIGMA
    seen[:, 2] += turn
    seen[:, 3] += LENGTH * (np.cos(q + turn) - np.cos(q))
    seen[:, 4] += LENGTH * (np.sin(q + turn) - np.sin(q))
    campaign = bar([0, 0, 0, 0, F, 0], seen, rows=rows, spring=spring)
    linear, finite = diagnose(campaign), diagnose(campaign, finite=True)
    assert (linear.verdict, linear.claimed) == ("explained", ("geometric_stiffening",))
    assert finite.verdict == "none_needed"
    assert finite.before.normalised == pytest.approx(1.0, abs=0.4)
    assert linear.before.normalised > 10


def test_springs_of_passive_joints_leave_their_own_motion_free():
    """1e-7 m/N in series with a bearing that is rigid but for its turning."""
    hinge = Frame("hinge", "base", joint="revolute")
    robot = Robot("a", "tip", (hinge, Frame("tip", "hinge")))
    springs = SmallTerm(
        SPRINGS, np.zeros(2, int), np.array([2, 4]), np.zeros((1, 2)),
        np.full(2, np.nan), 0.0,
    )  # fmt: skip
    K = with_small(robot, [springs], [np.array([1e-3, 1e-7])]).frame("hinge")
    stiffness = np.diag(K.joint_stiffness)
    assert stiffness.tolist() == pytest.approx([np.inf, np.inf, 0, np.inf, 1e7, np.inf])
