"""Numbers that no machine has, from a campaign and its known sizes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.planar_arm_for_tests import measured
from validation.diagnosis.background import NOTHING
from validation.diagnosis.plausible import implausible, impossible_rows


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """An arm of about 1 m under 30 N."""
    return measured(tmp_path_factory.mktemp("arm") / "campaign", configurations=8)


@pytest.mark.parametrize(
    ("effect", "name", "fair", "absurd"),
    [
        ("drive_compliance", "one", 3e5, 44.0),  # 30 N at 1 m: 0.7 rad
        ("base_compliance", "stiffness.tx", 1e7, 49.0),
        ("registration", "base.tx", 2e-3, 29.0),
        ("load_gain", "factor", 1.08, 0.016),
        ("thermal_expansion", "two", 2.3e-5, 2e-3),
        ("encoder_offset", "one", -1e-2, 0.7),
        ("modulus_scale", "two", 0.8, 40.0),
    ],
)
def test_a_number_is_taken_or_doubted(campaign, effect, name, fair, absurd):
    def said(value):
        return implausible(
            campaign, SimpleNamespace(effects={effect: {name: value}}), NOTHING
        )

    assert said(fair) == ()
    (one,) = said(absurd)
    assert effect in one
    assert "declared stiffness" in one


@pytest.mark.parametrize(
    ("effect", "name", "softest"),
    [
        # 3 N m and 29.93 N at the longest body's 0.6 m turn it by 0.2 rad
        ("drive_compliance", "one", (3.0 + 29.9331 * 0.6) / 0.2),
        ("base_compliance", "stiffness.tx", 29.9331 / (0.2 * 0.6)),
    ],
)
def test_the_softest_spring_gives_a_fifth_under_the_largest_load(
    campaign, effect, name, softest
):
    for value, count in ((1.001 * softest, 0), (0.999 * softest, 1)):
        fit = SimpleNamespace(effects={effect: {name: value}})
        assert len(implausible(campaign, fit, NOTHING)) == count


def test_a_frame_that_is_fitted_anyway_may_be_anywhere(campaign):
    anywhere = replace(campaign, registration="unknown")
    fit = SimpleNamespace(effects={"registration": {"base.tx": 29.0}})
    assert implausible(anywhere, fit, NOTHING) == ()


def test_a_temperature_that_no_sensor_has_is_flagged(campaign):
    spoilt = campaign.covariates["temperature"].copy()
    spoilt[5] = -180.0
    hot = replace(campaign, covariates=campaign.covariates | {"temperature": spoilt})
    assert np.flatnonzero(impossible_rows(hot)).tolist() == [5]
    assert not impossible_rows(campaign).any()


def test_geometric_errors_of_a_fiftieth_of_the_robot_are_doubted(campaign):
    """An arm of about 1 m: frames that are all off by 5 cm were not made like that."""
    fit = SimpleNamespace(effects={})
    for size, doubted in ((2e-3, 0), (5e-2, 1)):
        behind = replace(NOTHING, scales={"geometry": (1e-3, size)})
        assert len(implausible(campaign, fit, behind)) == doubted
