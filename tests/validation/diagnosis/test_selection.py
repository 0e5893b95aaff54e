"""Which set is selected, round after round, by stand-ins and made-up tangents."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from assembly.effects.effect import Unknown
from assembly.model.robot import Frame, Robot
from validation.diagnosis import selection as module
from validation.diagnosis.evidence import Prior
from validation.diagnosis.hypotheses import Hypothesis, Slot
from validation.diagnosis.refit import Fit
from validation.diagnosis.scoring import FINITE, Scored
from validation.diagnosis.signatures import Signature

CELLS = 5


def effect(name, *slots, shapes=()):
    """Of numbers by name, all of which begin at one half."""
    return Hypothesis(
        name, (), tuple(Slot((s,), Unknown(s, 1.0), 0.5, s in shapes) for s in slots)
    )


def signature(hypothesis, fill=1.0, offset=0.0):
    count = len(hypothesis.slots)
    return Signature(hypothesis, np.full(CELLS, offset), np.full((CELLS, count), fill))


def fit_of(*hypotheses, values=()):
    return Fit(
        hypotheses, np.array(values, dtype=float), None, np.full(CELLS, 2.0),
        SimpleNamespace(robot=None), None,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("fill", "offset", "shows"),
    [(0.0, 0.0, False), (1e-9, 0.0, True), (0.0, 0.88, False), (0.0, 0.91, True)],
)
def test_a_signature_shows_by_its_columns_or_four_squares(fill, offset, shows):
    """5 cells of 0.9^2 are 4.05."""
    one = signature(effect("a", "x"), fill, offset)
    assert module._shows(one) == shows


def test_a_signature_has_answers_everywhere_or_none():
    one = signature(effect("a", "x"))
    assert module._finite(one)
    assert not module._finite(replace(one, offset=np.full(CELLS, np.nan)))
    assert not module._finite(replace(one, columns=np.full((CELLS, 1), np.inf)))


@pytest.mark.parametrize("free", [False, True])
def test_hypotheses_that_show_are_kept_but_for_the_base_where_it_is_fitted(
    monkeypatch, free
):
    base = "base.tx"
    every = [
        effect("link_length", "x"), effect("registration", base), effect("drift", "y"),
        effect("self_weight", "z"), effect("registration", "tool.tx"),
    ]  # fmt: skip
    monkeypatch.setattr(module, "hypotheses", lambda conditions, loads: every)
    monkeypatch.setattr(module, "loaded_components", lambda campaign: [])
    fills = {"drift": 0.0, "self_weight": np.nan}
    tangents = SimpleNamespace(
        campaign=None, at_start=lambda h: signature(h, fills.get(h.effect, 1.0))
    )
    told = []
    found = module._signatures(tangents, None, lambda *now: told.append(now), free=free)
    names = [s.hypothesis.slots[0].names[0] for s in found]
    assert names == ["x", *([] if free else [base]), "tool.tx"]
    count = 5 - free
    assert told == [("signatures", k + 1, count) for k in range(count)]


def test_shapes_stay_where_they_were_fitted():
    """Columns of shapes are none; what they did goes into the offset."""
    h = effect("drift", "size", "constant", shapes=("constant",))
    made = Signature(h, np.arange(5.0), np.outer(np.arange(5.0), [1.0, 10.0]))
    frozen = module._frozen_shapes(made, np.array([3.0, 0.5]))
    assert frozen.columns.tolist() == np.outer(np.arange(5.0), [1.0, 0.0]).tolist()
    assert frozen.offset.tolist() == (6 * np.arange(5.0)).tolist()


def test_tangents_are_retaken_where_a_fit_ended(monkeypatch):
    """Not of a nuisance, nor of what is linear, nor without numbers or answers."""
    linear = {
        "base": True,
        "a": False,
        "b": True,
        "c": False,
        "d": False,
        FINITE: False,
    }
    library = {k: SimpleNamespace(linear=on) for k, on in linear.items()}
    monkeypatch.setattr(module, "LIBRARY", library)
    nuisance, a = effect("base", "x", "y"), effect("a", "p", "q", shapes=("q",))
    b, c, finite = effect("b", "x"), effect("c", "x"), effect(FINITE)
    asked = []

    def about(hypothesis, x, others):
        asked.append((hypothesis, x.tolist(), set(others)))
        return signature(hypothesis, np.nan if hypothesis.effect == "c" else 7.0)

    fit = fit_of(nuisance, a, b, c, finite, values=[1, 2, 3, 4, 5, 6])
    object.__setattr__(fit, "effects", dict.fromkeys(linear, {}))
    before = [signature(h) for h in (a, b, c, finite, effect("d", "x"))]
    after = module._about(SimpleNamespace(about=about), before, fit, 1)
    assert [(h.effect, x) for h, x, _ in asked] == [("a", [3.0, 4.0]), ("c", [6.0])]
    assert [slot.start for slot in asked[0][0].slots] == [0.5, 4.0]
    assert asked[0][2] == {"base", "b", "c", "d"}
    assert after[1:] == before[1:]
    assert after[0].columns.tolist() == [[7.0, 0.0]] * CELLS
    assert after[0].offset.tolist() == [28.0] * CELLS


LOOSE = np.full(6, 1e-4)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("loose", [False, True])
def test_clearances_of_closed_chains_are_held_as_declared_and_then_as_found(
    monkeypatch, closed, loose
):
    frames = Frame("a", clearance=LOOSE if loose else None), Frame("b", "a")
    robot = Robot("r", "b", frames, (("a", "b"),) if closed else ())
    asked = []

    def select(campaign, conditions, update, ended):
        asked.append((conditions.rest, ended))
        return SimpleNamespace(fit=SimpleNamespace(effects={}), ended="first")

    monkeypatch.setattr(module, "_select", select)
    monkeypatch.setattr(
        module, "virtual_joints",
        lambda robot: SimpleNamespace(cones=np.zeros((1, 6 if loose else 0, 1))),
    )  # fmt: skip
    monkeypatch.setattr(
        module, "with_rest_positions", lambda c: SimpleNamespace(rest="declared")
    )
    monkeypatch.setattr(module, "rest_under", lambda conditions, effects: "found")
    monkeypatch.setattr(module, "replace", lambda c, rest: SimpleNamespace(rest=rest))
    conditions = SimpleNamespace(robot=robot, rest=None)
    module._select_settled(None, conditions, None, "begun")
    assert asked == (
        [("declared", "begun"), ("found", "first")]
        if closed and loose
        else [(None, "begun")]
    )


@pytest.fixture
def rounds(monkeypatch):
    """Rounds whose best sets and evidence are told beforehand."""
    told = SimpleNamespace(
        best=[], evidence=[], clearance=[], settled=[], forgotten=0, about=[],
        priors=[], residuals=[], finite=[], full=0,
    )  # fmt: skip
    a, b = effect("a", "x"), effect("b", "y", "z")
    signatures = [
        signature(a),
        signature(b, 2.0),
        signature(effect(FINITE), offset=9.0),
    ]
    fits = {(0,): fit_of(a, values=[1]), (1,): fit_of(b, values=[1, 2])}

    class Refits:
        ended = "ended"

        def __init__(self, campaign, conditions, nuisance, finite, ended):
            told.finite.append(finite)

        def round(self, screen, behind, update):
            members = told.best.pop(0)
            other = (1 - members[0],)
            sets = [
                Scored(members, None, 6.0, 4, 10.0),
                Scored(other, None, 0.0, 2, 1.0),
            ]
            return sets, fits

        def settle(self, members, values):
            told.settled.append(members)

        def forget(self):
            told.forgotten += 1

    def best(residual):
        told.residuals.append(residual.tolist())
        return Prior((), {}, -1.0, told.evidence.pop(0))

    class Screens:
        terms = ("terms",)

        def __init__(self, terms, project, residual):
            self.evidence = SimpleNamespace(best=best)

        def first(self, signatures):
            return Prior((), {}, -2.0, 0.0)

        def screen(self, signatures, prior):
            told.priors.append(prior)
            return SimpleNamespace(effects=["a", "b", FINITE])

    held = SimpleNamespace(
        residual=np.zeros(CELLS), at_start=lambda h: signature(h, 5.0)
    )
    monkeypatch.setattr(module, "Tangents", lambda campaign, conditions: held)
    monkeypatch.setattr(module, "_signatures", lambda *given, free: signatures)
    monkeypatch.setattr(module, "small_terms", lambda *given: [])
    monkeypatch.setattr(module, "responses", lambda *given: None)
    monkeypatch.setattr(module, "Screens", Screens)
    monkeypatch.setattr(module, "Refits", Refits)
    monkeypatch.setattr(
        module, "background",
        lambda terms, prior: SimpleNamespace(raw=lambda residual: 3 * residual),
    )  # fmt: skip
    monkeypatch.setattr(
        module, "adds_clearance", lambda conditions, members: bool(told.clearance)
    )
    monkeypatch.setattr(
        module, "device_frame", lambda conditions: effect("registration", "u", "v")
    )

    def about(tangents, signatures, fit, skipped):
        told.about.append(skipped)
        return signatures

    def in_full(campaign, conditions, fit, behind):
        told.full += 1
        return fit

    monkeypatch.setattr(module, "_about", about)
    monkeypatch.setattr(module, "in_full", in_full)

    def select(registration="known"):
        campaign = SimpleNamespace(registration=registration)
        return module._select(campaign, None, lambda *now: None, {})

    return told, select


def test_the_same_best_set_twice_is_the_end(rounds):
    """Sizes asked for anew promise less than one in score: 4, then 13 less."""
    told, select = rounds
    told.best, told.evidence = [(0,), (0,), (1,)], [-5.0] * 3
    found = select()
    assert (len(told.priors), told.about, told.forgotten) == (2, [0], 0)
    assert found.sets[0].members == (0,)
    assert found.unknowns == 4
    assert found.columns.tolist() == [[1.0]] * CELLS
    assert told.residuals[0] == [6.0] * CELLS
    assert np.all(told.finite[0] == 9.0)
    assert (told.settled, told.full) == ([], 0)


def test_a_changed_best_set_is_scored_again(rounds):
    told, select = rounds
    told.best, told.evidence = [(0,), (1,), (1,)], [-5.0] * 3
    found = select("unknown")
    assert len(told.priors) == 3
    assert told.about == [1, 1]
    assert found.unknowns == 4 + 6
    # the device's frame first
    assert found.columns.tolist() == [[5.0, 5.0, 2.0, 2.0]] * CELLS


@pytest.mark.parametrize(("evidence", "settled"), [(-4.1, True), (-3.9, False)])
def test_sizes_that_promise_one_more_in_score_are_taken(rounds, evidence, settled):
    """8 with what small terms cost; 10 + 6 / 2 beside squares with the evidence."""
    told, select = rounds
    told.best, told.evidence = [(0,)] * 4, [evidence, -9.0, -9.0, -9.0]
    select()
    assert told.forgotten == (not settled)
    assert len(told.priors) == 2
    assert [prior.cost for prior in told.priors] == [-2.0, -2.0 if settled else -1.0]


def test_rounds_end(rounds):
    """However the best set alternates; clearances rest where each leaves them."""
    told, select = rounds
    told.best, told.evidence = [(0,), (1,)] * 9, [-5.0] * 18
    told.clearance = ["some"]
    select()
    assert len(told.priors) == len(told.settled) == 4
    assert told.full == 1


@pytest.mark.parametrize("finite", [False, True])
def test_finite_motions_are_fitted_once_more_if_asked_for(monkeypatch, finite):
    first = module.Selection(**dict.fromkeys(module.Selection.__annotations__))
    first = replace(first, fit=fit_of(effect("a", "x"), values=[3.0]), behind="behind")
    asked = []

    def refit(campaign, conditions, members, start, behind):
        asked.append(([h.effect for h in members], start.tolist(), behind))
        return "exact"

    monkeypatch.setattr(module, "_select_settled", lambda *given: first)
    monkeypatch.setattr(module, "refit", refit)
    found = module.select(None, None, lambda *now: None, finite=finite)
    assert asked == ([(["a", FINITE], [3.0], "behind")] if finite else [])
    assert (found is first) == (not finite)
