"""What is judged of the fit of the best set, on a bar at some angles."""

from dataclasses import replace
from math import log
from types import SimpleNamespace

import numpy as np
import pytest

from tests.bar_for_tests import bar
from tests.planar_arm_for_tests import SIGMA
from validation.diagnosis import judge as module
from validation.diagnosis.background import NOTHING
from validation.diagnosis.holdout import Split
from validation.diagnosis.judge import Settled, judge
from validation.diagnosis.kept_aside import Errors, Rung
from validation.diagnosis.lack_of_fit import LackOfFit
from validation.diagnosis.noise_in_time import NoiseInTime
from validation.diagnosis.refit import refit
from validation.diagnosis.scoring import FINITE, Scored
from validation.diagnosis.selection import Selection
from validation.diagnosis.signatures import conditions_of

ROWS, ASIDE = 60, 20
USED = np.arange(ROWS) < ROWS - ASIDE
FACTOR = 2.0  # by which sigma was made larger
CERTAIN = (((0,), 0.98), ((), 0.02))
NONE = (((), 0.95), ((0,), 0.05))
OPEN = (((0,), 0.5), ((1,), 0.5))


def settled(weights, *, temperature=0.0, size=1.0, second=0.0, **changes):
    """Two effects with weights of their sets; the last rows are kept aside.

    What errors of the declared frames do to second order is known, three sigma; the
    readings have ``second`` of it.
    """
    rng = np.random.default_rng(2)
    seen = (second + size * rng.normal(size=(ROWS, 6))) * SIGMA
    heat = np.zeros(ROWS)
    heat[-1] = temperature
    campaign = bar(measured=seen, rows=ROWS, spread=1.0, temperature=heat)
    campaign = replace(campaign, sigma=FACTOR * campaign.sigma)
    declared = conditions_of(campaign)
    conditions = replace(declared, second_order=np.tile(3 * SIGMA, (ROWS, 1)))
    screen = SimpleNamespace(
        effects=["a", "b"], fit=lambda members: SimpleNamespace(rss=0.0)
    )
    sets = [
        Scored(own, np.zeros(0), 0.0, 7 - k, log(w))
        for k, (own, w) in enumerate(weights)
    ]
    fit = refit(campaign.take(USED), conditions.take(USED), [], np.zeros(0))
    selection = Selection(
        screen=screen, sets=sets, fit=fit, rivals=(), unknowns=1,
        tangents=SimpleNamespace(residual=np.full(6 * int(USED.sum()), 0.25)),
        behind=NOTHING, terms=(), columns=np.zeros((0, 0)), ended={},
    )  # fmt: skip
    return Settled(**{
        "campaign": campaign, "unregistered": declared, "conditions": conditions,
        "split": Split(USED, "some"), "outliers": np.zeros(ROWS, bool),
        "noise_factor": np.ones(6), "inflation": FACTOR, "selection": selection,
        "learned": (), "finite": False,
    } | changes)  # fmt: skip


@pytest.fixture
def asked(monkeypatch):
    """What judging asks of others, by name; what is left is noise unless told."""
    told = SimpleNamespace(remarks=(), probability=0.5, rank=None, calls=[])

    def lack(rows, left, unknowns):
        told.calls.append(("lack", left, unknowns))
        return LackOfFit(1.0, 9, told.probability, np.nan, 0, 1.0)

    def steps(campaign, declared, model, terms, rows, rank, residual):
        told.rank = rank
        return [Rung("declared", 0, Errors(1.0, 1.0, 3.0))]

    monkeypatch.setattr(module, "lack_of_fit", lack)
    monkeypatch.setattr(module, "ladder", steps)
    monkeypatch.setattr(module, "implausible", lambda *given: told.remarks)
    monkeypatch.setattr(module, "trends", lambda *given: ["a trend"])
    monkeypatch.setattr(module, "next_measurement", lambda *given: given)
    return told


def rms(values, rows):
    return np.sqrt(np.mean(values[rows] ** 2))


