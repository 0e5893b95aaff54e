"""Noise from repeats: textbook variances, removal of drift, outliers."""

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
    """(rows,) each kind visited in every pass, in another order."""
    passes = -(-rows // kinds)
    return np.concatenate([rng.permutation(kinds) for _ in range(passes)])[:rows]


def test_noise_estimate_is_the_pooled_variance_of_repeats():
    """Sets (1, 3), (2, 2, 5) and a single: sums of squares 2 and 6 over 1 + 2."""
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


def test_missing_cell_reduces_only_the_degrees_of_freedom_of_its_component():
    """One of two rows has no tx: five components repeat."""
    measured = np.zeros((2, 6))
    measured[1] = 2.0
    measured[0, 3] = np.nan
    noise = repeat_noise(campaign_of(measured, 1.0, [0, 0]), {})
    assert noise.degrees == 5
    np.testing.assert_array_equal(noise.component_degrees, [1, 1, 1, 0, 1, 1])
    assert noise.ratio == pytest.approx(np.sqrt(2))


def test_noise_is_not_estimated_from_rows_without_repeats():
    assert repeat_noise(campaign_of(np.zeros((5, 6)))) is None
    measured = np.full((2, 6), np.nan)
    measured[0, 0] = measured[1, 1] = 1.0
    assert repeat_noise(campaign_of(measured, 1.0, [0, 0])) is None


def test_noise_equals_that_of_a_joint_least_squares_fit(rng):
    """The reference has a column for every set and a general solver;
    some cells are missing."""
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


def test_drift_does_not_enter_the_noise_estimate(rng):
    """Settling of 20 sigma and 5 sigma per kelvin, with interleaved repeats."""
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


def test_intervals_cover_the_true_value_at_the_stated_rate(rng):
    """400 campaigns: 90 % +- 3 standard deviations of a count, 0.855 ... 0.945; a
    suspect in at most 1 % + 3 standard deviations of them, 0.025."""
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


def test_time_without_effect_is_reported_at_the_false_alarm_rate(rng):
    """Probabilities for noise alone are uniform:
    5 % +- 3 standard deviations of 300."""
    time = np.arange(60.0)
    below = 0
    for _ in range(300):
        readings = rng.normal(size=(60, 6)) * SIGMA
        campaign = campaign_of(readings, SIGMA, interleaved(rng, 60, 25), time=time)
        below += repeat_noise(campaign).taken_out["time"] < 0.05
    assert 0.012 <= below / 300 <= 0.088


def test_outliers_among_repeats_are_reported_and_left_out(rng):
    """There is one in a set of three and one in a set of two, where either row may be
    wrong."""
    repeat = np.r_[np.repeat(np.arange(30), 3), [30, 30]]
    readings = rng.normal(size=(92, 6)) * SIGMA
    readings[4, 5] += 12 * SIGMA[5]
    readings[91, 1] -= 14 * SIGMA[1]
    noise = repeat_noise(campaign_of(readings, SIGMA, repeat))
    found = {s.component: s.rows for s in noise.suspects}
    assert found == {"tz": (4,), "ry": (90, 91)}
    assert noise.interval[0] < 1 < noise.interval[1]


def test_slow_changes_are_not_fitted_to_few_repeats(rng):
    """Three pairs have 18 readings; slow changes in time alone would need 24."""
    readings = rng.normal(size=(20, 6)) * SIGMA
    repeat = np.r_[np.arange(17), [0, 1, 2]]
    noise = repeat_noise(campaign_of(readings, SIGMA, repeat))
    assert noise.taken_out == {}
    assert noise.degrees == 18


def test_constant_covariates_are_not_fitted_to_repeats():
    campaign = campaign_of(np.zeros((4, 6)), temperature=np.full(4, 6.0),
                           approach=np.array([1.0, -1, 1, 1]))  # fmt: skip
    assert set(slow_changes(campaign)) == {"time", "approach"}


def test_revisits_classify_the_order_of_repeats(rng):
    readings = np.zeros((60, 6))
    row = campaign_of(readings, repeat=np.repeat(np.arange(20), 3))
    assert revisits(row, row.repeat).order == "back to back"
    assert revisits(row, row.repeat).adjacent == 1.0
    spread = campaign_of(readings, repeat=np.tile(np.arange(20), 3))
    assert revisits(spread, spread.repeat).order == "interleaved"
    assert revisits(spread, spread.repeat).span == pytest.approx(40 / 59)
    pairs = np.tile(np.repeat(np.arange(15), 2), 2)  # AABB ... AABB ...
    mixed = campaign_of(readings, repeat=pairs)
    assert revisits(mixed, mixed.repeat).order == "mixed"
    assert revisits(row, np.arange(60)).order == "none"
    assert revisits(row, np.zeros(60)).order == "all"
    assert revisits(row, np.r_[np.zeros(59), 1]).order == "back to back"
    # rows that the file sorts by repeat were measured in passes
    order = np.argsort(np.tile(np.arange(20), 3), kind="stable")
    by_time = campaign_of(readings, repeat=row.repeat, time=60.0 * order)
    assert revisits(by_time, by_time.repeat).order == "interleaved"


def test_points_read_at_the_same_time_count_as_one_visit():
    """Twenty configurations are visited three times,
    with three points read at each visit."""
    ids = tuple(f"m{i}{end}" for i in range(60) for end in ("", ":left", ":right"))
    points = {"left": np.array([0, 0.1, 0]), "right": np.array([0, -0.1, 0])}
    configuration = np.repeat(np.tile(np.arange(20), 3), 3)
    campaign = replace(
        campaign_of(np.zeros((180, 6)), repeat=np.tile(np.arange(60), 3)),
        ids=ids,
        points=points,
        point=np.tile(["", "left", "right"], 60),
        configuration=configuration,
    )
    visits = revisits(campaign, campaign.configuration)
    assert visits.order == "interleaved"
    assert visits.rows == 60
    assert visits.span == pytest.approx(120 / 179)
    in_one_go = np.repeat(np.repeat(np.arange(20), 3), 3)
    assert revisits(campaign, in_one_go).order == "back to back"
