"""Which sets are fitted in full, on signatures that are unit vectors: scores by hand.

Of m = 5 effects in 40 readings a single one costs ln(40)/2 + ln 5 = 3.5, a pair 8.3, a
triple 12.4; reading k is z_k, so that its effect alone gains z_k^2 / 2.
"""

import numpy as np
import pytest

from assembly.effects.effect import Unknown
from validation.diagnosis import refitting
from validation.diagnosis.background import NOTHING
from validation.diagnosis.hypotheses import Hypothesis, Slot
from validation.diagnosis.refit import Fit
from validation.diagnosis.refitting import Refits, names_of
from validation.diagnosis.scoring import FINITE, Scored, Screen
from validation.diagnosis.signatures import Signature

CELLS = 40


def screen_of(*sizes, effects="abcde"):
    """Effects that show in one reading each, of these sizes."""
    signatures = []
    for k, effect in enumerate(effects):
        slot = Slot(("x",), Unknown("x", 1.0), 0.0)
        column = np.eye(CELLS)[:, [k]]
        hypothesis = Hypothesis(effect, (), (slot,))
        signatures.append(Signature(hypothesis, np.zeros(CELLS), column))
    return Screen(np.array([*sizes, *np.zeros(CELLS - len(sizes))]), signatures)


class Made(Refits):
    """Fits that leave what the tangents leave, and for some sets more."""

    def __init__(self, more=None):
        super().__init__(None, None, [], 0.0, {})
        self.more = more or {}

    def fit(self, one, screen, behind):
        left = np.zeros(1) + np.sqrt(one.rss + self.more.get(one.members, 0.0))
        return Fit((), one.values, np.zeros((0, 0)), left, None, np.zeros((1, 0)))


def round_of(screen, more=None):
    told = []
    sets, fits = Made(more).round(screen, NOTHING, lambda *now: told.append(now))
    assert told[0][0] == 0
    assert [done for done, _ in told] == list(range(len(fits) + 1))
    assert all(done < total for done, total in told[:-1])
    assert told[-1] == (len(fits), len(fits))
    return sets, set(fits)


def test_the_best_set_its_parts_and_what_is_near_it_are_fitted():
    """A pair; a third effect that adds nothing is 4.1 worse, all else by 9 and more."""
    sets, fitted = round_of(screen_of(6.0, 5.0))
    assert sets[0].members == (0, 1)
    assert {(0,), (1,)} < fitted
    assert {one for one in fitted if len(one) == 3} == {(0, 1, 2), (0, 1, 3), (0, 1, 4)}
    assert len(fitted) == 6
    assert [s.members for s in sets].count((0, 1)) == 1


@pytest.mark.parametrize(("behind", "fitted"), [(5.9, True), (6.1, False)])
def test_of_two_ways_to_act_the_second_is_fitted_if_it_is_near(behind, fitted):
    """An effect at one of two places: less likely by e^-6, it is not looked at."""
    screen = screen_of(8.0, np.sqrt(64.0 - 2 * behind), effects="aa")
    sets, found = round_of(screen)
    assert [s.members for s in sets] == [(0,), (1,), ()]
    assert ((1,) in found) == fitted


def test_of_many_ways_to_act_three_are_fitted():
    _, found = round_of(screen_of(8.0, 7.9, 7.8, 7.7, effects="aaaa"))
    assert found == {(), (0,), (1,), (2,)}


def test_what_is_far_from_the_best_is_not_fitted():
    """Nothing shows: the empty set is best; one effect is 3.5 worse, two are 8.3."""
    sets, fitted = round_of(screen_of())
    assert sets[0].members == ()
    assert fitted == {(), (0,), (1,), (2,)}


def test_a_set_that_fits_worse_than_its_tangent_gives_way_to_the_next():
    sets, fitted = round_of(screen_of(6.0, 5.0, 4.0), {(0, 1, 2): 100.0, (0, 1): 60.0})
    best = sets[0]
    assert best.members == (0, 2)
    assert best.score == max(s.score for s in sets if s.members in fitted)
    worse = next(s for s in sets if s.members == (0, 1, 2))
    assert worse.rss == pytest.approx(100.0)
    assert {(0,), (2,)} <= fitted
    assert sorted(s.members for s in sets) == sorted({s.members for s in sets})


def test_of_sets_with_finite_motions_the_best_two_are_fitted():
    """Each alone, and none where another is best whose parts they are not."""
    slow = screen_of(8.0, 7.0, 6.0, effects=["a", "b", FINITE, "d", "e"])
    _, fitted = round_of(slow, {(0, 1, 2): 100.0})
    assert {(0, 1, 2), (0, 2), (0, 1)} <= fitted
    assert (1, 2) not in fitted
    _, fitted = round_of(slow)  # where it is best, each of its parts is fitted
    assert (1, 2) in fitted


def test_a_fit_begins_where_screening_ended_but_for_shapes_and_is_kept(
    monkeypatch,
):
    """Of a nuisance at 0.3, an amplitude found at 1.5 and a shape looked at at 0.7."""
    slots = (
        Slot(("size",), Unknown("size", 1.0), 0.0),
        Slot(("constant",), Unknown("constant", 1.0), 0.7, shape=True),
    )
    nuisance = Hypothesis("other", (), (Slot(("y",), Unknown("y", 1.0), 0.3),))
    shaped = Hypothesis("drift", (), slots)
    signature = Signature(shaped, np.zeros(CELLS), np.eye(CELLS)[:, :2])
    screen = Screen(np.zeros(CELLS), [signature])
    one = Scored((0,), np.array([1.5, 0.0]), 0.0, 2, 0.0)
    begun = []
    ends = Fit((), np.array([0.4, 1.6, 0.8]), np.zeros((3, 3)), np.zeros(1), None, None)

    def refit(campaign, conditions, members, start, defect, behind, earlier):
        begun.append((members, start, defect, earlier))
        return ends

    monkeypatch.setattr(refitting, "refit", refit)
    monkeypatch.setattr(refitting, "adds_clearance", lambda *given: False)
    other = names_of([nuisance])
    refits = Refits(None, None, [nuisance], 0.25, {other: np.array([0.2])})
    assert refits.fit(one, screen, NOTHING) is refits.fit(one, screen, NOTHING) is ends
    ((members, start, defect, earlier),) = begun
    assert members == [nuisance, shaped]
    assert start == pytest.approx([0.3, 1.5, 0.7])
    assert defect == 0.25
    assert earlier is None  # of this set
    refits.forget()
    refits.fit(one, screen, NOTHING)
    assert begun[1][3] is ends.values  # behind other terms it may go on from there
    assert set(refits.ended) == {other, names_of(members)}