def test_errors_are_those_of_the_rows_kept_aside_in_sigmas_as_stated(asked):
    """Before: of the linear model; after: with what finite errors add."""
    one = settled(CERTAIN)
    found = judge(one)
    seen = one.campaign.measured
    left = seen - 3 * SIGMA
    assert (found.verdict, found.claimed) == ("explained", ("a",))
    assert found.residual_before == pytest.approx(seen, rel=1e-4, abs=1e-9)
    assert found.residual_after == pytest.approx(left, rel=1e-4, abs=1e-9)
    assert found.before.normalised == pytest.approx(rms(seen / SIGMA, ~USED), rel=1e-3)
    assert found.after.normalised == pytest.approx(rms(left / SIGMA, ~USED), rel=1e-3)
    assert found.after.position == pytest.approx(rms(left[:, 3:], ~USED), rel=1e-3)
    assert found.noise.normalised == pytest.approx(1.0)
    np.testing.assert_allclose(found.campaign.sigma, np.tile(SIGMA, (ROWS, 1)))
    assert (asked.rank, found.best) == (7, one.selection.sets[0])
    assert found.ladder[0].error == Errors(1.0, 1.0, FACTOR * 3.0)
    assert (found.next, found.trends, found.remarks) == (None, (), ())
    # of the best set's unknowns one, of the declared model none
    (_, _, fitted), (_, declared, none) = asked.calls
    assert (fitted, none) == (1, 0)
    assert declared == pytest.approx(FACTOR * 0.25)


def test_finite_motions_are_in_the_declared_model_where_they_are_asked_for(asked):
    one = settled(CERTAIN, finite=True)
    left = one.campaign.measured - 3 * SIGMA
    assert judge(one).residual_before == pytest.approx(left, rel=1e-4, abs=1e-9)


def test_where_nothing_is_needed_nothing_is_better_after(asked):
    found = judge(settled(NONE, size=0.1, finite=True))
    assert found.verdict == "none_needed"
    assert found.after == found.before
    found = judge(settled(NONE, size=0.1, second=3.0))
    assert (found.verdict, found.claimed) == ("explained", (FINITE,))
    assert found.best_by_score == (FINITE,)
    assert found.after != found.before
    assert found.fit.conditions.exact


def test_a_next_measurement_is_asked_for_where_two_are_open(asked):
    one = settled(OPEN)
    found = judge(one)
    assert found.verdict == "ambiguous"
    assert found.next[2] is one.selection.fit
    finite = settled(OPEN, finite=True)
    exact = replace(
        finite.selection.fit, conditions=replace(finite.conditions, exact=True)
    )
    finite = replace(finite, selection=replace(finite.selection, fit=exact))
    assert not judge(finite).next[2].conditions.exact


def test_trends_are_looked_for_where_more_than_noise_is_left(asked):
    asked.probability = 1e-9
    found = judge(settled(CERTAIN))
    assert (found.verdict, found.claimed) == ("outside_library", ())
    assert found.trends == ("a trend",)


@pytest.mark.parametrize(
    ("weights", "said"),
    [(CERTAIN, "outside_library"), (OPEN, "ambiguous"), (NONE, "none_needed")],
)
def test_what_no_machine_has_is_not_claimed(asked, weights, said):
    """What claims nothing is let be."""
    asked.remarks = ("soft as rubber",)
    found = judge(settled(weights, size=0.1, finite=True))
    assert (found.verdict, found.claimed) == (said, ())
    assert found.remarks == ("soft as rubber",)


def test_a_reading_that_no_sensor_gives_is_remarked(asked):
    asked.remarks = ("odd",)
    found = judge(settled(CERTAIN, temperature=900.0))
    assert found.remarks[0] == "odd"
    assert found.remarks[1].endswith(f"left out: m{ROWS - 1}")


@pytest.mark.parametrize(("before", "named"), [(0, 3), (1, 2), (2, 1), (3, 0), (5, 0)])
def test_one_row_in_twenty_may_be_a_blunder_in_all(before, named):
    """Three of sixty, those among the rows fitted counted first."""
    outliers = np.arange(ROWS) < before
    one = settled(CERTAIN, outliers=outliers)
    residual = np.zeros((ROWS, 6))
    residual[ROWS - 4 :] = 1e3 * SIGMA * np.arange(1.0, 5.0)[:, None]
    found = module._outlying_held_out(one, residual)
    assert np.flatnonzero(found).tolist() == list(range(ROWS - named, ROWS))


def test_all_rows_used_judge_where_none_is_kept_aside():
    outliers = np.arange(ROWS) == 3
    one = settled(CERTAIN, outliers=outliers)
    assert one.used.tolist() == (USED & ~outliers).tolist()
    assert one.held_out.tolist() == (~USED).tolist()
    every = replace(one, split=Split(np.ones(ROWS, bool), "none"))
    assert every.held_out.tolist() == (~outliers).tolist()


