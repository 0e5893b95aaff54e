"""Point estimates, capability indices and their confidence intervals."""

from math import comb

import numpy as np
import pytest

from forcefit.assembly.statistics.capability import (
    capability,
    capability_text,
    cp_interval,
    cpk_interval,
    cpk_interval_one_sided,
    draws_capability,
    quantile_cp,
    quantile_cpk,
    share_outside,
)
from forcefit.assembly.statistics.estimates import (
    bracketed,
    mean,
    most_probable,
    proportion,
    quantile,
)


def test_mean_and_interval_of_three_numbers_equal_hand_calculation():
    """The numbers 1, 2 and 4 have mean 7/3 and standard deviation sqrt(7/3). The 97.5 %
    quantile of Student's t distribution with two degrees of freedom is 4.302653.
    """
    answer = mean([1.0, 2.0, 4.0])
    assert answer["value"] == pytest.approx(7 / 3, rel=1e-14)
    assert answer["deviation"] == pytest.approx((7 / 3) ** 0.5, rel=1e-14)
    half = 4.302653 * (7 / 9) ** 0.5
    assert answer["upper"] == pytest.approx(7 / 3 + half, rel=1e-6)
    assert answer["lower"] == pytest.approx(7 / 3 - half, rel=1e-6)


@pytest.mark.parametrize("level", [0.9, 0.95])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_quantile_interval_agrees_with_binomial_distribution(share, level):
    """The probability of a quantile beyond either bound is at most (1 - level) / 2."""
    x, count = np.arange(40.0) ** 2, 40
    pmf = [comb(count, k) * share**k * (1 - share) ** (count - k) for k in range(41)]
    at_most = np.cumsum(pmf)
    low = int(np.argmax(at_most >= (1 - level) / 2))
    high = int(np.argmax(at_most >= (1 + level) / 2))
    found = quantile(x[::-1], share, level)
    assert (found["lower"], found["upper"]) == (x[low - 1], x[high])
    assert found["value"] == pytest.approx(np.quantile(x, share))


def test_quantile_of_infinite_values_is_not_interpolated():
    """Between 3 and inf, interpolation is not possible, so inf is returned."""
    x = [1.0, 2.0, 3.0, np.inf, np.inf, np.inf]
    assert quantile(x, 0.5)["value"] == np.inf
    assert quantile(x, 0.3)["value"] == 3.0
    assert quantile(x[:4], 0.5)["value"] == 3.0
    assert quantile([1.0, 2.0, 3.0, 4.0], 0.5)["value"] == 2.5


def test_interval_of_undecided_trials_includes_both_outcomes():
    """Of 20 trials, 12 succeeded, 5 failed and 3 are undecided. The interval includes
    those for 12 and for 15 successes.
    """
    found = bracketed(12, 5, 20, 0.9)
    assert (found["probability"], found["undecided"]) == (0.6, 3)
    assert found["lower"] == pytest.approx(proportion(12, 20, 0.9)["lower"])
    assert found["upper"] == pytest.approx(proportion(15, 20, 0.9)["upper"])
    assert found["upper"] - proportion(12, 20, 0.9)["upper"] > 0.05


def densest(x, positive):
    """Find the mode of a kernel density estimate on a fine grid. The width is 0.9
    min(s, IQR / 1.349) n^(-1/5) according to Silverman.
    """
    low, high = np.quantile(x, [0.25, 0.75])
    width = 0.9 * min(x.std(), (high - low) / 1.349) * len(x) ** -0.2
    grid = np.linspace(0.0 if positive else x.min(), x.max(), 20_001)
    mirrored = np.concatenate([x, -x]) if positive else x
    density = sum(np.exp(-(((grid - one) / width) ** 2) / 2) for one in mirrored)
    return grid[np.argmax(density)], width


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("positive", [False, True])
def test_mode_equals_maximum_of_kernel_density_estimate(positive, seed):
    """The sample of 150 numbers has two peaks, so the mode depends on the width."""
    rng = np.random.default_rng(seed)
    x = np.concatenate([rng.gamma(2.0, 1.0, 90), rng.normal(3.0, 0.7, 60)])
    x = np.abs(x) if positive else x
    mode, width = densest(x, positive)
    assert most_probable(x, positive=positive)["value"] == pytest.approx(
        mode, abs=0.06 * width
    )


