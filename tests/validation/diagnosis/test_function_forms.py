"""Forms of functions and their prior probabilities."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.bar_for_tests import bar
from validation.campaign.campaign_file import read_campaign
from validation.diagnosis import function_forms as forms
from validation.diagnosis.function_forms import LAGS, MANY, CandidateShape
from validation.diagnosis.signatures import conditions_of

CONDITIONS = conditions_of(
    bar(rows=30, time=np.arange(30.0), temperature=np.linspace(-1, 2, 30) ** 2)
)


@pytest.mark.parametrize("name", ["q.drive", "time", "cov.temperature", "position.x"])
def test_priors_of_all_forms_sum_to_one(name):
    found = forms.every(CONDITIONS, name)
    assert len(set(found)) == len(found)
    assert np.exp(forms.log_priors(found)).sum() == pytest.approx(1.0)


def test_prior_of_waves_falls_with_their_order():
    waves = [CandidateShape("waves", (f"{k}.sine", f"{k}.cosine")) for k in (1, 2, 9)]
    prior = np.exp(forms.log_priors(waves))
    assert prior[0] / prior == pytest.approx([1.0, 2.0, 9.0])
    several = CandidateShape("waves", ("1.sine", "1.cosine", "4.sine", "4.cosine"))
    assert forms.falling(several, 4) == pytest.approx([1.0, 1.0, 0.25, 0.25])


def test_general_forms_are_among_all_forms():
    for name in ("q.drive", "time", "cov.temperature"):
        every = forms.every(CONDITIONS, name)
        assert set(forms.first(CONDITIONS, name)) <= set(every)


def test_steps_are_tried_between_nearly_all_rows():
    steps = [s for s in forms.every(CONDITIONS, "time") if s.form == "step"]
    levels = np.sort([dict(s.given)["at"] for s in steps])
    for jump in np.arange(3.5, 26.0):
        # rows on both sides of a jump are told apart by some level
        assert ((levels > jump - 0.5) & (levels <= jump + 0.5)).any()


def test_products_have_a_form_that_a_robot_file_can_store():
    from assembly.effects.forms import FORMS

    pairs = [("q.drive", "time"), ("approach", "load.fz"), ("time", "position.x")]
    for first, second in pairs:
        variables, found = forms.of_two(CONDITIONS, first, second)
        assert set(variables) == {first, second}
        for shape in found:
            form = FORMS[shape.form]
            assert form.most >= 2
            assert all(form.is_column(name, 2) for name in shape.names)


CAMPAIGN = Path(__file__).parents[2] / "campaigns" / "base_compliance_drift"


@pytest.fixture(scope="module")
def conditions():
    return conditions_of(read_campaign(CAMPAIGN))


def shapes(conditions, name):
    """The names of each form's columns, and what is given, by form."""
    found = {}
    for shape in forms.every(conditions, name):
        found.setdefault(shape.form, []).append((shape.names, dict(shape.given)))
    return found


def angle_of(conditions):
    robot = conditions.robot
    return next(f.name for f in robot.frames if f.actuated and f.joint == "revolute")


def test_an_angle_has_waves_of_every_order_up_to_twelve(conditions):
    found = shapes(conditions, f"q.{angle_of(conditions)}")
    single = [(f"{k}.sine", f"{k}.cosine") for k in range(1, 13)]
    waves = [names for names, _ in found["waves"]]
    assert set(single) <= set(waves)
    several = sorted(len(names) for names in set(waves) - set(single))
    assert several == [3, 3, 3, 3, 4, 8, 16]
    assert tuple(one for pair in single[:4] for one in pair) in waves
    assert (("0",), {}) in found["reversal"]
    # where a spring yields, its mean counts as well
    for k in range(1, 5):
        assert ("0.cosine", f"{k}.sine", f"{k}.cosine") in waves


def test_many_rows_are_looked_at_for_many_waves(conditions):
    some = np.resize(np.arange(len(conditions)), MANY)
    name = f"q.{angle_of(conditions)}"
    for rows, orders in ((some, [20, 40]), (some[1:], [])):
        waves = shapes(conditions.take(rows), name)["waves"]
        counts = sorted(len(names) // 2 for names, _ in waves)
        assert [k for k in counts if k > 12] == orders


def test_times_of_a_step_a_lag_and_a_wave_are_within_the_campaign(conditions):
    span = float(np.ptp(conditions.time))
    low, high = conditions.time.min(), conditions.time.max()
    found = shapes(conditions, "cov.time")
    periods = [given["period"] for _, given in found["slow_wave"]]
    np.testing.assert_allclose(span / np.array(periods), [0.5, 1, 1.5, 2, 3, 4, 6])
    at = np.array([given["at"] for _, given in found["step"]])
    assert ((low < at) & (at < high)).all()
    lags = np.array([given["time_constant"] for _, given in found["lag"]]) / span
    assert (lags.min(), lags.max()) == pytest.approx((0.02, 0.5))
    # half way between two, by ratio, is within a third of either
    assert (lags[1:] / lags[:-1] < (4 / 3) ** 2).all()
    assert found["spline"] == [(tuple("1234567"), {"first": low, "last": high})]
    powers = [names for names, _ in found["powers"]]
    assert set(powers) == {tuple(p) for p in ("1", "2", "3", "01", "012", "0123")}


def test_the_side_from_which_one_comes_has_a_sign_and_no_more(conditions):
    assert shapes(conditions, "approach") == {"powers": [(("1",), {})]}


def test_a_load_has_no_steps(conditions):
    assert "step" not in shapes(conditions, "load.fx")


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