def test_errors_without_outliers_leave_out_those_found_among_rows_kept_aside(asked):
    one = settled(CERTAIN)
    seen = one.campaign.measured.copy()
    seen[-1] += 1e4 * SIGMA
    one = replace(one, campaign=replace(one.campaign, measured=seen))
    found = judge(one)
    assert np.flatnonzero(found.outliers).tolist() == [ROWS - 1]
    assert found.before.normalised > 1e3
    rest = ~USED & ~found.outliers
    expected = rms(seen / SIGMA, rest), rms((seen - 3 * SIGMA) / SIGMA, rest)
    assert [e.normalised for e in found.trimmed] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("shown", [0.5, 30.0])
def test_second_order_that_explains_speaks_for_finite_motions(shown):
    """By exp of half the squares it takes away, to one of two effects."""
    one = settled(NONE)
    before = one.campaign.measured * 0.0
    before[0, 0] = FACTOR * SIGMA[0] * np.sqrt(shown + one.selection.fit.rss)
    ranking = module._ranked(one, before)
    odds = np.exp(shown / 2) / 2
    expected = {(): 0.95 / (1 + odds), (FINITE,): 0.95 * odds / (1 + odds)}
    sets = dict(ranking.sets)
    for names, p in expected.items():
        assert sets.get(names, 0.0) == pytest.approx(p if p >= 0.02 else 0.0, rel=1e-6)
    assert ranking.best == ((FINITE,) if shown > 1 else ())


@pytest.mark.parametrize("why", ["finite", "members", "behind", "none"])
def test_finite_motions_are_weighed_where_nothing_else_is_found(monkeypatch, why):
    asked = []

    def weigh(sets, probability, gain):
        asked.append(gain)
        return sets, probability

    monkeypatch.setattr(module, "linear_or_finite", weigh)
    one = settled(CERTAIN if why == "members" else NONE, finite=why == "finite")
    if why == "behind":
        one = replace(one, selection=replace(one.selection, behind="springs"))
    module._ranked(one, one.campaign.measured)
    assert bool(asked) == (why == "none")


def test_noise_in_time_widens_what_was_fitted(monkeypatch):
    """Nothing to widen where nothing was fitted, or noise is white."""
    noise, one = NoiseInTime(0.5, 60.0, 1e-9), settled(CERTAIN)
    selection = one.selection
    monkeypatch.setattr(module, "noise_in_time", lambda *given: noise)
    monkeypatch.setattr(module, "widened", lambda C, *given: 4 * C)
    assert module._with_noise_in_time(one, selection) == (selection, noise)
    fitted = replace(selection.fit, values=np.ones(1), covariance=np.eye(1))
    fitted = replace(selection, fit=fitted)
    wide, told = module._with_noise_in_time(one, fitted)
    assert told is noise
    assert wide.fit.covariance == pytest.approx(4 * np.eye(1))
    monkeypatch.setattr(module, "noise_in_time", lambda *given: None)
    assert module._with_noise_in_time(one, fitted) == (fitted, None)


@pytest.mark.parametrize("probability", [0.5, 1e-9])
def test_what_was_learned_makes_the_best_set_certain(asked, probability):
    asked.probability = probability
    one = settled(OPEN)
    ranking = module._ranked(one, one.campaign.measured)
    lack = module._lack_of_fit(one, one.selection)
    open_, said, claimed = module._decided(one, ranking, lack)
    noise = probability == 0.5
    assert (open_.sets, claimed) == (ranking.sets, ())
    assert said == ("ambiguous" if noise else "outside_library")
    certain, said, claimed = module._decided(
        replace(one, learned=("f",)), ranking, lack
    )
    assert certain.sets == ((("a",), 1.0),)
    assert certain.probability == {"a": 1.0, "b": 0.0}
    assert (said, claimed) == (
        ("learned", ("a",)) if noise else ("outside_library", ())
    )


def test_small_terms_behind_a_fit_count_as_unknowns_by_what_the_readings_say(
    monkeypatch,
):
    """Of 3.6 small unknowns known by the readings 4 degrees of freedom are gone."""
    monkeypatch.setattr(module, "lack_of_fit", lambda *asked: asked)
    behind = SimpleNamespace(left=lambda residual: 0.5 * residual, unknowns=3.6)
    fit = SimpleNamespace(residual=np.array([2.0, -4.0]))
    selection = SimpleNamespace(behind=behind, unknowns=5, fit=fit)
    rows, left, unknowns = module._lack_of_fit(
        SimpleNamespace(fitting="rows", inflation=3.0), selection
    )
    assert rows == "rows"
    np.testing.assert_array_equal(left, [3.0, -6.0])
    assert unknowns == 9
