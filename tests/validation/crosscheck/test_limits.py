"""Limits and slopes of known functions."""

import math

import numpy as np
import pytest

from validation.crosscheck.limits import extrapolate, fit_slope


def test_extrapolation_is_exact_for_polynomials():
    """Three points, a parabola: 3 - 2 s + 5 s^2 is 3 at s = 0."""
    s = np.array([1.0, 0.5, 0.25])
    values = np.array([3 - 2 * s + 5 * s**2, s]).T
    np.testing.assert_allclose(extrapolate(s, values), [3, 0], atol=1e-14)


def test_a_slope_ignores_what_is_below_the_floor():
    scales = [1.0, 0.1, 0.01]
    assert fit_slope(scales, [1e-3, 1e-5, 1e-6], 1e-5 / 2) == pytest.approx(2.0)
    assert math.isnan(fit_slope(scales, [1e-3, 1e-9, 1e-9], 1e-5))


def test_a_third_order_term_does_not_spoil_the_slope():
    """d = s^2 + s^3/2: the plain fit says 2.21, the one with a correction 2.02."""
    s = np.array([1.0, 0.5, 0.25, 0.125])
    assert fit_slope(s, s**2 + s**3 / 2, 0.0) == pytest.approx(2.0, abs=0.03)


def test_a_first_order_term_of_two_per_cent_shows_in_the_slope():
    """d = s^2 + s/50, two per cent of a difference that is itself one per cent."""
    s = np.array([1.0, 0.5, 0.25, 0.125])
    assert fit_slope(s, s**2 + s / 50, 0.0) < 2.0 - 0.1
