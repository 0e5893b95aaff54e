"""Ranks by intervals, and names of errors that intervals do not distinguish."""

from forcefit.assembly.statistics.ranking import (
    kind_of,
    leaders,
    named_together,
    possible_ranks,
    rank_text,
    shares_sentence,
)


def shares(**intervals):
    return {name: ((a + b) / 2, a, b) for name, (a, b) in intervals.items()}


def test_overlapping_intervals_share_ranks():
    """a and b overlap, b and c overlap, a and c do not; d is certainly last."""
    ranks = possible_ranks(
        shares(a=(0.5, 0.7), b=(0.4, 0.6), c=(0.3, 0.45), d=(0.0, 0.1))
    )
    assert ranks == {"a": (1, 2), "b": (1, 3), "c": (2, 3), "d": (4, 4)}
    assert leaders(ranks) == ["a", "b"]
    assert [rank_text(ranks[k]) for k in "abd"] == ["1-2", "1-3", "4"]


def test_shares_that_could_not_be_computed_have_no_rank():
    nan = float("nan")
    ranks = possible_ranks(shares(a=(0.5, 0.7)) | {"b": (nan, nan, nan)})
    assert ranks == {"a": (1, 1)}
    assert rank_text(ranks.get("b")) == ""
    assert possible_ranks({}) == {}


def test_legs_with_equal_shares_are_reported_as_all_legs():
    every = [f"leg{i}.hinge.{c}" for i in (1, 2, 3) for c in ("RX", "RY")]
    some = ["leg3.hinge.RX", "leg1.hinge.RX", "leg2.hinge.RX"]
    assert named_together(some, every) == ["hinge.RX of all legs"]
    # one leg is surely not among them: the two others by their names
    assert named_together(some[:2], every) == some[:2]
    assert named_together(["leg1.hinge.RY", *some], every) == [
        "leg1.hinge.RY",
        "hinge.RX of all legs",
    ]


def test_error_of_a_robot_without_legs_is_reported_by_its_name():
    assert named_together(["tip.RX"], ["tip.RX", "tip.RY"]) == ["tip.RX"]
    assert kind_of("tip.RX") == "tip.RX"
    assert kind_of("leg1.upper.pin.TZ") == "upper.pin.TZ"
    assert kind_of("leg1.hinge") == "hinge"


def test_sentence_states_no_share_beyond_the_whole_variance():
    few = [("bore", (0.78, 0.3, 1.63)), ("pin", (0.01, -0.02, 0.02))]
    assert shares_sentence(few, "translation") == (
        "bore: 78 % of the variance of the translation (30 to 100 %); "
        "pin: 1 % (0 to 2 %)"
    )
