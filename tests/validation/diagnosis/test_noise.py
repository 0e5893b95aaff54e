"""Test the estimated scale of the noise and the detection of outliers."""

import numpy as np
import pytest

from forcefit.validation.diagnosis.gaussian import scale
from forcefit.validation.diagnosis.noise import (
    findings,
    probability_good,
    repeat_scatter,
)


def test_outliers_are_detected():
    rng = np.random.default_rng(0)
    z = rng.normal(size=600)
    z[[5, 77, 300]] += [40.0, -25.0, 12.0]
    good = probability_good(z**2)
    assert set(np.flatnonzero(good < 0.5)) == {5, 77, 300}


def test_pure_noise_has_few_outliers():
    rng = np.random.default_rng(1)
    called = [
        (probability_good(rng.normal(size=600) ** 2) < 0.5).any() for _ in range(300)
    ]
    # About one campaign in 130 contains a reading above the threshold of 4.4 sigma.
    assert np.mean(called) < 0.03


def test_many_large_residuals_are_not_outliers():
    z = np.random.default_rng(2).normal(size=600)
    z[:60] += 30.0
    assert (probability_good(z**2) == 1).all()


@pytest.mark.parametrize("true", [0.5, 1.0, 3.0])
def test_estimated_noise_scale_equals_the_true_scale(true):
    z = true * np.random.default_rng(3).normal(size=2000)
    tau, std = scale(float(z @ z), 2000)
    assert tau == pytest.approx(true, rel=0.05)
    assert abs(tau - true) < 4 * std


def test_repeat_scatter_agrees_with_hand_calculation():
    z = np.array([1.0, 3.0, 10.0, 10.0, 7.0])
    rms, freedom = repeat_scatter(z, np.array([4, 4, 2, 2, 9]))
    assert freedom == 2
    assert rms == pytest.approx(1.0)


@pytest.mark.parametrize(("tau", "repeats", "common", "told"), [
    (1.05, (1.0, 40), (0, 0), []), (3.0, (1.0, 40), (0, 0), ["residual"]),
    (0.4, (0.5, 40), (0, 0), ["residual"]), (1.0, (2.0, 40), (0, 0), ["repeatable"]),
    (1.0, (2.0, 2), (0, 0), []),
    (1.0, (1.0, 40), (1.2e-5, 5e-6), ["the points of a row: 5 um, 12 urad"]),
    (1.0, (1.0, 40), (0.0, 2.54e-5), ["the points of a row: 25.4 um"]),
    (1.0, (0.0, 0), (0.0, 5e-6), ["an unrecorded cause has the same effect"]),
])  # fmt: skip
def test_noise_that_differs_from_sigma_is_reported(tau, repeats, common, told):
    found = findings(tau, 0.03, repeats, memory=False, common=common)
    assert len(found) == len(told)
    assert all(word in one for word, one in zip(told, found, strict=True))
