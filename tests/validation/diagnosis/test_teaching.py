"""Beside what functions are learned, and whether they are kept, by stand-ins."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.campaigns_for_tests import campaign_of
from validation.diagnosis import teaching as module
from validation.diagnosis.background import NOTHING as NOTHING_BEHIND
from validation.diagnosis.evidence import Prior
from validation.diagnosis.hypotheses import Hypothesis, Slot
from validation.diagnosis.lack_of_fit import SIGNIFICANT, LackOfFit
from validation.diagnosis.learning import Lesson
from validation.diagnosis.refit import Fit
from validation.diagnosis.scoring import Scored
from validation.diagnosis.selection import Selection
from validation.diagnosis.teaching import NOTHING, Taught, _Story, cost_of, taught

ROWS = 40
USED = np.arange(ROWS) < 30


def fit_of(hypotheses=(), values=(), residual=()):
    return Fit(
        tuple(hypotheses), np.array(values, dtype=float), np.zeros((0, 0)),
        np.array(residual, dtype=float), None, np.zeros((0, 0)),
    )  # fmt: skip


def effect(name, count):
    """One of so many numbers."""
    slot = Slot((f"{name}.x",), None, 0.5)
    return Hypothesis(name, (), (slot,) * count)


def selection_of(members=(0,), rank=3, hypotheses=(), effects=("link_length", "drift")):
    """A best set; the device's frame has six of its nine unknowns."""
    screen = SimpleNamespace(
        effects=list(effects), fit=lambda members: Scored(members, None, 1.0, 1, 0.0)
    )
    behind = SimpleNamespace(
        unknowns=2.6, left=lambda residual: residual, raw=lambda residual: 3 * residual
    )
    count = sum(len(h.slots) for h in hypotheses)
    fit = fit_of(hypotheses, np.arange(count), [1.0, -2.0])
    return Selection(
        screen=screen, sets=[Scored(members, np.zeros(0), 0.0, rank, 0.0)], fit=fit,
        rivals=(), unknowns=rank + 6, tangents=None, behind=behind, terms=(),
        columns=np.arange(2.0 * count).reshape(2, count), ended={},
    )  # fmt: skip


@pytest.fixture
def asked(monkeypatch):
    """Two stories that cost 5 and 3; what was asked of others."""
    told = SimpleNamespace(
        probability=1e-9, timed=False, foretells=True, costs={"alone": 5.0,
        "beside": 3.0}, learned=("f",), unknowns=[], held=[], known=[],
    )  # fmt: skip

    def lack(rows, left, unknowns):
        told.unknowns.append(unknowns)
        return LackOfFit(1.0, 9, told.probability, np.nan, 0, 1.0)

    def learn(campaign, used, sensitivities, left, update, known):
        kind = ("alone", "beside")[left.effects.shape[1]]
        told.known.append(known)
        prior = Prior((), {}, 0.0, 0.0)
        return Lesson(told.learned, (kind,), prior, 0.0, 0.0, told.costs[kind])

    def stories(fitting, some, selection):
        return [
            _Story("alone", (), fit_of(["alone"]), np.zeros((2, 0))),
            _Story("beside", (0,), fit_of(["beside"]), np.zeros((2, 1))),
        ]

    def foretells(campaign, held, before, after):
        told.held.append(held)
        return told.foretells

    monkeypatch.setattr(module, "lack_of_fit", lack)
    monkeypatch.setattr(module, "_timed", lambda *given: told.timed)
    monkeypatch.setattr(module, "_stories", stories)
    monkeypatch.setattr(module, "learn", learn)
    monkeypatch.setattr(module, "_foretells", foretells)
    monkeypatch.setattr(module, "responses", lambda *given: None)
    monkeypatch.setattr(module, "Sensitivities", lambda *given: None)
    monkeypatch.setattr(module, "with_clearance_held", lambda here, fit: here)
    monkeypatch.setattr(module, "background", lambda terms, prior: (terms, prior))
    monkeypatch.setattr(
        module, "refit", lambda rows, here, members, start, behind: fit_of(members)
    )
    return told


