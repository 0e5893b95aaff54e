"""Scores of sets of effects, and verdicts, on made-up signatures."""

from itertools import combinations
from math import comb, log
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import nnls

from assembly.effects.effect import Unknown
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.hypotheses import Hypothesis, Slot
from validation.diagnosis.scoring import FINITE, Scored, Screen, inclusion, posterior
from validation.diagnosis.screens import Projector, score_beside_squares
from validation.diagnosis.signatures import Signature
from validation.diagnosis.verdict import by_names, calibrate, linear_or_finite, verdict


def signature(effect, columns, lower=-np.inf, upper=np.inf, offset=0.0):
    """A made-up signature of columns (N, k)."""
    columns = np.asarray(columns, dtype=float).reshape(len(columns), -1)
    slots = tuple(
        Slot((f"x{k}",), Unknown(f"x{k}", 1.0, lower, upper), 0.0)
        for k in range(columns.shape[1])
    )
    return Signature(
        Hypothesis(effect, (), slots), offset + np.zeros(len(columns)), columns
    )


def test_scores_by_hand():
    """-RSS/2 - k/2 ln n - ln C(m, |S|) - (|S| - 1) ln 10 - ln(ways), n = 4, m = 2."""
    z = np.array([2.0, 0.0, 1.0, 0.0])
    e = np.eye(4)
    screen = Screen(
        z, [signature("a", e[0]), signature("a", e[1]), signature("b", e[[2, 3]].T)]
    )
    assert screen.fit(()).score == pytest.approx(-5 / 2)
    one = screen.fit((0,))
    assert one.values == pytest.approx([2.0])
    assert one.score == pytest.approx(-1 / 2 - log(4) / 2 - log(2) - log(2))
    two = screen.fit((2, 0))
    assert two.members == (0, 2)
    assert two.values == pytest.approx([2.0, 1.0, 0.0])
    assert two.score == pytest.approx(0 - 3 * log(4) / 2 - log(10) - log(2))


def test_an_offset_is_not_scaled():
    """A hypothesis without unknowns adds what it adds."""
    screen = Screen(
        np.array([1.0, 1.0]), [signature("a", np.zeros((2, 0)), offset=0.4)]
    )
    assert screen.fit((0,)).rss == pytest.approx(2 * 0.6**2)


def test_weights_are_exponentials_of_scores():
    made = [
        Scored((k,), np.zeros(0), 0.0, 0, s) for k, s in enumerate([-1, -1 - log(3)])
    ]
    assert posterior(made) == pytest.approx([0.75, 0.25])


def test_unknowns_stay_within_their_bounds(rng):
    """Exactly non-negative least squares where one bound is met; never better.

    Unknowns once held are not let go, so that with several the fit may be worse.
    """
    exact = 0
    for _ in range(200):
        A, z = rng.normal(size=(12, 3)), rng.normal(size=12)
        found = Screen(z, [signature("a", A, lower=0.0)]).fit((0,))
        assert found.values.min() >= 0.0
        best = nnls(A, z)[1] ** 2
        assert found.rss >= best - 1e-9
        assert found.rss == pytest.approx(np.sum((z - A @ found.values) ** 2))
        if np.sum(found.values == 0.0) <= 1:
            assert found.rss == pytest.approx(best, rel=1e-9)
            exact += 1
    assert exact > 50


def made_up_effects(rng, count=9, rows=150):
    return [signature(f"effect {k}", rng.normal(size=(rows, 2))) for k in range(count)]


def test_the_search_finds_the_best_of_all_small_sets(rng):
    """Every set of up to three, by least squares of its own."""
    signatures = made_up_effects(rng, 7, 60)
    z = rng.normal(size=60)
    for k in (1, 4, 6):
        z = z + signatures[k].columns @ [0.6, -0.4]
    scores = {}
    for size in range(4):
        for members in combinations(range(7), size):
            A = np.hstack([
                np.zeros((60, 0)),
                *(signatures[k].columns for k in members),
            ])
            left = z - A @ np.linalg.lstsq(A, z)[0]
            penalty = A.shape[1] / 2 * log(60) + log(comb(7, size))
            penalty += max(size - 1, 0) * log(10)
            scores[members] = -left @ left / 2 - penalty
    best = Screen(z, signatures).search()[0]
    assert best.members == max(scores, key=scores.get)
    assert best.score == pytest.approx(max(scores.values()))


