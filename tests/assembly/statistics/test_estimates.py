"""Point estimates and their confidence intervals."""

from math import comb

import numpy as np
import pytest

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