@pytest.mark.parametrize(
    ("cpk", "ppm", "tol"),
    [
        (1.0, 2700, 0.5),
        (4 / 3, 63.3, 0.05),
        (1.33, 66.1, 0.05),
        (1.67, 0.544, 5e-4),
        (2.0, 0.00197, 5e-6),
    ],
)
def test_ppm_of_a_centred_process_equals_known_values(cpk, ppm, tol):
    assert share_outside(cpk, cpk) * 1e6 == pytest.approx(ppm, abs=tol)


def test_cpk_interval_of_fifty_values_equals_hand_calculation():
    assert cpk_interval(1.33, 50) == pytest.approx((1.051, 1.609), abs=5e-4)
    assert cpk_interval_one_sided(1.33, 50) == pytest.approx((1.051, 1.607), abs=5e-4)
    assert cp_interval(1.33, 50) == pytest.approx((1.067, 1.592), abs=5e-4)


def test_capability_intervals_have_the_nominal_coverage():
    """For 2000 samples, the standard error of a coverage of 95 % is 0.5 %."""
    rng = np.random.default_rng(1)
    found = [capability(x, -4.0, 4.0) for x in rng.normal(size=(2000, 30))]
    assert np.mean([c.cp[1] <= 4 / 3 <= c.cp[2] for c in found]) > 0.93
    one = [capability(x, -np.inf, 4.0) for x in rng.normal(size=(300, 30))]
    assert np.mean([c.cpk[1] <= 4 / 3 <= c.cpk[2] for c in one]) > 0.91


def test_capability_of_constant_values_is_rejected():
    with pytest.raises(ValueError, match="do not vary"):
        capability([1.0, 1.0], 0.0, 2.0)


def test_ppm_intervals_equal_hand_calculation():
    """For 270 of 1e5 draws, the interval is 2388 to 3041 ppm. For 0 of 1e6 draws, the
    upper bound is 3.7 ppm.
    """
    share = proportion(270, 100_000)
    assert share["lower"] * 1e6 == pytest.approx(2388, abs=1)
    assert share["upper"] * 1e6 == pytest.approx(3041, abs=1)
    assert proportion(0, 10**6)["upper"] * 1e6 == pytest.approx(3.7, abs=0.05)
    assert proportion(0, 10**6, 0.9)["upper"] * 1e6 == pytest.approx(3.0, abs=0.01)


def test_cp_and_cpk_of_a_rayleigh_sample_equal_closed_forms():
    """The quantile of a Rayleigh distribution at p is s sqrt(-2 ln(1 - p))."""
    low, middle, tail = np.sqrt(-2 * np.log(1 - np.array([0.00135, 0.5, 0.99865])))
    x = np.linalg.norm(np.random.default_rng(2).normal(size=(400_000, 2)), axis=1)
    for index, expected in (
        (quantile_cpk, (4 - middle) / (tail - middle)), (quantile_cp, 4 / (tail - low))
    ):  # fmt: skip
        value, lower, upper = index(x, 4.0)
        assert value == pytest.approx(expected, rel=0.01)
        assert lower < expected < upper


def test_cpk_of_few_draws_has_lower_bound_zero():
    assert quantile_cpk(np.arange(100.0), 200.0)[1] == 0.0
    assert quantile_cp(np.arange(100.0), 200.0)[1] == 0.0


def test_capability_text_contains_no_negative_zero():
    x = np.linspace(2.0, 3.0, 100)
    few = {"limit": 1.0, "unit": "m", "probability": 1.0, "lower": 0.96, "upper": 1.0}
    text = capability_text({"size": draws_capability(x, few)})
    assert "-0)" not in text
    assert " to 0)" in text