def test_the_hidden_pair_is_found_and_nothing_is_found_in_noise(rng):
    """At 4 sigma in every reading, twenty draws each."""
    found = empty = 0
    for _ in range(20):
        signatures = made_up_effects(rng)
        noise = rng.normal(size=150)
        signal = signatures[2].columns @ [3.0, -2.0] + signatures[7].columns @ [
            2.0,
            3.0,
        ]
        screen = Screen(signal + noise, signatures)
        weight = inclusion(screen, screen.search())
        others = [p for name, p in weight.items() if name[-1] not in "27"]
        found += (
            min(weight["effect 2"], weight["effect 7"]) > 0.999 and max(others) < 0.5
        )
        sets = Screen(noise, signatures).search()
        empty += sets[0].members == () and posterior(sets)[0] > 0.5
    assert found >= 19
    assert empty >= 19


def test_effects_that_do_the_same_share_the_probability(rng):
    signatures = made_up_effects(rng)
    twin = Signature(
        Hypothesis("twin", (), signatures[3].hypothesis.slots),
        signatures[3].offset, 5.0 * signatures[3].columns,
    )  # fmt: skip
    z = signatures[3].columns @ [1.0, 1.0] + rng.normal(size=150)
    screen = Screen(z, [*signatures, twin])
    sets = screen.search()
    weight = inclusion(screen, sets)
    # of sets of three not all are looked at, for one of the two perhaps another one
    assert weight["twin"] == pytest.approx(weight["effect 3"], rel=1e-3)
    assert 0.5 <= weight["twin"] < 0.65  # the pair of both has a little
    together = next(s for s in sets if s.members == (3, 9))
    assert together.rank == 2
    said, claimed = verdict(by_names(screen, sets), weight, False)
    assert (said, claimed) == ("ambiguous", ())


def test_ways_of_an_effect_add_up_and_what_is_unlikely_is_not_listed():
    """Two places where a may act, b, and nothing: of weights 3, 2, 4 and 0.1."""
    screen = Screen(np.zeros(3), [signature(e, np.eye(3)[0]) for e in "aab"])
    weights = {(0,): 3.0, (1,): 2.0, (2,): 4.0, (): 0.1}
    sets = [Scored(m, np.zeros(0), 0.0, 0, log(w)) for m, w in weights.items()]
    (first, p), (second, q) = by_names(screen, sets)
    assert (first, second) == (("a",), ("b",))
    assert (p, q) == pytest.approx((5.0 / 9.1, 4.0 / 9.1))


@pytest.mark.parametrize("gain", [-3.0, 0.0, 8.0, 1e5])
def test_what_second_order_explains_is_shared_by_the_odds_of_finite_motions(gain):
    """exp(gain / 2) to the number of effects, each as likely as finite motions."""
    given = ((), 0.5), (("a",), 0.3), ((FINITE,), 0.2)
    probability = {"a": 0.3, FINITE: 0.2, "b": 0.0, "c": 0.0}
    sets, after = linear_or_finite(given, probability, gain)
    finite = 0.5 / (1 + 4 * np.exp(-gain / 2))
    expected = {(): 0.5 - finite, ("a",): 0.3, (FINITE,): 0.2 + finite}
    listed = {names: p for names, p in expected.items() if p >= 0.02}
    assert dict(sets) == pytest.approx(listed)
    shown = [p for _, p in sets]
    assert shown == sorted(shown, reverse=True)
    assert after == pytest.approx(probability | {FINITE: 0.2 + finite})


def test_finite_motions_that_no_set_had_become_one():
    sets, after = linear_or_finite((((), 1.0),), {}, 2 * log(3.0))
    assert dict(sets) == pytest.approx({(): 0.25, (FINITE,): 0.75})
    assert after == pytest.approx({FINITE: 0.75})


