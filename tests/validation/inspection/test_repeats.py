"""Test the noise that is estimated from repeats."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from forcefit.validation.inspection.measuring_order import revisits
from forcefit.validation.inspection.repeats import (
    for_each_component,
    repeat_noise,
    slow_changes,
)
from tests.campaigns_for_tests import campaign_of

SIGMA = np.array([1e-5] * 3 + [5e-6] * 3)


def interleaved(rng, rows=120, kinds=40):
    """Return the kind (rows,) of each row, in random order within each pass."""
    passes = -(-rows // kinds)
    return np.concatenate([rng.permutation(kinds) for _ in range(passes)])[:rows]


def test_noise_estimate_equals_pooled_standard_deviation():
    """The sets (1, 3) and (2, 2, 5) have sums of squares 2 and 6."""
    measured = np.full((6, 6), np.nan)
    measured[:, 3] = [1, 3, 2, 2, 5, 100]
    noise = repeat_noise(campaign_of(measured, 2.0, [0, 0, 1, 1, 1, 2]), {})
    assert noise.degrees == 3
    assert noise.ratio == pytest.approx(np.sqrt(8 / 3) / 2)
    assert noise.plain == noise.ratio
    assert noise.component[3] == pytest.approx(np.sqrt(8 / 3))
    assert np.isnan(noise.component[[0, 1, 2, 4, 5]]).all()
    low, high = np.sqrt(8 / chi2.ppf([0.95, 0.05], 3))
    np.testing.assert_allclose(noise.component_interval[3], [low, high])


def test_missing_reading_reduces_degrees_of_freedom():
    """If tx is missing in one of two rows, five components have repeats."""
    measured = np.zeros((2, 6))
    measured[1] = 2.0
    measured[0, 3] = np.nan
    noise = repeat_noise(campaign_of(measured, 1.0, [0, 0]), {})
    assert noise.degrees == 5
    np.testing.assert_array_equal(noise.component_degrees, [1, 1, 1, 0, 1, 1])
    assert noise.ratio == pytest.approx(np.sqrt(2))


def test_noise_estimate_is_none_without_repeats():
    assert repeat_noise(campaign_of(np.zeros((5, 6)))) is None
    measured = np.full((2, 6), np.nan)
    measured[0, 0] = measured[1, 1] = 1.0
    assert repeat_noise(campaign_of(measured, 1.0, [0, 0])) is None


def test_noise_estimate_equals_that_of_a_joint_fit(rng):
    """The reference is a least-squares fit with an unknown mean of each set."""
    repeat = interleaved(rng, 40, 15)
    measured = rng.normal(size=(40, 6))
    measured[rng.random((40, 6)) < 0.2] = np.nan
    measured[np.isnan(measured).all(axis=1), 0] = 0.0
    campaign = campaign_of(measured, 1.0, repeat)
    shapes = rng.normal(size=(40, 2))
    columns = for_each_component(campaign, shapes)
    row, component = np.nonzero(np.isfinite(measured))
    sets = (repeat[row] * 6 + component)[:, None] == np.arange(90)
    apart = [shapes[row, k] * (component == c) for k in range(2) for c in range(6)]
    design = np.column_stack([sets, *apart])
    y = measured[row, component]
    x, _, rank, _ = np.linalg.lstsq(design, y, rcond=None)
    found = repeat_noise(campaign, {"both": columns})
    assert found.suspects == ()
    assert found.degrees == len(y) - rank
    rss = np.sum((y - design @ x) ** 2)
    assert found.ratio == pytest.approx(np.sqrt(rss / (len(y) - rank)), rel=1e-10)
    assert found.component_degrees.sum() == pytest.approx(found.degrees)


def test_noise_estimate_does_not_include_drift(rng):
    """The drift is 20 sigma, and the thermal effect is 5 sigma per kelvin."""
    time = np.arange(120.0)
    temperature = 3 * np.sin(time / 17)
    drift = np.outer(1 - np.exp(-time / 25), [20, -20, 0, 10, 5, -10])
    drift += np.outer(temperature, [0, 5, 0, 0, -5, 5])
    for truth in (1.0, 1.7):
        readings = (drift + truth * rng.normal(size=(120, 6))) * SIGMA
        campaign = campaign_of(readings, SIGMA, interleaved(rng), time=time,
                               temperature=temperature)  # fmt: skip
        noise = repeat_noise(campaign)
        assert noise.plain > 3 * truth
        assert noise.interval[0] < truth < noise.interval[1]
        assert noise.taken_out["time"] < 1e-6
        assert noise.taken_out["temperature"] < 1e-6


def test_90_per_cent_of_intervals_include_the_true_noise(rng):
    """The tolerances are three standard deviations for 400 campaigns."""
    inside = suspected = 0
    time = np.arange(60.0)
    for _ in range(400):
        readings = (rng.normal(size=(60, 6)) + time[:, None] / 10) * SIGMA
        campaign = campaign_of(readings, SIGMA, interleaved(rng, 60, 25), time=time)
        noise = repeat_noise(campaign)
        inside += noise.interval[0] < 1 < noise.interval[1]
        suspected += bool(noise.suspects)
    assert 0.855 <= inside / 400 <= 0.945
    assert suspected / 400 <= 0.025


def test_false_alarm_rate_of_time_equals_significance_level(rng):
    """The tolerance is three standard deviations for 300 campaigns."""
    time = np.arange(60.0)
    below = 0
    for _ in range(300):
        readings = rng.normal(size=(60, 6)) * SIGMA
        campaign = campaign_of(readings, SIGMA, interleaved(rng, 60, 25), time=time)
        below += repeat_noise(campaign).taken_out["time"] < 0.05
    assert 0.012 <= below / 300 <= 0.088


def test_outliers_among_repeats_are_reported_and_excluded(rng):
    """In a set of two rows, either row may be wrong."""
    repeat = np.r_[np.repeat(np.arange(30), 3), [30, 30]]
    readings = rng.normal(size=(92, 6)) * SIGMA
    readings[4, 5] += 12 * SIGMA[5]
    readings[91, 1] -= 14 * SIGMA[1]
    noise = repeat_noise(campaign_of(readings, SIGMA, repeat))
    found = {s.component: s.rows for s in noise.suspects}
    assert found == {"tz": (4,), "ry": (90, 91)}
    assert noise.interval[0] < 1 < noise.interval[1]


def test_slow_changes_are_not_fitted_to_few_repeats(rng):
    """Three pairs have 18 degrees of freedom, but slow changes have 24 unknowns."""
    readings = rng.normal(size=(20, 6)) * SIGMA
    repeat = np.r_[np.arange(17), [0, 1, 2]]
    noise = repeat_noise(campaign_of(readings, SIGMA, repeat))
    assert noise.taken_out == {}
    assert noise.degrees == 18


def test_slow_changes_omit_constant_covariates():
    campaign = campaign_of(np.zeros((4, 6)), temperature=np.full(4, 6.0),
                           approach=np.array([1.0, -1, 1, 1]))  # fmt: skip
    assert set(slow_changes(campaign)) == {"time", "approach"}


def test_order_of_repeats_is_classified(rng):
    readings = np.zeros((60, 6))
    row = campaign_of(readings, repeat=np.repeat(np.arange(20), 3))
    assert revisits(row, row.repeat).order == "back to back"
    assert revisits(row, row.repeat).adjacent == 1.0
    spread = campaign_of(readings, repeat=np.tile(np.arange(20), 3))
    assert revisits(spread, spread.repeat).order == "interleaved"
    assert revisits(spread, spread.repeat).span == pytest.approx(40 / 59)
    pairs = np.tile(np.repeat(np.arange(15), 2), 2)  # order AABB ... AABB ...
    mixed = campaign_of(readings, repeat=pairs)
    assert revisits(mixed, mixed.repeat).order == "mixed"
    assert revisits(row, np.arange(60)).order == "none"
    assert revisits(row, np.zeros(60)).order == "all"
    assert revisits(row, np.r_[np.zeros(59), 1]).order == "back to back"
    # The file is sorted by repeat, but the times are those of interleaved passes.
    order = np.argsort(np.tile(np.arange(20), 3), kind="stable")
    by_time = campaign_of(readings, repeat=row.repeat, time=60.0 * order)
    assert revisits(by_time, by_time.repeat).order == "interleaved"


def test_points_measured_together_are_one_visit():
    """Three points are measured in each of three visits to 20 configurations."""
    ids = tuple(f"m{i}{end}" for i in range(60) for end in ("", ":left", ":right"))
    points = {"left": np.array([0, 0.1, 0]), "right": np.array([0, -0.1, 0])}
    configuration = np.repeat(np.tile(np.arange(20), 3), 3)
    campaign = replace(
        campaign_of(np.zeros((180, 6)), repeat=np.tile(np.arange(60), 3)), ids=ids,
        points=points, point=np.tile(["", "left", "right"], 60),
        configuration=configuration,
    )  # fmt: skip
    visits = revisits(campaign, campaign.configuration)
    assert visits.order == "interleaved"
    assert visits.rows == 60
    assert visits.span == pytest.approx(120 / 179)
    in_one_go = np.repeat(np.repeat(np.arange(20), 3), 3)
    assert revisits(campaign, in_one_go).order == "back to back"
