"""Confidence intervals and modes against closed forms and their own promise."""

import numpy as np
import pytest
from scipy import stats

from assembly.statistics.estimates import (
    _modes,
    mean,
    most_probable,
    proportion,
    quantile,
)


def test_no_success_in_n_draws_has_the_known_upper_bound():
    """1 - (alpha / 2)^(1/n), Clopper and Pearson (1934)."""
    found = proportion(0, 300)
    assert found["probability"] == found["lower"] == 0.0
    assert found["upper"] == pytest.approx(1 - 0.025 ** (1 / 300), rel=1e-12)


@pytest.mark.parametrize("p", [0.02, 0.5, 0.97])
def test_intervals_of_probabilities_hold_as_often_as_they_say(p, rng):
    """Exactly: the binomial probability of all outcomes whose interval holds p."""
    outcomes = np.arange(101)
    found = [proportion(int(k), 100) for k in outcomes]
    holds = np.array([f["lower"] <= p <= f["upper"] for f in found])
    assert stats.binom.pmf(outcomes, 100, p)[holds].sum() >= 0.95


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_intervals_of_quantiles_hold_as_often_as_they_say(share, rng):
    """1000 samples of an exponential law; 0.935 is 0.95 less two deviations."""
    truth = -np.log(1 - share)
    found = [quantile(x, share) for x in rng.exponential(size=(1000, 300))]
    held = np.mean([f["lower"] <= truth <= f["upper"] for f in found])
    assert 0.935 <= held <= 0.99


def test_a_sample_too_small_for_a_quantile_says_so():
    found = quantile(np.arange(10.0), 0.99)
    assert found["upper"] == np.inf
    assert np.isfinite(found["lower"])


def test_the_mean_of_three_numbers_by_hand():
    """1, 2, 4: 7/3, deviation sqrt(7/3), Student's t of two degrees 4.302653."""
    answer = mean([1.0, 2.0, 4.0])
    assert answer["value"] == pytest.approx(7 / 3, rel=1e-14)
    assert answer["deviation"] == pytest.approx((7 / 3) ** 0.5, rel=1e-14)
    half = 4.302653 * (7 / 9) ** 0.5
    assert answer["upper"] == pytest.approx(7 / 3 + half, rel=1e-6)
    assert answer["lower"] == pytest.approx(7 / 3 - half, rel=1e-6)


def test_intervals_of_means_hold_as_often_as_they_say(rng):
    found = [mean(x) for x in rng.normal(3.0, 2.0, size=(1000, 50))]
    held = np.mean([f["lower"] <= 3.0 <= f["upper"] for f in found])
    assert 0.93 <= held <= 0.97


@pytest.mark.parametrize(
    ("law", "mode", "positive"),
    [(stats.gamma(3), 2.0, True), (stats.norm(-1, 0.5), -1.0, False),
     (stats.maxwell(), np.sqrt(2), True)],
)  # fmt: skip
def test_the_most_probable_value_is_the_mode(law, mode, positive, rng):
    """A kernel's mode is off by about n^(-2/7) widths: 0.04 of them at 1e5 draws."""
    x = law.rvs(100_000, random_state=rng)
    found = most_probable(x, positive=positive)
    assert found["value"] == pytest.approx(mode, abs=0.15 * law.std())
    assert found["lower"] <= found["value"] <= found["upper"]


def test_sizes_that_crowd_at_zero_have_their_mode_there(rng):
    x = np.abs(rng.normal(size=50_000))
    assert most_probable(x, positive=True)["value"] < 0.15


@pytest.mark.parametrize("place", [0, 1, 2, 500, 1021, 1022, 1023])
def test_a_single_peak_is_the_mode_wherever_it_is(place):
    """The kernel is reflected at both ends, where a peak of one bin stays largest."""
    counts = np.zeros((1, 1024))
    counts[0, place] = 7
    assert _modes(counts, 0.4)[0] == pytest.approx(place, abs=0.01)


@pytest.mark.parametrize("values", [[3.0, 3.0], [0.0, 0.0, 0.0], [-2.0] * 5])
def test_equal_numbers_are_their_own_mode(values):
    assert set(most_probable(values).values()) == {values[0]}


def test_a_mode_scales_and_shifts_with_its_sample(rng):
    x = rng.gamma(3.0, size=400)
    one, other = most_probable(x), most_probable(5.0 - 1e-9 * x)
    assert other["value"] == pytest.approx(5.0 - 1e-9 * one["value"], abs=1e-11)
    big = most_probable(1e6 * x, positive=True)
    small = most_probable(x, positive=True)
    for name in ("value", "lower", "upper"):
        assert big[name] == pytest.approx(1e6 * small[name], rel=1e-9)


def test_a_far_tail_does_not_move_a_mode(rng):
    x = rng.normal(size=1000)
    far = np.concatenate([x, [1e4]])
    assert most_probable(far)["value"] == pytest.approx(
        most_probable(x)["value"], abs=0.1
    )


def test_the_interval_of_a_quantile_begins_at_a_number_of_the_sample():
    """Of ten, P(none below the median) = 2^-10: from the second to the ninth."""
    found = quantile(np.arange(10.0), 0.5, 0.95)
    assert (found["lower"], found["upper"]) == (1.0, 8.0)
    found = quantile(np.arange(6.0), 0.5, 0.95)  # 2^-6 = 0.016: the first, the last
    assert (found["lower"], found["upper"]) == (0.0, 5.0)
    assert quantile(np.arange(5.0), 0.5, 0.95)["lower"] == -np.inf
