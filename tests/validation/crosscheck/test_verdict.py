"""Tests of the addition of scales until the verdict is decided."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from forcefit.validation.crosscheck.limits import (
    difference_slope,
    limit_difference,
    slope_check,
)
from forcefit.validation.crosscheck.verdict import Check, compare_scales, verdict


@dataclass
class Scale:
    """Pair of solutions at a scale, represented by two numbers."""

    scale: float
    ours: float
    theirs: float


@dataclass
class Found:
    """Comparison of the two numbers, with a limit and a slope."""

    pairs: tuple
    asked: int
    checks: dict = field(init=False)

    def __post_init__(self):
        s = np.array([p.scale for p in self.pairs])
        ours = np.array([p.ours for p in self.pairs])
        theirs = np.array([p.theirs for p in self.pairs])
        self.checks = {
            "limit": limit_difference(s, ours, theirs, 1, 1e-12),
            "slope": slope_check(s, theirs - ours, 1e-12, 0.1),
        }


def compared(scales, wrong, second=0.05, third=0.03):
    """Compare s with (1 + wrong) s + second s^2 + third s^3."""

    def solve(s):
        return Scale(s, s, (1 + wrong) * s + second * s**2 + third * s**3)

    return compare_scales(scales, solve, Found)


def test_correct_model_passes_if_only_two_scales_are_requested():
    """With two scales, slope and limit would not pass."""
    s = np.array([1.0, 0.5])
    assert abs(difference_slope(s, 0.05 * s**2 + 0.03 * s**3, 0) - 2) > 0.1
    comparison = compared((1.0, 0.5), wrong=0.0)
    assert verdict(comparison) == "passed"
    assert comparison.asked == 2
    assert [p.scale for p in comparison.pairs] == [1, 0.5, 0.25, 0.125][
        : len(comparison.pairs)
    ]
    assert len(comparison.pairs) > 2


@pytest.mark.parametrize("wrong", [0.003, -0.003, 0.02, -0.05])
@pytest.mark.parametrize("scales", [(1.0, 0.5), (1.0, 0.7), (2.0, 1.0, 0.5)])
def test_error_of_three_thousandths_is_detected(wrong, scales):
    """With two scales, the uncertainty of the limit is 0.05."""
    assert verdict(compared(scales, wrong)) == "failed"


def test_error_cancelled_by_a_second_order_term_is_detected():
    """At s = 0.5, the terms of -0.025 s + 0.05 s^2 cancel."""
    assert verdict(compared((1.0, 0.5), wrong=-0.025, third=0.0)) == "failed"


def test_no_scale_is_added_if_every_check_is_decided():
    comparison = compared((1.0, 0.5, 0.25, 0.125), wrong=0.0)
    assert len(comparison.pairs) == 4
    assert verdict(comparison) == "passed"


def test_undecided_check_is_reported_after_six_scales():
    """The uncertainty of this check exceeds its bound at all scales."""

    class Vague(Found):
        def __post_init__(self):
            self.checks = {"vague": Check(0.5, 1.0, 2.0)}

    comparison = compare_scales((1.0, 0.5), lambda s: Scale(s, s, s), Vague)
    assert len(comparison.pairs) == 6
    assert verdict(comparison) == "not decided"


@pytest.mark.parametrize(("theirs", "limit", "expected"), [
    (lambda s: 1e-14, "no signal", "no signal"), (lambda s: 1e-6 * s, "fails", "failed")
])  # fmt: skip
def test_difference_from_zero_fails_above_the_noise(theirs, limit, expected):
    """The virtual-joint model has the value 0."""
    scales = (1.0, 0.5, 0.25, 0.125)
    comparison = compare_scales(scales, lambda s: Scale(s, 0.0, theirs(s)), Found)
    assert comparison.checks["limit"].verdict == limit
    assert verdict(comparison) == expected
    assert len(comparison.pairs) == 4


@pytest.mark.parametrize(("check", "expected"), [
    (Check(0.5, 1.0), "ok"),
    (Check(1.5, 1.0), "fails"),
    (Check(1.5, 1.0, 0.4), "fails"),
    (Check(1.5, 1.0, 0.6), "undecided"),
    (Check(0.5, 1.0, 2.0), "undecided"),
    (Check(0.5, 1.0, 1.0), "ok"),
    (Check(0.5, 1.0, signal=False), "no signal"),
    (Check(np.nan, 1.0, signal=False), "no signal"),
    (Check(1.5, 1.0, signal=False), "fails"),
    (Check(0.5, 1.0, 2.0, signal=False), "undecided"),
])  # fmt: skip
def test_verdict_of_a_check_includes_its_uncertainty(check, expected):
    assert check.verdict == expected