VERDICTS = [
    ([((), 0.6), (("a",), 0.4)], {"a": 0.4}, False, "none_needed", ()),
    ([(("a",), 0.95), ((), 0.05)], {"a": 0.95}, False, "explained", ("a",)),
    ([(("a", "b"), 0.95)], {"a": 0.99, "b": 0.95}, False, "explained", ("a", "b")),
    ([(("a",), 0.6), (("a", "b"), 0.4)], {"a": 1.0, "b": 0.4}, False,
     "explained", ("a",)),
    ([(("a",), 0.45), (("a", "b"), 0.55)], {"a": 1.0, "b": 0.55}, False,
     "ambiguous", ()),
    ([(("a",), 0.85), ((), 0.15)], {"a": 0.85}, False, "ambiguous", ()),
    ([((), 0.4), (("a",), 0.35), (("b",), 0.25)], {"a": 0.35, "b": 0.25}, False,
     "ambiguous", ()),
    ([(("a",), 1.0)], {"a": 1.0}, True, "outside_library", ()),
    # each is sure, the pair of both alone is none of the sets
    ([(("a", "b", "c"), 0.49), (("a", "b", "d"), 0.46)],
     {"a": 0.95, "b": 0.95, "c": 0.49, "d": 0.46}, False, "ambiguous", ()),
]  # fmt: skip


@pytest.mark.parametrize("case", VERDICTS)
def test_verdicts_follow_the_rules(case):
    *given, said, claimed = case
    assert verdict(tuple(given[0]), *given[1:]) == (said, claimed)


def test_a_calibration_counts_what_it_simulates(rng):
    """A pair at 4 sigma is always found, and noise is left alone."""
    signatures = made_up_effects(rng)
    signal = signatures[2].columns @ [3.0, -2.0] + signatures[7].columns @ [2.0, 3.0]
    screen = Screen(signal + rng.normal(size=150), signatures)
    told = []
    tally = calibrate(screen, screen.fit((2, 7)), 10, lambda *done: told.append(done))
    assert told == [(k + 1, 20) for k in range(20)]
    assert tally.campaigns == sum(tally.without.values()) == 10
    assert tally.with_found == {"explained": 10}
    assert tally.right == 1.0
    assert tally.without["none_needed"] >= 9
    assert tally.false_claims <= 1 / 20


def test_every_claim_of_a_calibration_is_right_or_false(rng):
    """An effect so faint that it is seen about every other time."""
    signatures = made_up_effects(rng)
    signal = signatures[2].columns @ [0.3, 0.25]
    screen = Screen(signal + rng.normal(size=150), signatures)
    tally = calibrate(screen, screen.fit((2,)), 20, lambda *done: None)
    claims = tally.with_found["explained"] + tally.without.get("explained", 0)
    assert tally.right * 20 + tally.false_claims * 40 == pytest.approx(claims)
    assert 0.0 < tally.right < 1.0


def test_a_calibration_without_effects_has_none_to_be_right_about(rng):
    screen = Screen(rng.normal(size=150), made_up_effects(rng))
    tally = calibrate(screen, screen.fit(()), 5, lambda *done: None)
    assert np.isnan(tally.right)
    assert tally.with_found.keys() <= {"none_needed", "ambiguous", "explained"}


def test_a_screen_for_another_residual_is_that_made_of_it(rng):
    one, other = rng.normal(size=(2, 12))
    signatures = made_up_effects(rng, 4, 12)
    again = Screen(one, signatures).with_residual(other)
    fresh = Screen(other, signatures)
    for members in [(), (0,), (1, 3), (0, 2, 3)]:
        a, b = again.fit(members), fresh.fit(members)
        np.testing.assert_allclose(a.values, b.values)
        assert (a.rss, a.rank, a.score) == pytest.approx((b.rss, b.rank, b.score))


def test_columns_that_say_the_same_count_once_and_share_the_fit():
    """Two equal columns and a third: least norm, rank two."""
    a, b = np.eye(3)[0], np.eye(3)[1]
    screen = Screen(np.array([2.0, 1.0, 0.5]), [signature("s", np.array([a, a, b]).T)])
    one = screen.fit((0,))
    assert one.rank == 2
    np.testing.assert_allclose(one.values, [1.0, 1.0, 1.0])
    assert one.rss == pytest.approx(0.25)
    # 1e-3 apart they are two
    apart = signature("s", np.array([a, a + 1e-3 * np.eye(3)[2], b]).T)
    assert Screen(np.array([2.0, 1.0, 0.5]), [apart]).fit((0,)).rank == 3


