"""Test the fit of robot parameters with analytical solutions for a bar."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import binom

from forcefit.validation.diagnosis.diagnose import diagnose
from tests.bar_for_tests import (
    BEAM,
    LENGTH,
    LONGER,
    SOFTER,
    TURNED,
    along,
    bar,
    fit_of,
    gives_way,
    machine,
    numbers,
)
from tests.planar_arm_for_tests import SIGMA


@pytest.mark.parametrize("start", [0.0, 1e-19, -1e-3])
def test_fitted_length_equals_the_mean_of_the_readings(start):
    """The standard deviation of the mean is sigma / sqrt(R)."""
    plain = bar(link=BEAM)
    noise = np.random.default_rng(4).normal(size=(8, 6)) * SIGMA
    seen = noise + np.hstack([np.zeros((8, 3)), 3e-4 * along(plain)])
    campaign = bar(link=BEAM, measured=seen)
    fit = machine(campaign, LONGER, start=start)
    ((name, value, std),) = numbers(fit)
    assert name == "tip"
    mean = np.einsum("ri,ri->r", seen[:, 3:], along(plain)).mean()
    assert value == pytest.approx(mean, rel=1e-7)
    assert std == pytest.approx(SIGMA[3] / np.sqrt(8), rel=1e-6)
    left = (seen - fit_of(campaign, value)) / SIGMA
    assert fit.residual @ fit.residual == pytest.approx(np.sum(left**2))


def test_standard_deviation_of_a_stiffness_equals_analytical_value():
    """For readings M / k and M L / k, std(k) is k^2 std(1 / k)."""
    M, k = 30.0, 2e5
    campaign = gives_way(M, k)
    fit = machine(campaign, SOFTER, start=1e-6)
    ((name, value, std),) = numbers(fit)
    assert name == "drive"
    assert value == pytest.approx(k, rel=1e-4)  # tolerance for second-order terms
    J = 8 * ((M / SIGMA[2]) ** 2 + (M * LENGTH / SIGMA[3]) ** 2)
    assert std == pytest.approx(k**2 / np.sqrt(J), rel=1e-3)


def test_standard_deviation_follows_from_derivatives_at_the_fitted_value():
    """The reading L (cos(q + e) - cos q) has the derivative -L sin(q + e).

    The derivatives of the linear model have a relative error of e.
    """
    e, plain = 0.02, bar()
    q = plain.coordinates[:, 0]
    seen = np.full((8, 6), np.nan)
    seen[:, 3] = LENGTH * (np.cos(q + e) - np.cos(q))
    fit = machine(bar(measured=seen), TURNED)
    ((_, value, std),) = numbers(fit)
    slope = LENGTH * np.sin(q + e) / SIGMA[3]
    assert std == pytest.approx(1 / np.linalg.norm(slope), rel=2 * e)
    assert abs(value - e) < 0.05 * std


def test_68_per_cent_of_true_values_are_within_one_std():
    """The test uses 60 random campaigns."""
    rng = np.random.default_rng(8)
    inside = 0
    shape = fit_of(bar(link=BEAM), 2e-5)
    for _ in range(60):
        campaign = bar(link=BEAM, measured=shape + rng.normal(size=(8, 6)) * SIGMA)
        ((_, value, std),) = numbers(machine(campaign, LONGER))
        inside += abs(value - 2e-5) < std
    assert 1e-3 < binom.cdf(inside, 60, 0.6827) < 1 - 1e-3


def deflected(e, noise):
    """Return a campaign of a bar whose compliant drive is deflected by a force F.

    The deflection a satisfies K (a - e) = F L cos(q + a), where e is the encoder
    offset.
    """
    K, F, rows = 2e3, 150.0, len(noise)
    spring = np.diag([np.inf, np.inf, K, np.inf, np.inf, np.inf])
    q = bar(rows=rows).coordinates[:, 0]
    turn = np.array([
        brentq(lambda a, b=b: K * (a - e) - F * LENGTH * np.cos(b + a), -1, 1)
        for b in q
    ])
    seen = noise.copy()
    seen[:, 2] += turn
    seen[:, 3] += LENGTH * (np.cos(q + turn) - np.cos(q))
    seen[:, 4] += LENGTH * (np.sin(q + turn) - np.sin(q))
    return bar([0, 0, 0, 0, F, 0], seen, rows=rows, spring=spring)


def test_fitted_offset_is_exact_for_a_large_deflection():
    e = 4e-3
    fit = machine(deflected(e, np.zeros((8, 6))), TURNED)
    assert fit.x == pytest.approx([e], rel=1e-4)
    assert np.abs(fit.residual).max() < 0.5  # sigma


def test_finite_model_needs_no_geometric_stiffening():
    """For the large rotations in this test, the linear model is not accurate."""
    noise = np.random.default_rng(5).normal(size=(20, 6)) * SIGMA
    campaign = deflected(0.0, noise)
    linear, finite = diagnose(campaign), diagnose(campaign, finite=True)
    assert (linear.verdict, linear.claimed) == ("explained", ("geometric_stiffening",))
    assert finite.verdict == "none_needed"
    assert finite.before.normalised == pytest.approx(1.0, abs=0.4)
    assert linear.before.normalised > 10
