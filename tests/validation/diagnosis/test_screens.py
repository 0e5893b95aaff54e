"""Screens behind small terms, and which terms stand behind the best set."""

from types import SimpleNamespace

import numpy as np
import pytest

from assembly.effects.effect import Unknown
from validation.diagnosis import screens as module
from validation.diagnosis.evidence import Prior
from validation.diagnosis.hypotheses import Hypothesis, Slot
from validation.diagnosis.scoring import Scored, Screen
from validation.diagnosis.screens import Projector, Screens
from validation.diagnosis.signatures import Signature
from validation.diagnosis.small_terms import GEOMETRY, SmallTerm

CELLS = 30


def signature(effect, columns, offset):
    slots = tuple(
        Slot((f"x{k}",), Unknown(f"x{k}", 1.0), 0.0) for k in range(columns.shape[1])
    )
    return Signature(Hypothesis(effect, (), slots), offset, columns)


def test_signatures_are_whitened_by_small_terms_nuisances_taken_out(rng):
    """C^-1/2 (1 - Q Q') of every column and offset, asked for again or anew."""
    A = rng.normal(size=(CELLS, 2))
    Q = np.linalg.qr(A)[0]
    J = rng.normal(size=(CELLS, 4))
    term = SmallTerm(
        GEOMETRY, np.zeros(4, int), np.arange(4), J, np.full(4, np.nan), -np.inf
    )
    project = Projector([signature("nuisance", A, np.zeros(CELLS))])
    z = rng.normal(size=CELLS)
    screens = Screens([term], project, z)
    free = np.eye(CELLS) - Q @ Q.T
    shown = free @ J * np.repeat([0.5, 2.0], [3, 1])
    values, vectors = np.linalg.eigh(np.eye(CELLS) + shown @ shown.T)
    W = (vectors / np.sqrt(values)) @ vectors.T @ free
    prior = Prior((np.ones(4, bool),), {GEOMETRY: (0.5, 2.0)}, -1.0, 0.0)
    nothing = screens.evidence.none()
    every = [
        signature(f"effect {k}", rng.normal(size=(CELLS, k)), rng.normal(size=CELLS))
        for k in (2, 0, 1, 3)
    ]
    for some in (every, every, every[1:]):
        for one, M in ((prior, W), (nothing, free)):
            found = screens.screen(some, one)
            expected = Screen(M @ z, [
                Signature(s.hypothesis, M @ s.offset, M @ s.columns) for s in some
            ])  # fmt: skip
            for members in [(0,), (1,), (0, 2), (0, 1, 2)]:
                a, b = found.fit(members), expected.fit(members)
                np.testing.assert_allclose(a.values, b.values)
                assert (a.rss, a.score) == pytest.approx((b.rss, b.score))
    assert screens.screen([], prior).fit(()).rss == pytest.approx((W @ z) @ (W @ z))


@pytest.fixture
def tried(monkeypatch):
    """First choices among priors that are told apart by their cost."""
    asked = SimpleNamespace(left=[], searched=[])
    monkeypatch.setattr(
        module, "background",
        lambda terms, prior: SimpleNamespace(raw=lambda shown: 10 * shown),
    )  # fmt: skip

    def first(scores, further, always=False):
        """Scores of sets by prior; evidence of each prior that is asked for later."""
        names = iter("abcdefgh")
        waiting = iter([0.0, *further])

        def best(left):
            asked.left.append(left.tolist())
            return Prior((), {next(names): (0.0, 0.0)}, -2.0, next(waiting))

        def screen(signatures, prior):
            name = "".join(prior.scales) or "none"
            asked.searched.append(name)
            one = Scored((), np.zeros(0), 3.0, 0, scores[name])
            other = Scored((0,), np.zeros(0), 3.0, 0, -1e3)
            return SimpleNamespace(
                search=lambda: [one, other],
                shown=lambda one: np.array([len(asked.searched), one.score]),
            )

        here = Screens([], lambda columns: columns, np.array([100.0, 0.0]))
        none = Prior((), {}, 0.0, 0.0)
        here.evidence = SimpleNamespace(best=best, none=lambda: none, always=always)
        here.screen = screen
        chosen = here.first([])
        return "".join(chosen.scales) or "none"

    return first, asked


def test_small_terms_or_none_stand_behind_the_best_set(tried):
    """Scores with what small terms cost, 2; none of what is always there."""
    first, asked = tried
    low = [-1e3] * 9
    assert first({"a": 7.5, "none": 5.0}, low) == "a"
    assert asked.searched == ["a", "none"]
    assert first({"a": 6.5, "none": 5.0}, low) == "none"
    asked.searched.clear()
    assert first({"a": -9.0}, low, always=True) == "a"
    assert asked.searched == ["a"]


def test_sizes_are_asked_for_anew_of_what_the_best_set_leaves(tried):
    first, asked = tried
    first({"a": 7.5, "none": 5.0}, [-1e3] * 9)
    assert asked.left == [[100.0, 0.0], [90.0, -75.0], [80.0, -50.0]]


@pytest.mark.parametrize(("evidence", "searched"), [(-2.2, False), (-1.8, True)])
def test_sizes_that_promise_more_than_one_in_score_are_searched(
    tried, evidence, searched
):
    """The best is 5.5; a set of score 7.5 with squares 3 counts 9 beside them."""
    first, asked = tried
    found = first({"a": 7.5, "none": 0.0, "b": 9.0}, [evidence - 0.5, *[-1e3] * 9])
    assert asked.searched == ["a", "none", *(["b"] if searched else [])]
    assert found == ("b" if searched else "a")


def test_sizes_are_asked_for_a_few_times(tried):
    """Each promises more than the one before; four are looked at beside none."""
    first, asked = tried
    first(dict.fromkeys([*"abcdefgh", "none"], 1.0), [1e3] * 9)
    assert asked.searched == ["a", "none", "b", "c", "d"]
