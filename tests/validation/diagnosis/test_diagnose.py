"""In which order things are asked, by stand-ins that write down what they are asked."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from assembly.kinematics.posture import place_robot
from assembly.measurement.predict import predict, with_second_order
from tests.bar_for_tests import bar
from tests.validation.diagnosis.test_finite_errors import ARM
from validation.diagnosis import diagnose as module
from validation.diagnosis.background import background
from validation.diagnosis.diagnose import diagnose
from validation.diagnosis.evidence import Evidence
from validation.diagnosis.lack_of_fit import LackOfFit
from validation.diagnosis.refit import refit
from validation.diagnosis.responses import responses
from validation.diagnosis.signatures import conditions_of, whiten
from validation.diagnosis.small_terms import screws_of, small_terms
from validation.diagnosis.teaching import Taught

ROWS = 60
NOISE = LackOfFit(1.0, 9, 0.5, np.nan, 0, 1.0)
LEARNED = Taught(("a function",), "alone")


class Made(SimpleNamespace):
    """What stands in for a selection; 2.6 small unknowns are known by the readings."""

    def __init__(self, **changes):
        behind = SimpleNamespace(unknowns=2.6, left=lambda residual: residual)
        fit = SimpleNamespace(residual=np.zeros(3))
        super().__init__(**{"unknowns": 4, "behind": behind, "fit": fit} | changes)


@pytest.fixture
def asked(monkeypatch):
    """Lists of what is to be answered, pass by pass, and of what was asked."""
    told = SimpleNamespace(
        larger=[], lack=[], bends=0, straight=[], known=[], unknowns=[], complete=[],
        selected=[], straighter=lambda conditions, selection: (conditions, selection),
    )  # fmt: skip

    def select(campaign, conditions, update, finite, earlier):
        told.selected.append((campaign.sigma[0, 0], finite, earlier))
        return Made()

    def bent(campaign, conditions, used, selection, complete):
        told.bends -= 1
        return replace(conditions) if told.bends >= 0 else conditions

    def taught(campaign, conditions, used, selection, update, known):
        told.known.append(known)
        return selection, LEARNED

    def straighter(campaign, straight, conditions, selection, learned, update):
        told.straight.append(straight)
        return told.straighter(conditions, selection)

    def lack(rows, left, unknowns):
        told.unknowns.append(unknowns)
        return told.lack.pop(0) if told.lack else NOISE

    def complete(name):
        def completed(conditions):
            told.complete.append(name)
            return conditions

        return completed

    monkeypatch.setattr(module, "select", select)
    monkeypatch.setattr(module, "_with_errors", bent)
    monkeypatch.setattr(module, "taught", taught)
    monkeypatch.setattr(module, "_straighter", straighter)
    monkeypatch.setattr(module, "lack_of_fit", lack)
    monkeypatch.setattr(
        module, "believed_noise",
        lambda *rows: told.larger.pop(0) if told.larger else np.ones(6),
    )  # fmt: skip
    monkeypatch.setattr(module, "outlying", lambda rows, *given, **how: np.zeros(
        len(rows), bool
    ))  # fmt: skip
    monkeypatch.setattr(module, "judge", lambda settled: settled)
    for name in ("with_finite_motions", "with_second_order"):
        monkeypatch.setattr(module, name, complete(name))
    return told


@pytest.mark.parametrize("asked_for", [False, True])
@pytest.mark.parametrize("declared", [False, True])
def test_motions_are_finite_if_asked_for_or_declared(
    asked, monkeypatch, asked_for, declared
):
    monkeypatch.setattr(
        module, "conditions_of", lambda c: replace(conditions_of(c), exact=declared)
    )
    found = diagnose(bar(rows=ROWS), finite=asked_for)
    finite = asked_for or declared
    assert found.finite == finite
    assert asked.selected[0][1] == finite
    name = "with_finite_motions" if finite else "with_second_order"
    assert asked.complete == [name]


def test_one_pass_is_enough_where_noise_is_left(asked):
    campaign = bar(rows=ROWS)
    found = diagnose(campaign)
    assert len(asked.selected) == 1
    assert asked.unknowns == [4 + 3]
    assert asked.known == [None]
    assert asked.straight == []
    assert (found.inflation, found.learned) == (1.0, LEARNED.functions)
    assert found.noise_factor.tolist() == [1.0] * 6
    assert found.campaign.sigma.tolist() == campaign.sigma.tolist()
    assert not found.outliers.any()


def test_repeats_are_believed_pass_by_pass(asked):
    """Rotations three times, then positions twice the noise stated."""
    rotations, positions = np.repeat([3.0, 1.0], 3), np.repeat([1.0, 2.0], 3)
    asked.larger = [rotations, positions]
    campaign = bar(rows=ROWS)
    found = diagnose(campaign)
    assert len(asked.selected) == 3
    assert [earlier is None for *_, earlier in asked.selected] == [True, False, False]
    assert found.noise_factor.tolist() == [3.0] * 3 + [2.0] * 3
    np.testing.assert_allclose(
        found.campaign.sigma, campaign.sigma * found.noise_factor
    )
    # functions are looked for anew as long as sigma is that of repeats
    assert asked.known == [None, None, None]
    assert found.inflation == 1.0


@pytest.mark.parametrize(
    ("probability", "rms", "larger"),
    [(1e-9, 1.3, True), (1e-9, 1.2, False), (0.5, 1.3, False), (1e-9, 1.8, True)],
)
def test_sigma_is_made_larger_once_for_what_nothing_explains(
    asked, probability, rms, larger
):
    """Then no other functions are looked for."""
    more = LackOfFit(rms, 9, probability, np.nan, 0, 1.0)
    asked.lack = [more, more, more]
    campaign = bar(rows=ROWS)
    found = diagnose(campaign)
    assert len(asked.selected) == 1 + larger
    assert asked.known == [None, LEARNED][: 1 + larger]
    assert found.inflation == (rms if larger else 1.0)
    np.testing.assert_allclose(found.campaign.sigma, campaign.sigma * found.inflation)
    assert found.noise_factor.tolist() == [1.0] * 6


@pytest.mark.parametrize("bends", [0, 1, 2, 5])
def test_finite_errors_are_found_anew_a_few_times(asked, bends):
    """What was straight is remembered as it was before the first of them."""
    asked.bends = bends
    campaign = bar(rows=ROWS)
    there = conditions_of(campaign)
    asked.straighter = lambda conditions, selection: (there, "straight")
    if bends:
        asked.straighter = lambda conditions, selection: (there, Made(unknowns=1))
    found = diagnose(campaign)
    followed = min(bends, 3)
    assert len(asked.selected) == 1 + followed
    assert len(asked.straight) == bool(bends)
    assert asked.unknowns == [4 if bends else 7]
    assert (found.conditions is there) == bool(bends)
    for straight in asked.straight:
        assert straight.conditions is not found.conditions
        assert straight.used.tolist() == found.used.tolist()


def test_noise_that_grows_for_ever_ends(asked):
    """Each pass finds more noise between repeats."""
    asked.larger = [np.full(6, 2.0)] * 1000
    found = diagnose(bar(rows=ROWS))
    assert len(asked.selected) == 8
    assert found.noise_factor == pytest.approx(2.0 ** len(asked.selected))


def rows_left_out(monkeypatch, far, impossible=()):
    """Each turn some rows are far off; what is asked of every turn, and the end."""
    campaign = bar(rows=ROWS)
    fitted = np.arange(ROWS) < 50
    wrong = np.isin(np.arange(ROWS), impossible)
    asked, selected = [], []

    def outlying(rows, left, most, worst):
        asked.append((len(rows), most, worst))
        seen = [int(name[1:]) for name in rows.ids]
        return np.isin(seen, far[len(asked) - 1] if len(asked) <= len(far) else ())

    def select(rows, conditions, earlier):
        selected.append((len(rows), earlier))
        return Made(number=len(selected))

    monkeypatch.setattr(module, "outlying", outlying)
    selection, outliers = module._without_outliers(
        campaign, conditions_of(campaign), fitted, (wrong, wrong), select, None
    )
    assert selection.number == len(selected)
    return asked, selected, np.flatnonzero(outliers).tolist()


def test_rows_far_off_are_left_out_turn_by_turn(monkeypatch):
    """Three of sixty at most, and impossible ones besides; rows that judge stay."""
    asked, selected, outliers = rows_left_out(monkeypatch, [[7], [30, 31]], [3])
    assert outliers == [3, 7, 30, 31]
    assert [count for count, _ in selected] == [49, 48, 46]
    assert selected[0][1] is None
    assert [earlier.number for _, earlier in selected[1:]] == [1, 2]
    assert asked == [(49, 3, True), (48, 2, True), (46, 0, True)]


def test_in_the_last_turn_all_that_are_far_off_are_left_out_at_once(monkeypatch):
    """Each turn has a row more: the last selection is without all of them."""
    far = [[k] for k in range(20)]
    asked, selected, outliers = rows_left_out(monkeypatch, far)
    turns = 6
    assert [worst for *_, worst in asked] == [True] * (turns - 1) + [False]
    assert [most for _, most, _ in asked] == [max(0, 3 - k) for k in range(turns)]
    assert outliers == list(range(turns))
    assert selected[-1][0] == 50 - turns


@pytest.mark.parametrize(
    ("functions", "same", "costs", "goes_back"),
    [
        ((), ("f",), (1.0, 2.0), False), (("f",), ("f",), (1.0, 2.0), True),
        (("f",), ("f",), (2.0, 1.0), False), (("f",), (), (1.0, 2.0), False),
        (("f",), (), (2.0, 1.0), False),
    ],
)  # fmt: skip
def test_functions_are_kept_without_finite_errors_if_they_cost_less_there(
    monkeypatch, functions, same, costs, goes_back
):
    straight = module._Straight("straight", None, "its selection")
    monkeypatch.setattr(module, "taught", lambda *given: ("other", Taught(same, "")))
    cost = dict(zip(("other", "selection"), costs, strict=True))
    monkeypatch.setattr(module, "cost_of", cost.__getitem__)
    told = module._straighter(
        None, straight, "bent", "selection", Taught(functions, "alone"), None
    )
    assert told == (("straight", "other") if goes_back else ("bent", "selection"))


@pytest.fixture(params=[2e-2, 5e-3, 0.0], ids=["far off", "off", "as declared"])
def arm(request):
    """Its frames off by so much from what is known; twelve of 15 rows fitted."""
    rng = np.random.default_rng(3)
    known = 1e-2 * rng.normal(size=(3, 6))
    errors = rng.normal(size=(3, 6)) * np.repeat([1.0, 0.25], 3) * request.param
    placed = [
        place_robot(ARM, joints={"j1": a, "j2": b})
        for a, b in rng.uniform(-1.2, 1.2, (15, 2))
    ]
    campaign = replace(
        bar(rows=15), robot=ARM.with_errors(known),
        coordinates=np.stack([p.coordinates for p in placed]),
        transforms=np.stack([p.transforms for p in placed]),
    )  # fmt: skip
    here = conditions_of(replace(campaign, robot=ARM.with_errors(known + errors)))
    seen = predict(with_second_order(here)).deviation
    noise = rng.normal(size=seen.shape) * campaign.sigma
    campaign = replace(campaign, measured=seen + noise)
    used = np.arange(15) < 12
    conditions = with_second_order(conditions_of(campaign))
    some, fitting = conditions.take(used), campaign.take(used)
    terms = small_terms(fitting, some, responses(some))[:1]
    z = whiten(fitting, fitting.measured - predict(some).deviation)
    behind = background(terms, Evidence(terms, len(z)).best(z))
    fit = refit(fitting, some, [], np.zeros(0), behind=behind)
    selection = SimpleNamespace(behind=behind, fit=fit)
    return campaign, conditions, used, selection


def test_what_finite_errors_add_is_that_of_the_errors_then_found(arm):
    """Found anew beside it they add the same, to a tenth of what was left before."""
    campaign, conditions, used, selection = arm
    bent = module._with_errors(campaign, conditions, used, selection, with_second_order)
    behind = selection.behind
    fitting = campaign.take(used)
    if not behind:
        assert bent is conditions
        return
    left = whiten(fitting, fitting.measured - predict(bent.take(used)).deviation)
    values = behind.values(behind.whitened(left))
    errors = conditions.errors + screws_of(campaign, behind.terms, values)
    again = with_second_order(replace(conditions, errors=errors)).second_order
    change = whiten(fitting, (again - bent.second_order)[used])
    before = np.sqrt(np.mean(behind.left(selection.fit.residual) ** 2))
    assert before > 1.5
    assert np.abs(change).max() < 0.1 * before
    # down to the noise, of which unknowns take their part; before, squares are left
    assert np.mean(behind.left(behind.whitened(left)) ** 2) < 1.3


def test_without_geometric_errors_nothing_is_bent(arm):
    campaign, conditions, used, selection = arm
    terms = tuple(replace(t, name="springs") for t in selection.behind.terms)
    other = replace(selection.behind, terms=terms)
    same = SimpleNamespace(behind=other, fit=selection.fit)
    bent = module._with_errors(campaign, conditions, used, same, with_second_order)
    assert bent is conditions
