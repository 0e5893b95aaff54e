"""Sets of effects: their order, what they show, and simulated ones with known ends."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from assembly.effects.effect import Unknown
from validation.diagnosis.hypotheses import Hypothesis, Slot
from validation.diagnosis.lack_of_fit import SIGNIFICANT
from validation.diagnosis.scoring import FINITE, Scored, Screen, named, posterior
from validation.diagnosis.signatures import Signature
from validation.diagnosis.verdict import calibrate


def signature(effect, columns, where=(), offset=0.0, shapes=()):
    """Of columns (N, k), those of shapes among its slots."""
    columns = np.asarray(columns, dtype=float)
    slots = tuple(
        Slot((f"x{k}",), Unknown(f"x{k}", 1.0), 0.0, k in shapes)
        for k in range(columns.shape[1])
    )
    count = np.zeros(len(columns))
    return Signature(Hypothesis(effect, where, slots), offset + count, columns)


def test_of_equal_sets_the_one_at_fewer_frames_comes_first():
    """Equal to a hundredth, below which refits of one model differ."""
    one, two = np.eye(3)[:, :1], np.eye(3)[:, 1:2]
    screen = Screen(np.zeros(3), [
        signature("a", one, ("f", "g")), signature("b", two, ("f",))
    ])  # fmt: skip
    for other, first in ((1.996, (1,)), (1.98, (0,)), (2.02, (1,))):
        sets = [
            Scored((0,), np.zeros(1), 0.0, 1, 2.0),
            Scored((1,), np.zeros(1), 0.0, 1, other),
        ]
        assert min(sets, key=screen.order).members == first


def test_what_a_set_shows_is_offset_and_columns(rng):
    """As much as its fit leaves less; also of a screen for another residual."""
    z, other = rng.normal(size=(2, 12))
    signatures = [
        signature("a", rng.normal(size=(12, 2)), offset=0.3),
        signature("b", rng.normal(size=(12, 1)), offset=-0.2),
        signature("c", rng.normal(size=(12, 3))),
    ]
    first = Screen(z, signatures)
    for screen, read in ((first, z), (first.with_residual(other), other)):
        one = screen.fit((0, 2))
        A = np.hstack([signatures[k].columns for k in (0, 2)])
        expected = 0.3 + A @ np.linalg.lstsq(A, read - 0.3)[0]
        np.testing.assert_allclose(screen.shown(one), expected)
        assert one.rss == pytest.approx(np.sum((read - expected) ** 2))


def test_shapes_count_as_numbers_of_a_set():
    """Though screening holds them: two columns, one of them a shape's of zeros."""
    columns = np.eye(9)[:, :2] * [1.0, 0.0]
    z = np.eye(9)[0] * 5.0
    plain = Screen(z, [signature("a", columns[:, :1])]).fit((0,))
    shaped = Screen(z, [signature("a", columns, shapes=(1,))]).fit((0,))
    assert (plain.rank, shaped.rank) == (1, 2)
    assert plain.score - shaped.score == pytest.approx(np.log(9) / 2)


def test_weights_of_sets_far_from_probable_are_finite():
    """Scores of a thousand sigma squared, either sign."""
    for score in (-1e5, 1e5):
        sets = [Scored((k,), np.zeros(0), 0.0, 0, score - k) for k in range(2)]
        expected = np.array([1.0, np.exp(-1)]) / (1 + np.exp(-1))
        assert posterior(sets) == pytest.approx(expected)


@pytest.mark.parametrize(("size", "names"), [(3.0, ("a",)), (1.0, ("a", FINITE))])
def test_finite_motions_beside_what_explains_more_refine_the_model(size, names):
    """Effect a takes 4 off the squares, finite motions 9 or 1."""
    z = np.array([2.0, 1.5, 0.0])
    less = signature("a", np.eye(3)[:, :1] if size > 1 else 0 * np.eye(3)[:, :1])
    screen = Screen(z, [less, Signature(
        Hypothesis(FINITE, (), ()), np.array([0, 1.5, 0]), np.zeros((3, 0))
    )])  # fmt: skip
    assert named(screen, screen.fit((0, 1))) == tuple(sorted(names))
    assert named(screen, screen.fit((1,))) == (FINITE,)


def test_larger_sets_have_the_best_smaller_ones(rng):
    """Eleven ways of an effect of which the eleventh is best, and another effect.

    The pair is found though neither its way is general nor the first tried.
    """
    columns = np.eye(40)
    ways = [signature("a", columns[:, [k]]) for k in range(11)]
    z = np.zeros(40)
    z[10], z[20], z[30] = 9.0, 8.0, 7.0
    others = [signature(n, columns[:, [k]]) for n, k in (("b", 20), ("c", 30))]
    screen = Screen(z, [*ways, *others])
    sets = screen.search()
    assert sets[0].members == (10, 11, 12)
    for one in sets:  # no effect is there twice
        assert len({screen.effects[i] for i in one.members}) == len(one.members)
    assert all(len(s.members) <= 2 for s in screen.search(2))


class Known:
    """A screen of ten readings whose best set leaves what it is told to."""

    count, effects = 10, ["a", "b"]

    def __init__(self, rss):
        weights = {(): 0.999, (0,): 0.001}
        self.sets = [
            Scored(
                own, np.zeros(0), rss if not own else 0.0, 3 - 3 * len(own), np.log(w)
            )
            for own, w in weights.items()
        ]

    def shown(self, one):
        return np.zeros(10)

    def with_residual(self, residual):
        return self

    def search(self):
        return self.sets


@pytest.mark.parametrize("more", [False, True])
def test_simulated_campaigns_are_judged_by_what_their_best_set_leaves(more):
    """Ten readings less three unknowns: seven degrees of freedom."""
    chance = SIGNIFICANT * (0.9 if more else 1.1)
    screen = Known(float(chi2.isf(chance, 7)))
    tally = calibrate(screen, screen.sets[0], 3, lambda *done: None)
    said = "outside_library" if more else "none_needed"
    assert tally.without == tally.with_found == {said: 3}
    assert tally.false_claims == 0.0
    assert np.isnan(tally.right)


def test_campaigns_are_simulated_with_noise_alone_and_with_what_was_found():
    """In turns, as many of each: the signal in every other one."""
    given = []

    class Told(Known):
        def shown(self, one):
            return np.full(10, 1e3)

        def with_residual(self, residual):
            given.append(residual)
            return self

    screen = Told(0.0)
    calibrate(screen, SimpleNamespace(members=(0,)), 4, lambda *done: None)
    present = [bool(abs(z.mean() - 1e3) < 5) for z in given]
    assert present == [False, True] * 4
    left = np.concatenate([z - 1e3 * on for z, on in zip(given, present, strict=True)])
    assert abs(left.std() - 1) < 0.3
