"""Fits against generalised least squares, and what they try on their way."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.effects import apply_effects
from assembly.effects.effect import Unknown
from assembly.kinematics.posture import home_posture
from assembly.measurement.predict import predict
from assembly.model.robot import Clearance
from tests.bar_for_tests import (
    BEAM,
    LENGTH,
    LONGER,
    SOFTER,
    TURNED,
    along,
    bar,
    fit_of,
    hypothesis,
)
from tests.linkages_for_tests import five_bar
from tests.planar_arm_for_tests import SIGMA
from validation.diagnosis import refit as module
from validation.diagnosis.background import background
from validation.diagnosis.evidence import Prior, sizes_of
from validation.diagnosis.hypotheses import Hypothesis, Slot
from validation.diagnosis.refit import (
    Fit,
    adds_clearance,
    in_full,
    refit,
    resting,
    with_clearance_held,
)
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import conditions_of
from validation.diagnosis.small_terms import GEOMETRY, small_terms

LOST = 1e3  # [sigma] a reading that the model has no answer for
BOTH = Hypothesis(
    "encoder_eccentricity", ("drive",),
    tuple(
        Slot((f"drive.{part}",), Unknown(part, 1e-4), 0.0)
        for part in ("sine", "cosine")
    ),
)  # fmt: skip
FINITE = Hypothesis("geometric_stiffening", (), ())


def turned_by(campaign, angle):
    """(R, 6) readings of a drive that turns by small angles (R,) more."""
    turn = np.asarray(angle)[:, None] * [0, 0, 1.0]
    return np.hstack([turn, np.cross(turn, LENGTH * along(campaign))])


def columns_of(campaign):
    """(N, 4) over sigma, of a longer bar, an offset and both parts of eccentricity."""
    q = campaign.coordinates[:, 0]
    each = [fit_of(campaign, 1.0)]
    each += [turned_by(campaign, angle) for angle in (0 * q + 1, np.sin(q), np.cos(q))]
    return np.stack([one / SIGMA for one in each], axis=-1)[campaign.cells]


def noisy(rng, missing=0.0):
    """A bar of beams, longer, turned and eccentric by tens of sigmas; what it should
    be found to be."""
    plain = bar(link=BEAM)
    x = np.array([2e-4, 1e-4, 3e-4, -1e-4])
    seen = rng.normal(size=(8, 6)) + (columns_of(plain) @ x).reshape(8, 6)
    seen[rng.random((8, 6)) < missing] = np.nan
    return bar(link=BEAM, measured=seen * SIGMA)


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_values_and_covariance_are_those_of_generalised_least_squares(
    behind, missing, rng
):
    """(A' V^-1 A)^-1 and A' V^-1 z, V = 1 and the covariance of small unknowns."""
    campaign = noisy(rng, missing)
    conditions = conditions_of(campaign)
    z = (campaign.measured / SIGMA)[campaign.cells]
    V, small = np.eye(len(z)), {}
    if behind:
        terms = small_terms(campaign, conditions, responses(conditions))
        terms = [t.take(t.axis == 1) for t in terms if t.name == GEOMETRY]
        scales = {GEOMETRY: (3e-5, 1e-4)}
        J = terms[0].columns * sizes_of(terms[0], scales[GEOMETRY])
        V = V + J @ J.T
        used = (np.ones(len(terms[0]), bool),)
        small = {"behind": background(terms, Prior(used, scales, 0.0, 0.0))}
    members = [LONGER, TURNED, BOTH]
    fit = refit(campaign, conditions, members, np.zeros(4), **small)
    A = columns_of(campaign)
    C = np.linalg.inv(A.T @ np.linalg.solve(V, A))
    x = C @ A.T @ np.linalg.solve(V, z)
    # exact but for second order in 1e-4 rad
    assert fit.values == pytest.approx(x, abs=1e-3 * np.sqrt(C.diagonal()).max())
    size = np.sqrt(C.diagonal())
    np.testing.assert_allclose(fit.covariance / np.outer(size, size),
                               C / np.outer(size, size), atol=1e-3)  # fmt: skip
    if not behind:
        assert np.abs(fit.slopes - A).max() < 1e-3 * np.abs(A).max()
    left = z - A @ x
    assert fit.rss == pytest.approx(left @ np.linalg.solve(V, left), rel=1e-3)
    slopes = fit.slopes.T @ fit.slopes * np.outer(size, size)
    np.testing.assert_allclose(
        slopes, np.linalg.inv(C) * np.outer(size, size), rtol=0.01, atol=1e-5
    )


def test_what_finite_motions_add_is_taken_out_of_the_readings(rng):
    """A defect (N,) that is known: as if so much less had been read."""
    campaign, defect = noisy(rng), rng.normal(size=48)
    conditions, members = conditions_of(campaign), [LONGER, TURNED]
    found = module._refit(campaign, conditions, members, np.zeros(2), defect)
    less = campaign.measured - (defect.reshape(8, 6) * SIGMA)
    other = refit(replace(campaign, measured=less), conditions, members, np.zeros(2))
    assert found.values == pytest.approx(other.values, rel=1e-6)
    np.testing.assert_allclose(found.residual, other.residual, atol=1e-6)


@pytest.mark.parametrize("values", [[3e-4, -1e-4], [0.0, 2e-4], [-2e-4, 0.0]])
def test_deviations_of_amplitude_and_phase_are_those_of_their_parts(values):
    """a da = s ds + c dc, a^2 dp = s dc - c ds; of the right hypothesis of three."""
    s, c = values
    root = 1e-6 * np.array([[2.0, 0.5], [-0.3, 1.0]])
    covariance = np.diag([1e-8, 4e-10, 1.0, 1.0, 9e-12])
    covariance[2:4, 2:4] = root @ root.T
    members = (LONGER, TURNED, BOTH, SOFTER)
    at = np.array([1e-3, 2e-4, *values, 1e-6])
    fit = Fit(members, at, covariance, np.zeros(1), conditions_of(bar()),
              np.zeros((1, 5)))  # fmt: skip
    told = {name: (value, std) for name, value, std in fit.parameters(2)}
    a = np.hypot(s, c)
    assert told["drive.amplitude"][0] == pytest.approx(a)
    assert told["drive.phase"][0] == pytest.approx(np.arctan2(c, s))
    along_a, along_p = np.array([s, c]) / a @ root, np.array([-c, s]) / a**2 @ root
    assert told["drive.amplitude"][1] == pytest.approx(
        np.linalg.norm(along_a), rel=1e-6
    )
    assert told["drive.phase"][1] == pytest.approx(np.linalg.norm(along_p), rel=1e-6)
    assert fit.parameters(0) == [("tip", pytest.approx(1e-3), pytest.approx(1e-4))]
    assert fit.parameters(1) == [("drive", pytest.approx(2e-4), pytest.approx(2e-5))]
    ((_, stiffness, std),) = fit.parameters(3)
    assert (stiffness, std) == (pytest.approx(1e6), pytest.approx(3e6, rel=1e-6))


def test_parameters_of_one_effect_join():
    """Two lengths by two hypotheses; another effect between them."""
    other = hypothesis("link_length", "drive", "drive", Unknown("", 1e-4))
    fit = Fit((LONGER, TURNED, other), np.array([1.0, 2.0, 3.0]), np.eye(3),
              np.zeros(1), conditions_of(bar()), np.zeros((1, 3)))  # fmt: skip
    assert fit.effects == {
        "link_length": {"tip": 1.0, "drive": 3.0}, "encoder_offset": {"drive": 2.0},
    }  # fmt: skip


@pytest.mark.parametrize("members", [[LONGER], [LONGER, FINITE]])
def test_a_row_that_the_model_has_no_answer_for_has_no_say(members, rng, monkeypatch):
    """Its six readings are a thousand sigma off; values are those of the others."""
    campaign, rows = noisy(rng), np.arange(8) != 3
    conditions = conditions_of(campaign)
    some = campaign.take(rows), conditions.take(rows)
    other = refit(*some, members, np.zeros(1))

    def broken(at):
        model = predict(at)
        return replace(
            model, deviation=np.where(rows[:, None], model.deviation, np.nan)
        )

    monkeypatch.setattr(module, "predict", broken)
    fit = refit(campaign, conditions, members, np.zeros(1))
    assert fit.values == pytest.approx(other.values, rel=1e-6)
    assert fit.hypotheses == tuple(members)
    for found in (fit, in_full(campaign, conditions, fit)):
        left = found.residual.reshape(8, 6)
        assert left[3].tolist() == [LOST] * 6
        if members == [LONGER] or found is fit:
            np.testing.assert_allclose(left[rows].ravel(), other.residual, atol=1e-4)


@pytest.mark.parametrize("seen", [5e-4, -5e-4])
@pytest.mark.parametrize("lower", [0.0, -1e-4])
@pytest.mark.parametrize("start", [-1e-4, 0.0, 1e-4, 1.0])
def test_no_value_is_tried_beyond_its_bounds(seen, lower, start, monkeypatch):
    """Half a millimetre more or less than allowed; it ends there, from anywhere."""
    upper = 1e-4
    one = hypothesis("link_length", "tip", "tip", Unknown("", 1e-4, lower, upper))
    campaign = bar(link=BEAM, measured=fit_of(bar(), seen))
    tried, apply = [], module.apply_effects

    def watched(conditions, effects):
        tried.append(effects["link_length"]["tip"])
        return apply(conditions, effects)

    monkeypatch.setattr(module, "apply_effects", watched)
    fit = refit(campaign, conditions_of(campaign), [one], np.array([start]))
    assert lower * (1 + 1e-12) <= min(tried) <= max(tried) <= upper * (1 + 1e-12)
    assert fit.values == pytest.approx([upper if seen > 0 else lower], abs=1e-13)
    # slopes are those at the bound nevertheless
    assert fit.parameters(0)[0][2] == pytest.approx(SIGMA[3] / np.sqrt(8), rel=1e-5)


def test_an_angle_far_from_straight_is_found_whatever_else_is_read():
    """0.4 rad by finite motions: rotations tell it at once, positions by and by."""
    q, e = bar().coordinates[:, 0], 0.4
    seen = np.zeros((8, 6))
    seen[:, 2] = e
    seen[:, 3] = LENGTH * (np.cos(q + e) - np.cos(q))
    seen[:, 4] = LENGTH * (np.sin(q + e) - np.sin(q))
    campaign = bar(measured=seen)
    here = replace(conditions_of(campaign), exact=True)
    fit = refit(campaign, here, [TURNED], np.zeros(1))
    assert fit.values == pytest.approx([e], rel=1e-6)


@pytest.mark.parametrize("kept", [0.0, 3e-4])
def test_what_the_readings_do_not_see_stays_where_it_was(kept, rng):
    """Rotations alone are read: they say nothing of a length, all of an offset."""
    seen = turned_by(bar(), np.full(8, 2e-4))
    seen[:, 3:] = np.nan
    campaign = bar(link=BEAM, measured=seen)
    fit = refit(
        campaign, conditions_of(campaign), [LONGER, TURNED], np.array([kept, 1e-4])
    )
    assert fit.values == pytest.approx([kept, 2e-4], rel=1e-9, abs=1e-18)
    assert fit.covariance[0].tolist() == [0.0, 0.0]
    assert fit.covariance[1, 1] == pytest.approx(SIGMA[2] ** 2 / 8, rel=1e-6)


# clearances

PLAY = hypothesis(
    "joint_clearance", "right.elbow", "right.elbow.radial",
    Unknown("radial", 2e-5, 0.0, 1e-2),
)  # fmt: skip


def pushed(force):
    """A five-bar of beams under a force on its tip; what a diagnosis is told of it."""
    robot = five_bar()
    frames = tuple(
        replace(f, link=BEAM if np.any(f.translation[:2]) else None)
        for f in robot.frames
    )
    robot = replace(robot, frames=frames)
    at = home_posture(robot)
    campaign = replace(
        bar([0, 0, 0, *force], rows=1), robot=robot,
        coordinates=at.coordinates[None], transforms=at.transforms[None],
    )  # fmt: skip
    return campaign, conditions_of(campaign)


def test_a_set_adds_clearance_where_chains_close_and_none_rests():
    _, conditions = pushed([0, 1.0, 0])
    assert adds_clearance(conditions, [TURNED, PLAY])
    assert not adds_clearance(conditions, [TURNED])
    assert not adds_clearance(conditions, [])
    at_rest = replace(conditions, rest=np.zeros_like(conditions.errors))
    assert not adds_clearance(at_rest, [PLAY])
    one = hypothesis("joint_clearance", "drive", "drive.radial", Unknown("", 2e-5))
    assert not adds_clearance(conditions_of(bar()), [one])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_play_rests_along_the_bar_that_pushes_it(sign):
    """A bar between two pins carries a force along itself, and no other."""
    campaign, conditions = pushed([0, sign * 20.0, 0])
    x = np.array([4e-5])
    rest = resting(conditions, [PLAY], x)
    assert rest.shape == (1, len(campaign.robot.frames), 6)
    elbow = campaign.robot.index("right.elbow")
    T = conditions.transforms[0]
    bar_along = T[campaign.robot.index("right.pin"), :3, 3] - T[elbow, :3, 3]
    out = T[elbow, :3, :3] @ rest[0, elbow, 3:]
    assert np.cross(out, bar_along) == pytest.approx(np.zeros(3), abs=1e-4)
    assert np.linalg.norm(rest[0, elbow]) == pytest.approx(1.0, abs=1e-6)
    assert not rest[0, elbow, :3].any()
    assert not np.delete(rest[0], elbow, axis=0).any()
    opposite = resting(pushed([0, -sign * 20.0, 0])[1], [PLAY], x)
    assert opposite == pytest.approx(-rest, abs=1e-4)


def test_clearance_held_where_it_rests_reads_as_it_does_in_full():
    """And what adds none, or has it held, is left as it is."""
    campaign, conditions = pushed([5.0, 20.0, 0])
    fit = Fit((PLAY,), np.array([4e-5]), np.eye(1), np.zeros(6), conditions,
              np.zeros((6, 1)))  # fmt: skip
    held = with_clearance_held(conditions, fit)
    assert held.rest is not None
    assert with_clearance_held(held, fit) is held
    assert with_clearance_held(conditions, replace(fit, hypotheses=())) is conditions
    full = in_full(campaign, conditions, fit)
    there = predict(apply_effects(held, fit.effects)).deviation
    assert there[0] == pytest.approx(-full.residual * SIGMA, abs=1e-9)
    tight = predict(conditions).deviation
    assert np.abs(there - tight)[0, 3:5].max() > 1e-5
    assert full.values is fit.values


def test_only_an_open_chains_play_is_put_where_loads_take_it():
    """Of a bar whose drive has play: a radius along the force on its tip."""
    plain = bar([0, 0, 0, 3.0, 4.0, 0], rows=2)
    play = replace(plain.robot.frames[0], clearance=Clearance(radial=1e-5))
    loose = replace(plain.robot, frames=(play, plain.robot.frames[1]))
    conditions = conditions_of(replace(plain, robot=loose))
    found = module._with_clearance_at_rest(conditions)
    expected = np.zeros((2, 2, 6))
    expected[:, 0, 3:5] = 0.6e-5, 0.8e-5
    assert found.errors == pytest.approx(expected, abs=1e-15)
    _, closed = pushed([0, 20.0, 0])
    for same in (
        conditions_of(plain), closed, apply_effects(closed, {"joint_clearance": {
            "right.elbow.radial": 1e-5}}),
        replace(conditions, rest=np.zeros_like(conditions.errors)),
    ):  # fmt: skip
        assert module._with_clearance_at_rest(same) is same
