"""ISO 286 fits: tabulated limits and the distribution of the clearance."""

import numpy as np
import pytest

from forcefit.assembly.callouts.fits import (
    clearance_fit,
    limits_of,
    parse_fit,
    parse_hole,
)
from forcefit.inputs.table import BadInput


@pytest.mark.parametrize(("text", "hole", "shaft", "clearance", "kind"), [
    ("12 H7/g6", (0, 18), (-17, -6), (6, 35), "clearance"),
    ("12 H7/h6", (0, 18), (-11, 0), (0, 29), "clearance"),
    ("30 H7/f7", (0, 21), (-41, -20), (20, 62), "clearance"),
    ("8 H8/h7", (0, 22), (-15, 0), (0, 37), "clearance"),
    ("20 H7/k6", (0, 21), (2, 15), (-15, 19), "transition"),
    ("25 H7/p6", (0, 21), (22, 35), (-35, -1), "interference"),
])  # fmt: skip
def test_limits_of_fits_equal_table_values(text, hole, shaft, clearance, kind):
    fit = parse_fit(text)
    um = 1e6
    assert np.multiply(fit.hole, um) == pytest.approx(hole)
    assert np.multiply(fit.shaft, um) == pytest.approx(shaft)
    assert np.multiply(fit.diametral, um) == pytest.approx(clearance)
    assert fit.kind == kind


@pytest.mark.parametrize(
    ("size", "name", "lower", "upper"),
    [
        # limits [um] of holes and shafts from a handbook of machine elements
        (20, ("G", 7), 7, 28), (20, ("F", 8), 20, 53), (50, ("K", 7), -18, 7),
        (25, ("N", 7), -28, -7), (10, ("M", 7), -15, 0), (40, ("P", 7), -42, -17),
        (10, ("JS", 7), -7.5, 7.5), (12, ("K", 8), -19, 8), (300, ("M", 6), -41, -9),
        (2, ("N", 7), -14, -4), (18, ("k", 8), 0, 27), (31, ("h", 11), -160, 0),
    ],
)  # fmt: skip
def test_limits_of_holes_and_shafts_equal_table_values(size, name, lower, upper):
    limits = limits_of(size, *name)
    assert np.multiply(limits, 1e6) == pytest.approx((lower, upper))


def test_tolerance_of_grade_7_agrees_with_formula_of_the_standard():
    """The tolerance is IT7 = 16 i with i = 0.45 D^(1/3) + 0.001 D.

    D is the geometric mean of the limits of the size range.  The tolerances in the
    standard are rounded.
    """
    for low, high in [(6, 10), (18, 30), (50, 80), (120, 180), (250, 315)]:
        D = (low * high) ** 0.5
        unit = 0.45 * D ** (1 / 3) + 0.001 * D
        width = np.ptp(limits_of(high, "H", 7)) * 1e6
        assert width == pytest.approx(16 * unit, rel=0.05)


def test_standard_deviation_of_clearance_equals_hand_calculation():
    """The standard deviation is sqrt(18^2/12 + 11^2/12) = 6.09 um for uniform sizes.

    For normally distributed sizes with Cp = 1, it is sqrt(18^2 + 11^2) / 6 = 3.52 um.
    """
    fit = parse_fit("12 H7/g6")
    numbers = np.random.default_rng(1).random((400_000, 2))
    tails = (0.00135, 0.5, 0.99865)
    cases = [("uniform", 6.09, (3.4, 10.2, 17.1)), ("normal", 3.52, (5.0, 10.2, 15.5))]
    for distribution, sigma, quantiles in cases:
        radial = fit.draw(numbers, distribution) * 1e6
        assert 2 * radial.mean() == pytest.approx(20.5, abs=0.04)
        assert 2 * radial.std() == pytest.approx(sigma, abs=0.02)
        assert np.quantile(radial, tails) == pytest.approx(quantiles, abs=0.07)


def test_transition_fit_has_interference_in_31_percent_of_draws():
    fit = clearance_fit("20 H7/k6")
    numbers = np.random.default_rng(1).random((400_000, 2))
    assert np.mean(fit.draw(numbers, "normal") == 0.0) == pytest.approx(0.31, abs=0.005)


def test_virtual_size_of_a_hole_equals_hand_calculation():
    """The virtual size is 12 mm minus the position tolerance of 0.05 mm (M)."""
    size, limits = parse_hole("12 H7")
    assert np.ptp(limits) == pytest.approx(18e-6)
    assert size + limits.lower - 0.05e-3 == pytest.approx(11.95e-3)


# rows of ISO 286-1 [um]: tolerances IT5 to IT11, and deviations of d e f g k m n p
TABLE = """
0-3 4 6 10 14 25 40 60 -20 -14 -6 -2 0 2 4 6
3-6 5 8 12 18 30 48 75 -30 -20 -10 -4 1 4 8 12
6-10 6 9 15 22 36 58 90 -40 -25 -13 -5 1 6 10 15
10-18 8 11 18 27 43 70 110 -50 -32 -16 -6 1 7 12 18
18-30 9 13 21 33 52 84 130 -65 -40 -20 -7 2 8 15 22
30-50 11 16 25 39 62 100 160 -80 -50 -25 -9 2 9 17 26
50-80 13 19 30 46 74 120 190 -100 -60 -30 -10 2 11 20 32
80-120 15 22 35 54 87 140 220 -120 -72 -36 -12 3 13 23 37
120-180 18 25 40 63 100 160 250 -145 -85 -43 -14 3 15 27 43
180-250 20 29 46 72 115 185 290 -170 -100 -50 -15 4 17 31 50
250-315 23 32 52 81 130 210 320 -190 -110 -56 -17 4 20 34 56
315-400 25 36 57 89 140 230 360 -210 -125 -62 -18 4 21 37 62
400-500 27 40 63 97 155 250 400 -230 -135 -68 -20 5 23 40 68
"""


@pytest.mark.parametrize("row", TABLE.split("\n")[1:-1])
def test_tolerances_and_deviations_equal_values_of_the_standard(row):
    step, *values = row.split()
    size, values = float(step.split("-")[1]), [float(value) for value in values]
    for grade, width in zip(range(5, 12), values[:7], strict=True):
        assert np.ptp(limits_of(size, "H", grade)) * 1e6 == pytest.approx(width)
    for letter, deviation in zip("defgkmnp", values[7:], strict=True):
        limits = limits_of(size, letter, 6)
        found = limits.upper if letter in "defg" else limits.lower
        assert found * 1e6 == pytest.approx(deviation)


@pytest.mark.parametrize(("text", "message"), [
    ("12 H7/z6", '"z6", expected one of the letters'),
    ("12 H7-g6", 'found "12 H7-g6", expected a fit such as "12 H7/g6"'),
    ("12 h7/G6", "capital letters denote holes"),
    ("12 H4/g6", '"H4", expected a grade from 5 to 11'),
    ("600 H7/g6", "a nominal size of 600 mm, expected over 0 and up to 500"),
    ("0 H7/g6", "a nominal size of 0 mm"),
    ("12 K10/h6", '"K10", expected K with a grade from 6 to 8'),
    ("25 H7/p6", "an interference fit (-35 to -1 um)"),
    ("1 HJ7/g6", '"HJ7"'),
])  # fmt: skip
def test_invalid_fit_is_rejected(text, message):
    with pytest.raises(BadInput) as error:
        clearance_fit(text)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
