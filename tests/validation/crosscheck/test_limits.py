"""Tests of limits and slopes of known functions."""

import math

import numpy as np
import pytest

from forcefit.validation.crosscheck.limits import difference_slope, slope_check

SCALES = np.array([1.0, 0.5, 0.25, 0.125])


def test_slope_ignores_differences_below_the_noise_floor():
    scales = [1.0, 0.1, 0.01]
    slope = difference_slope(scales, [1e-3, 1e-5, 1e-6], 1e-5 / 2)
    assert slope == pytest.approx(2.0)
    assert math.isnan(difference_slope(scales, [1e-3, 1e-9, 1e-9], 1e-5))


@pytest.mark.parametrize(("first", "expected"), [(1.0, 1.0), (0.02, 2 - 0.16 / 1.16)])
def test_slope_with_first_and_second_order_equals_closed_form(first, expected):
    """For s^2 + s / 50 at s = 1/8, the second term is 0.16 times the first."""
    second = 1.0 if first < 1 else 0.0
    found = difference_slope(SCALES, second * SCALES**2 + first * SCALES, 0.0)
    assert found == pytest.approx(expected, abs=1e-9)
    assert slope_check(
        SCALES, second * SCALES**2 + first * SCALES, 0.0, 0.1
    ).verdict == ("fails")


def test_slope_check_does_not_fail_because_of_noise():
    """The noise is half of the difference at the smallest scale."""
    rng = np.random.default_rng(1)
    right = 2e-10 * (SCALES[:, None] / SCALES[-1]) ** 2 * [1.0, 0.0, 0.0]
    noisy = right + 1e-10 * rng.choice([-1.0, 1.0], size=(4, 3))
    verdict = slope_check(SCALES, noisy, 1e-10, 0.1).verdict
    assert verdict in {"ok", "no signal"}
    assert slope_check(SCALES, right, 1e-12, 0.1).verdict == "ok"
    wrong = right + 1e-10 * SCALES[:, None] / SCALES[-1]
    assert slope_check(SCALES, wrong, 1e-12, 0.1).verdict == "fails"
