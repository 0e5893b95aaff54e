"""Test that a diagnosis with too few rows reports the required number of rows."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.model.statuses import NOT_ENOUGH_ROWS
from forcefit.validation.diagnosis.diagnose import diagnose
from forcefit.validation.diagnosis.prediction import predicted
from forcefit.validation.diagnosis.results import table
from forcefit.validation.diagnosis.text import text
from tests.elastic_arm_for_tests import arm, commanded
from tests.planar_arm_for_tests import SIGMA


def seen(rows, seed, unlike=0.0):
    """Return positions of an arm with geometric errors and random deviations."""
    rng = np.random.default_rng(seed)
    errors = rng.normal(size=(4, 6)) * np.repeat([1e-3, 5e-4], 3)
    campaign = commanded(arm(), rows, seed)
    there = predicted(replace(campaign, robot=arm().with_errors(errors)))
    readings = there.deviation + SIGMA * rng.normal(size=(rows, 6))
    readings += unlike * SIGMA * rng.normal(size=(rows, 6))
    readings[:, :3] = np.nan
    return replace(campaign, measured=readings)


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(k, marks=pytest.mark.slow) for k in (2, 3))]
)
def test_eight_measured_positions_are_reported_as_too_few(seed):
    """There are 24 readings and 20 geometric unknowns."""
    found = diagnose(seen(8, seed))
    assert found.verdict == NOT_ENOUGH_ROWS
    assert found.claimed == ()
    told = table(found)
    assert told["effects"] == []
    assert "configurations" in told["needed"]
    wanted = int(told["needed"].split("about ")[1].split()[0])
    assert wanted >= 16
    assert told["needed"] in text(found)
    assert "too few" in told["sentence"]


@pytest.mark.slow
def test_effect_is_identified_with_the_required_number_of_rows():
    found = diagnose(seen(8, 1))
    wanted = int(found.needed.split("about ")[1].split()[0])
    again = diagnose(seen(wanted, 1))
    assert again.verdict == "explained"
    assert again.needed == ""


@pytest.mark.slow
@pytest.mark.parametrize("seed", [4, 5])
def test_random_readings_are_not_explained(seed):
    """The 8 or 16 rows contain random readings of 100 sigma."""
    for rows in (8, 16):
        found = diagnose(seen(rows, seed, unlike=100.0))
        assert found.verdict in {NOT_ENOUGH_ROWS, "outside_library"}
        assert found.claimed == ()


@pytest.mark.parametrize("rows", [2, 3])
def test_very_few_rows_do_not_lead_to_an_effect(rows):
    """The number of columns of a function cannot exceed the number of rows."""
    campaign = seen(rows, 1)
    time = np.linspace(0.0, 600.0, rows)
    found = diagnose(replace(campaign, covariates={"time": time}))
    assert found.claimed == ()
