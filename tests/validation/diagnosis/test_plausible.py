"""Test the detection of implausible parameters."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.validation.diagnosis.fit import MachineFit
from forcefit.validation.diagnosis.plausible import implausible, impossible_rows
from forcefit.validation.diagnosis.registration import device_frame
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.diagnosis.unknowns import Acting, Small, Unknowns
from tests.planar_arm_for_tests import measured


def found(effects, small=()):
    """Return a fitted machine with given parameters of effects."""
    parts = [
        SimpleNamespace(
            session=None,
            hypothesis=SimpleNamespace(effect=name, public=lambda robot, x: x),
            values=values,
        )
        for name, values in effects.items()
    ]
    return SimpleNamespace(
        effects=parts,
        unknowns=SimpleNamespace(small=small),
        own=lambda one: (one.values, None, None),
        robot=SimpleNamespace(effects=effects),
    )


def made_badly(rotation, translation):
    """Return a machine whose geometric errors have given prior deviations [rad, m]."""
    std = np.array([rotation, translation])
    return found({}, [Small("geometry", np.zeros(2, int), np.array([0, 3]), std)])


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Campaign of an arm of about 1 m under 30 N."""
    return measured(tmp_path_factory.mktemp("arm") / "campaign", configurations=8)


@pytest.mark.parametrize(
    ("effect", "name", "fair", "absurd"),
    [
        ("drive_compliance", "one", 3e5, 44.0),  # 0.7 rad for 30 N at 1 m
        ("base_compliance", "stiffness.tx", 1e7, 49.0),
        ("registration", "base.tx", 2e-3, 29.0),
        ("load_gain", "factor", 1.08, 0.016),
        ("thermal_expansion", "two", 2.3e-5, 2e-3),
        ("encoder_offset", "one", -1e-2, 0.7),
        ("modulus_scale", "two", 0.8, 40.0),
    ],
)
def test_implausible_parameter_is_reported_by_name(
    campaign, effect, name, fair, absurd
):
    def said(value):
        return implausible(campaign, found({effect: {name: value}}))

    assert said(fair) == ()
    (one,) = said(absurd)
    assert effect in one
    assert "declared stiffness" in one


def test_any_device_pose_is_plausible(campaign):
    frame, C = device_frame(conditions_of(campaign)), np.eye(6)
    x = np.array([0.0, 0.0, 0.0, 29.0, 0.0, 0.0])
    for device, doubted in ((False, 1), (True, 0)):
        acting = Acting(frame, np.zeros(6), None, device)
        unknowns = Unknowns(campaign.robot, (acting,))
        fit = MachineFit(unknowns, x, C, np.zeros((0, 6)), np.zeros(0))
        assert len(implausible(campaign, fit)) == doubted


def test_large_geometric_errors_are_implausible(campaign):
    """The limit is 2 % of the size of the robot."""
    for size, doubted in ((2e-3, 0), (5e-2, 1)):
        assert len(implausible(campaign, made_badly(1e-3, size))) == doubted


def test_temperatures_far_from_the_median_are_impossible(campaign):
    """The limit is a difference of 150 K."""
    for usual in (0.0, 293.0):
        heat = np.full(len(campaign), usual)
        heat[2], heat[4] = usual + 149.0, usual - 151.0
        odd = replace(campaign, covariates={"temperature": heat})
        assert np.flatnonzero(impossible_rows(odd)).tolist() == [4]