def teach(selection, known=None):
    campaign = campaign_of(np.zeros((ROWS, 6)))
    here = SimpleNamespace(take=lambda rows: None)
    return taught(campaign, here, USED, selection, lambda *told: None, known)


@pytest.mark.parametrize(
    ("probability", "timed", "looks"),
    [(0.5, False, False), (0.5, True, True), (1e-9, False, True), (1e-9, True, True),
     (1.1 * SIGNIFICANT, False, False), (0.9 * SIGNIFICANT, False, True)],
)  # fmt: skip
def test_functions_are_looked_for_where_more_than_noise_is_left_or_time_stands_for_it(
    asked, probability, timed, looks
):
    asked.probability, asked.timed = probability, timed
    selection = selection_of()
    told, learned = teach(selection)
    assert asked.unknowns == [9 + 3]
    assert len(asked.known) == (2 if looks else 0)
    assert (learned is NOTHING, told is selection) == (not looks, not looks)


@pytest.mark.parametrize(("cost", "kind"), [(2.0, "alone"), (5.0, "beside")])
def test_the_story_that_costs_least_is_told(asked, cost, kind):
    """Without effects its own numbers are one, and those of the device's frame six."""
    asked.costs["alone"] = cost
    selection = selection_of()
    told, learned = teach(selection)
    assert (learned.functions, learned.kind) == (("f",), kind)
    assert told.fit.hypotheses == (kind,)
    assert told.terms == (kind,)
    assert told.behind[0] == (kind,)
    assert asked.held[0].tolist() == (~USED).tolist()
    own = [s.members for s in told.sets]
    assert own == ([(), (0,)] if kind == "alone" else [(0,)])
    assert told.unknowns == (1 + 6 if kind == "alone" else 9)


def test_what_is_not_foretold_or_not_found_is_not_learned(asked):
    selection = selection_of()
    asked.foretells = False
    assert teach(selection) == (selection, NOTHING)
    asked.foretells, asked.learned = True, ()
    assert teach(selection) == (selection, NOTHING)


@pytest.mark.parametrize("kind", ["alone", "beside", "timeless"])
def test_what_is_known_is_told_beside_its_own_story(asked, kind):
    """Whatever others cost; a story that is no more is told no more."""
    selection = selection_of()
    told, learned = teach(selection, Taught(("g",), kind))
    if kind == "timeless":
        assert (told, learned) == (selection, NOTHING)
        return
    assert asked.known == [("g",)]
    assert learned.kind == kind


@pytest.fixture
def refitted(monkeypatch):
    """Hypotheses and starts of all refits; rows follow one another if told so."""
    told = SimpleNamespace(fits=[], kind=module.SPANS)

    def refit(fitting, some, members, start):
        told.fits.append((list(members), start.tolist()))
        return fit_of(members, start)

    monkeypatch.setattr(module, "refit", refit)
    monkeypatch.setattr(module, "device_frame", lambda some: effect("device", 2))
    monkeypatch.setattr(module, "blocks_of", lambda rows: (None, told.kind))
    return told


