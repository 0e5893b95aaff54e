"""Forms in which a readings' remainder may depend on a variable."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation.campaign.campaign_file import read_campaign
from validation.diagnosis.forms_tried import LAGS, MANY, all_shapes
from validation.diagnosis.signatures import conditions_of

CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "base_compliance_drift"


@pytest.fixture(scope="module")
def conditions():
    return conditions_of(read_campaign(CAMPAIGN))


def shapes(conditions, name, kind="screw"):
    """The names of each form's columns, and what is given, by form."""
    found = {}
    for shape in all_shapes(conditions, name, kind):
        found.setdefault(shape.form, []).append((shape.names, dict(shape.given)))
    return found


def angle_of(conditions):
    robot = conditions.robot
    return next(f.name for f in robot.frames if f.actuated and f.joint == "revolute")


def test_an_angle_has_waves_of_every_order_up_to_eight(conditions):
    name = f"q.{angle_of(conditions)}"
    found = shapes(conditions, name)
    single = [(f"{k}.sine", f"{k}.cosine") for k in range(1, 9)]
    waves = [names for names, _ in found["waves"]]
    assert waves[:8] == single
    assert [len(names) for names in waves[8:]] == [4, 8, 16]
    assert waves[9] == tuple(one for pair in single[:4] for one in pair)
    assert found["reversal"] == [(("0",), {})]
    # where a spring yields, its mean counts as well
    yields = shapes(conditions, name, "compliance")["waves"]
    assert [names for names, _ in yields][len(waves):] == [
        ("0.cosine", f"{k}.sine", f"{k}.cosine") for k in range(1, 5)
    ]  # fmt: skip


def test_many_rows_are_looked_at_for_many_waves(conditions):
    some = np.resize(np.arange(len(conditions)), MANY)
    name = f"q.{angle_of(conditions)}"
    for rows, orders in ((some, [20, 40]), (some[1:], [])):
        waves = shapes(conditions.take(rows), name)["waves"]
        assert [len(names) // 2 for names, _ in waves[11:]] == orders


def test_times_of_a_step_a_lag_and_a_wave_are_within_the_campaign(conditions):
    span = float(np.ptp(conditions.time))
    low, high = conditions.time.min(), conditions.time.max()
    found = shapes(conditions, "cov.time")
    periods = [given["period"] for _, given in found["slow_wave"]]
    np.testing.assert_allclose(span / np.array(periods), [0.5, 1, 1.5, 2, 3, 4, 6])
    at = np.array([given["at"] for _, given in found["step"]])
    assert len(at) == 9
    assert ((low < at) & (at < high)).all()
    # of evenly spread rows a tenth lies between one and the next
    between = [np.mean(conditions.time < one) for one in at]
    np.testing.assert_allclose(between, np.arange(1, 10) / 10, atol=1 / len(conditions))
    lags = np.array([given["time_constant"] for _, given in found["lag"]]) / span
    assert (lags.min(), lags.max()) == pytest.approx((0.02, 0.5))
    # half way between two, by ratio, is within a third of either
    assert (lags[1:] / lags[:-1] < (4 / 3) ** 2).all()
    assert found["spline"] == [(tuple("1234567"), {"first": low, "last": high})]
    powers = [names for names, _ in found["powers"]]
    assert powers == [tuple(one) for one in ("1", "2", "3", "01", "012", "0123")]


def test_the_side_from_which_one_comes_has_a_sign_and_no_more(conditions):
    assert shapes(conditions, "approach") == {"powers": [(("1",), {})]}


def test_a_load_has_no_steps(conditions):
    assert shapes(conditions, "load.fx").keys() <= {"powers", "spline"}


@pytest.mark.parametrize(
    ("begin", "span"), [(0.0, 0.5), (1e3, 60.0), (0.0, 0.0), (0.0, np.nan)]
)
def test_periods_and_lags_are_parts_of_the_span_of_time(conditions, begin, span):
    """However short it is and whenever it began; none without any."""
    count = len(conditions)
    time = begin + span * np.linspace(0, 1, count)
    wet = {"wet": np.linspace(0, 1, count)}
    found = shapes(replace(conditions, time=time, covariates=wet), "cov.wet")
    lags = [given["time_constant"] for _, given in found.get("lag", [])]
    assert lags == pytest.approx([span * part for part in LAGS] if span > 0 else [])
    if span > 0:
        found = shapes(replace(conditions, time=time), "time")
        periods = [given["period"] for _, given in found["slow_wave"]]
        assert max(periods) == pytest.approx(2 * span)