def test_a_claim_of_one_effect_where_two_are_hidden_is_false(rng):
    """The second is so faint that mostly the first alone is claimed."""
    signatures = made_up_effects(rng)
    signal = signatures[2].columns @ [3.0, -2.0] + signatures[7].columns @ [0.2, 0.2]
    screen = Screen(signal, signatures)
    tally = calibrate(screen, screen.fit((2, 7)), 20, lambda *done: None)
    false = tally.false_claims * 40
    claims = tally.with_found["explained"] + tally.without.get("explained", 0)
    assert 10 < false <= claims <= 40
    assert tally.right * 20 + false == pytest.approx(claims)


@pytest.mark.parametrize("units", [1.0, 1e-9, 1e9])
def test_what_nuisances_can_do_is_taken_out_and_nothing_else(units, rng):
    """Least squares by another routine; equal columns and zeros are no more."""
    A = rng.normal(size=(30, 3))
    nuisances = [
        signature("a", A * [1.0, units, 1.0]),
        signature("b", np.zeros((30, 1))),
    ]
    project = Projector([*nuisances, signature("c", A[:, [1]])])
    X = rng.normal(size=(30, 4))
    expected = X - A @ np.linalg.lstsq(A, X)[0]
    assert project(X) == pytest.approx(expected, abs=1e-12)
    assert Projector([])(X) is X


def test_a_score_beside_its_squares_knows_no_residual(rng):
    signatures = made_up_effects(rng, 3, 60)
    first, other = (Screen(z, signatures).fit((0, 2)) for z in rng.normal(size=(2, 60)))
    assert first.rss != pytest.approx(other.rss)
    assert score_beside_squares(first) == pytest.approx(score_beside_squares(other))


def test_signatures_that_are_nothing_or_the_same_add_no_rank():
    """Of columns e, e, 0 the least answer shares what one would take."""
    e = np.eye(4)
    screen = Screen(np.array([2.0, 0, 0, 0]), [
        signature("a", np.column_stack([e[0], e[0], 0 * e[0]])),
        signature("b", 0 * e[0]),
    ])  # fmt: skip
    one = screen.fit((0,))
    assert one.values == pytest.approx([1.0, 1.0, 0.0])
    assert (one.rank, one.rss) == (1, pytest.approx(0.0, abs=1e-12))
    nothing = screen.fit((1,))
    assert (nothing.rank, nothing.rss) == (0, pytest.approx(4.0))


def test_an_unknown_that_leaves_its_bound_is_held_there(rng):
    """The others then are least squares of what it leaves."""
    A, z = rng.normal(size=(20, 3)), rng.normal(size=20)
    free = np.linalg.lstsq(A, z)[0]
    low = np.where(np.arange(3) == 1, free + 0.5, -np.inf)
    made = Signature(Hypothesis("a", (), tuple(
        Slot((f"x{k}",), Unknown(f"x{k}", 1.0, low[k], np.inf), 0.0) for k in range(3)
    )), np.zeros(20), A)  # fmt: skip
    found = Screen(z, [made]).fit((0,))
    rest = np.linalg.lstsq(A[:, [0, 2]], z - A[:, 1] * low[1])[0]
    assert found.values == pytest.approx([rest[0], low[1], rest[1]])
    assert found.rank == 3


@pytest.mark.parametrize(
    ("said", "learned", "remarks", "foretells"),
    [
        ("explained", (), (), True), ("learned", (1,), ("odd",), True),
        ("outside_library", (1,), (), True), ("outside_library", (1,), ("odd",), False),
        ("outside_library", (), (), False), ("ambiguous", (), (), False),
    ],
)  # fmt: skip
def test_a_model_foretells_if_it_is_claimed_or_learned_and_sound(
    said, learned, remarks, foretells
):
    one = SimpleNamespace(
        verdict=said, remarks=remarks, model=SimpleNamespace(learned=learned)
    )
    assert Diagnosis.foretells.fget(one) is foretells


def test_sets_without_a_listed_none_keep_their_weights():
    """The best of very many sets may itself be too unlikely to be listed."""
    sets = ((("a",), 0.6), (("b",), 0.4))
    assert linear_or_finite(sets, {"a": 0.6, "b": 0.4}, 50.0)[0] == sets