@pytest.mark.parametrize("registration", ["known", "unknown"])
@pytest.mark.parametrize(
    ("members", "rank", "kinds"),
    [((), 0, ["alone"]), ((0,), 0, ["alone"]), ((0,), 2, ["alone", "beside"]),
     ((0, 1), 2, ["alone", "beside", "timeless"]), ((1,), 1, ["alone", "beside"])],
)  # fmt: skip
def test_stories_are_without_effects_with_them_and_without_those_of_time(
    refitted, registration, members, rank, kinds
):
    """The second effect is of time; device 2, then 2 and 1 numbers of the effects."""
    every = effect("link_length", 2), effect("drift", 1)
    device = [effect("device", 2)] if registration == "unknown" else []
    hypotheses = [*device, *(every[i] for i in members)]
    selection = selection_of(members, rank, hypotheses)
    fitting = SimpleNamespace(registration=registration)
    stories = module._stories(fitting, None, selection)
    assert [s.kind for s in stories] == kinds
    assert refitted.fits[0] == (device, [0.5] * (2 * len(device)))
    assert (stories[0].members, stories[0].columns.shape) == ((), (2, 2 * len(device)))
    if "beside" in kinds:
        assert stories[1].members == members
        assert stories[1].fit.residual.tolist() == [3.0, -6.0]
        assert stories[1].columns is selection.columns
    if "timeless" in kinds:
        assert stories[2].members == (0,)
        kept = list(range(2 * len(device) + 2))
        assert refitted.fits[1] == ([*device, every[0]], [float(k) for k in kept])
        assert stories[2].columns.tolist() == selection.columns[:, kept].tolist()
    refitted.kind = "configurations"
    again = module._stories(fitting, None, selection)
    assert [s.kind for s in again] == kinds[:2]


@pytest.mark.parametrize(
    ("members", "spans", "timed"),
    [((0, 1), True, True), ((0, 1), False, False), ((0,), True, False)],
)
def test_effects_of_time_count_where_rows_follow_one_another(
    refitted, members, spans, timed
):
    refitted.kind = module.SPANS if spans else "configurations"
    assert module._timed(None, selection_of(members)) == timed
    assert not module._of_time("no effect of the library")


def test_a_story_costs_what_it_leaves_and_its_numbers():
    """n ln(squares / n) + k ln n, k with the small unknowns that the readings say."""
    selection = selection_of()
    left = np.array([3.0, 4.0, 5.0, 1.0, 2.0])
    selection = replace(selection, fit=replace(selection.fit, residual=left))
    expected = 5 * np.log(55 / 5) + (9 + 2.6) * np.log(5)
    assert cost_of(selection) == pytest.approx(expected)


class Model:
    """What a model leaves."""

    def __init__(self, left):
        self.left = left

    def residual(self, campaign):
        return self.left


@pytest.mark.parametrize(
    ("less", "foretold"),
    [((1.0, 1.0), True), ((1.0, 0.1), True), ((1.0, 0.0), False), ((1.0, -1.0), False),
     ((-1.0, -1.0), False), ((0.0, 0.0), False)],
)  # fmt: skip
def test_rows_kept_aside_are_foretold_better_by_more_than_they_scatter(less, foretold):
    """Gains a, b of two configurations: a + b above |a - b|; 1, 0 is just not above.

    Errors of other rows are of no account, nor are cells not measured.
    """
    readings = np.ones((ROWS, 6))
    readings[:, 1:] = np.nan
    campaign = campaign_of(readings, 2.0)
    held = np.isin(np.arange(ROWS), [7, 9])
    before = np.full((ROWS, 6), 6.0)
    after = before + 50.0
    # of Student's t: of 3 sigma the likelihood gains so much by a smaller error
    fallen = (1 + 9 / 4) * np.exp(-0.2 * np.array(less))
    after[[7, 9], 0] = 2 * np.sqrt(4 * (fallen - 1))
    told = module._foretells(campaign, held, Model(before), Model(after))
    assert told == foretold
    assert module._foretells(campaign, held & False, Model(before), Model(after))


def test_functions_have_the_numbers_of_their_terms(monkeypatch):
    """Of geometry and two functions, each its own."""
    behind = SimpleNamespace(
        terms=[
            SimpleNamespace(name=n) for n in ("geometry", "function 1", "function 2")
        ],
        values=lambda residual: [1.0, 2.0, 3.0],
        deviations=lambda: [0.1, 0.2, 0.3],
    )
    model = SimpleNamespace(
        behind=behind, fit=fit_of(),
        learned=[SimpleNamespace(candidate=c) for c in "ab"],
        sensitivities=SimpleNamespace(fitted=lambda *given: given),
    )  # fmt: skip
    assert module.functions_of(None, model) == [("a", 2.0, 0.2), ("b", 3.0, 0.3)]
    assert not NOTHING_BEHIND
