"""Test lack of fit and outliers of residuals."""

import numpy as np
import pytest
from scipy.stats import binom, kstest

from forcefit.validation.diagnosis.lack_of_fit import SIGNIFICANT, lack_of_fit, outlying
from forcefit.validation.diagnosis.signatures import whiten
from tests.campaigns_for_tests import campaign_of
from tests.planar_arm_for_tests import SIGMA


def noisy(rng, rows=40, sets=10, size=1.0):
    """Return noise of ``size`` sigmas for repeated configurations."""
    z = size * rng.normal(size=(rows, 6))
    z[rng.random(z.shape) < 0.1] = np.nan
    return campaign_of(z * SIGMA, SIGMA, np.arange(rows) % sets)


def test_p_values_of_noise_are_uniform(rng):
    """The rate of false alarms agrees with the significance level."""
    found = []
    for _ in range(300):
        campaign = noisy(rng)
        found.append(lack_of_fit(campaign, whiten(campaign, campaign.measured), 0))
    for kind in ("probability", "against_repeats"):
        drawn = [getattr(one, kind) for one in found]
        assert kstest(drawn, "uniform").pvalue > 1e-3
        alarms = np.sum(np.array(drawn) < 0.05)
        assert binom.cdf(alarms, 300, 0.05) < 1 - 1e-4
    assert not any(one.significant for one in found)


def test_scatter_of_repeats_agrees_with_hand_calculation():
    """Readings of 1 and 3 have a sum of squares of 2 and one degree of freedom."""
    seen = np.full((3, 6), np.nan)
    seen[:, 4] = [1.0, 3.0, 50.0]
    campaign = campaign_of(seen, repeat=[0, 0, 1])
    found = lack_of_fit(campaign, whiten(campaign, seen), 1)
    assert found.repeats == pytest.approx(np.sqrt(2))
    assert found.repeats_freedom == 1
    assert found.rms == pytest.approx(np.sqrt(2510 / 2))


def test_any_residual_is_lack_of_fit_if_repeats_are_equal():
    """Repeats may be equal because the device rounds its readings."""
    seen = np.full((4, 6), np.nan)
    seen[:, 4] = [1.0, 1.0, 3.0, 3.0]
    campaign = campaign_of(seen, repeat=[0, 0, 1, 1])
    judged = lack_of_fit(campaign, whiten(campaign, seen), 1)
    assert (judged.repeats, judged.repeats_freedom) == (0.0, 2)
    assert judged.against_repeats == 0.0
    assert lack_of_fit(campaign, 0.1 * seen[:, 4], 1).against_repeats == 0.0
    assert lack_of_fit(campaign, np.zeros(4), 1).against_repeats == 1.0


def test_campaign_without_repeats_has_no_repeat_scatter():
    campaign = campaign_of(np.ones((5, 6)), repeat=np.arange(5))
    found = lack_of_fit(campaign, np.ones(30), 3)
    assert np.isnan(found.repeats)
    assert (found.repeats_freedom, found.against_repeats) == (0, 1.0)
    assert not found.sigma_too_small
    assert found.rms == pytest.approx(np.sqrt(30 / 27))
    assert lack_of_fit(campaign, np.ones(30), 40).rms == pytest.approx(np.sqrt(30))


@pytest.mark.parametrize("from_zero", [-40.0, 0.0, 300.0])
def test_same_command_at_another_temperature_is_not_a_repeat(from_zero):
    """Temperatures are equal if they differ by less than 1/30 of their range."""
    seen = np.full((4, 6), np.nan)
    seen[:, 4] = [1.0, 3.0, 50.0, 7.0]
    temperature = from_zero + np.array([0.0, 0.2, 9.0, 10.0])
    campaign = campaign_of(
        seen, repeat=[0, 0, 0, 1], temperature=temperature, time=900.0 * np.arange(4)
    )
    found = lack_of_fit(campaign, whiten(campaign, seen), 0)
    assert (found.repeats_freedom, found.repeats) == (1, pytest.approx(np.sqrt(2)))


def test_large_noise_is_not_lack_of_fit(rng):
    campaign = noisy(rng, 120, 20, size=2.0)
    found = lack_of_fit(campaign, whiten(campaign, campaign.measured), 0)
    assert found.probability < SIGNIFICANT
    assert found.sigma_too_small
    assert found.repeats == pytest.approx(2.0, rel=0.1)
    assert not found.significant


@pytest.mark.parametrize("size", [1.0, 2.0])
def test_deviation_common_to_repeats_is_lack_of_fit(size, rng):
    """The deviation of each configuration is two sigma."""
    campaign = noisy(rng, 120, 20, size)
    shared = 2 * size * rng.normal(size=(20, 6))[campaign.repeat] * SIGMA
    z = whiten(campaign, campaign.measured + shared)
    assert lack_of_fit(campaign, z, 0).significant


def test_large_residuals_are_outliers(rng):
    z = rng.normal(size=(40, 6))
    z[7, 3] += 40
    campaign = campaign_of(z)
    assert np.flatnonzero(outlying(campaign, z[campaign.cells])).tolist() == [7]
    z[[3, 20], 0] += 60
    assert np.flatnonzero(outlying(campaign_of(z), z.ravel())).tolist() == [3, 20]
