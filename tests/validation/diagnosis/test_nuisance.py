"""Test geometric errors and springs as nuisance parameters of a loaded bar."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.validation.diagnosis.nuisance import nuisance, with_compliance, with_error
from forcefit.validation.diagnosis.responses import responses
from forcefit.validation.diagnosis.signatures import conditions_of, whiten
from tests.bar_for_tests import LENGTH, bar

LOAD = [0.0, 0, 4.0, 0, 0, 30.0]


@pytest.fixture
def loaded():
    campaign = bar(LOAD)
    conditions = conditions_of(campaign)
    return campaign, conditions, responses(conditions)


def of_both_kinds(campaign, conditions, response):
    """Return the geometric errors and the springs."""
    small = nuisance(
        campaign, conditions, response, np.zeros((campaign.cells.sum(), 0))
    )
    return small.take(~small.spring), small.take(small.spring)


def test_nuisance_parameters_of_a_loaded_bar_equal_expected_list(loaded):
    """A force of 30 N along z at the end of the bar bends the bar about x and y."""
    campaign, conditions, response = loaded
    geometry, springs = of_both_kinds(campaign, conditions, response)
    assert not geometry.declared
    assert not springs.declared
    # The bounds are 0.2 rad and one tenth of the length.
    assert geometry.most == pytest.approx([*[0.2] * 3, *[0.1 * LENGTH] * 3] * 2)
    assert (springs.most == np.inf).all()
    # The platform has no spring.  The drive is loaded by 4 N m about z.
    assert set(springs.frame.tolist()) == {0}
    assert set(springs.axis.tolist()) == {0, 1, 2, 5}


def test_tolerances_are_prior_deviations_and_zero_excludes_an_error(loaded):
    campaign, _, _ = loaded
    tolerance = np.array([1e-3, 0, 1e-3, 2e-4, 0, 1e-4])
    frames = (replace(campaign.robot.frames[0], tolerance=tolerance),
              campaign.robot.frames[1])  # fmt: skip
    campaign = replace(campaign, robot=replace(campaign.robot, frames=frames))
    conditions = conditions_of(campaign)
    geometry, springs = of_both_kinds(campaign, conditions, responses(conditions))
    own = geometry.frame == 0
    assert geometry.axis[own].tolist() == [0, 2, 3, 5]
    np.testing.assert_array_equal(geometry.given[own], [1e-3, 1e-3, 2e-4, 1e-4])
    assert np.isnan(geometry.given[~own]).all()
    assert geometry.group.tolist() == [0, 0, 1, 1, 0, 0, 0, 1, 1, 1]
    assert geometry.declared
    assert not springs.declared
    assert geometry.take(own).columns.shape == (48, 4)


def test_directions_without_load_or_reading_have_no_unknowns():
    """Without a load, there are no springs.  Only x is measured."""
    seen = np.full((8, 6), np.nan)
    seen[:, 3] = 0.0
    campaign = bar(measured=seen)
    conditions = conditions_of(campaign)
    geometry, springs = of_both_kinds(campaign, conditions, responses(conditions))
    assert not len(springs.frame)
    places = set(zip(geometry.frame.tolist(), geometry.axis.tolist(), strict=True))
    assert places == {(0, 2), (0, 3), (1, 3), (1, 4)}
    assert geometry.columns.shape == (8, 4)


def test_nuisance_columns_predict_the_readings_of_a_changed_robot(loaded):
    """The changed robot has small geometric errors and springs."""
    campaign, conditions, response = loaded
    geometry, springs = of_both_kinds(campaign, conditions, response)
    rng = np.random.default_rng(1)
    x, c = 1e-6 * rng.normal(size=len(geometry.frame)), 1e-8 * rng.uniform(0.5, 1, 4)
    robot = with_error(campaign.robot, geometry.frame, geometry.axis, x)
    robot = with_compliance(robot, springs.frame, springs.axis, c)
    there = conditions_of(replace(campaign, robot=robot))
    moved = whiten(campaign, predict(there).deviation - predict(conditions).deviation)
    total = geometry.columns @ x + springs.columns @ c
    np.testing.assert_allclose(total, moved, atol=1e-3 * np.abs(moved).max())
    assert robot.errors[geometry.frame, geometry.axis].tolist() == x.tolist()


def test_passive_joint_with_added_compliance_rotates_freely():
    """A compliance of 1e-7 m/N is in series with a rigid bearing."""
    hinge = Frame("hinge", "base", joint="revolute")
    robot = Robot("a", "tip", (hinge, Frame("tip", "hinge")))
    first, axes = np.zeros(2, int), np.array([2, 4])
    K = with_compliance(robot, first, axes, np.array([1e-3, 1e-7])).frame("hinge")
    stiffness = np.diag(K.joint_stiffness)
    assert stiffness.tolist() == pytest.approx([np.inf, np.inf, 0, np.inf, 1e7, np.inf])
