"""Test which effects are claimed, with analytical solutions for a bar."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from forcefit.assembly.effects.effect import Unknown
from forcefit.validation.diagnosis.claims import supported
from forcefit.validation.diagnosis.fit import MachineFit, fit_machine
from forcefit.validation.diagnosis.hypotheses import Hypothesis, Slot
from forcefit.validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from forcefit.validation.diagnosis.unknowns import Acting, Small, Unknowns
from tests.bar_for_tests import (
    BEAM,
    LENGTH,
    LONGER,
    SOFTER,
    WARMER,
    bar,
    fit_of,
    gives_way,
    hypothesis,
    machine,
    numbers,
)
from tests.planar_arm_for_tests import SIGMA

# quantile of the normal distribution for a two-sided p-value of 0.001
SURE = norm.isf(0.5e-3)


def first(fit):
    return supported(fit, fit.unknowns.effects[0])


@pytest.mark.parametrize(("times", "claimed"), [(0.98, False), (1.02, True)])
@pytest.mark.parametrize("sign", [1, -1])
def test_length_error_is_claimed_for_p_values_below_0_001(times, claimed, sign):
    """The length is the mean of eight readings, so its std is sigma / sqrt(8)."""
    length = sign * times * SURE * SIGMA[3] / np.sqrt(8)
    plain = bar(link=BEAM)
    fit = machine(bar(link=BEAM, measured=fit_of(plain, length)), LONGER)
    assert fit.x == pytest.approx([length], rel=1e-6)
    assert first(fit) == claimed


def test_negative_drive_compliance_is_not_claimed():
    """A drive that rotates against its load has a compliance at the bound of zero."""
    seen = np.tile([0, 0, -3e-4, 0, 0, 0], (8, 1))
    fit = machine(bar([0, 0, 30.0, 0, 0, 0], seen), SOFTER, start=1e-6)
    assert fit.x == pytest.approx([0.0], abs=1e-9)
    assert fit.robot.effects == {}
    assert numbers(fit) == []
    assert not first(fit)
    assert first(machine(gives_way(30.0, 2e5), SOFTER, start=1e-6))


def test_effect_at_its_bound_is_not_supported():
    """The upper bound of thermal expansion is 5e-4 per kelvin."""
    heat = {"temperature": np.full(8, 5.0)}
    plain = bar(link=BEAM, **heat)
    most = 5e-4 * LENGTH * 5.0
    for size, claimed in ((0.9, True), (1.2, False)):
        seen = fit_of(plain, size * most)
        fit = machine(bar(link=BEAM, measured=seen, **heat), WARMER)
        assert fit.x == pytest.approx([min(size, 1.0) * 5e-4], rel=1e-4)
        assert first(fit) == claimed


@pytest.mark.parametrize(("value", "claimed"), [(1.5, True), (1.05, False)])
def test_exponent_at_its_bound_is_not_supported(value, claimed):
    """The effect is a contact law whose exponent is a shape parameter."""
    slots = (
        Slot(("drive.give",), Unknown("give", 1e-6, 0.0, 1.0), 0.0),
        Slot(("drive.exponent",), Unknown("exponent", 0.5, 1.05, 6.0), 1.5, True),
    )
    one = Acting(Hypothesis("contact_stiffening", ("drive",), slots), np.zeros(2))
    plain = machine(bar(link=BEAM), LONGER)
    fit = replace(
        plain, unknowns=Unknowns(bar().robot, (one,)), x=np.array([1e-5, value]),
        covariance=np.diag([1e-14, 1e-4]), slopes=np.ones((8, 2)) * [1e7, 1.0],
    )  # fmt: skip
    assert supported(fit, one) == claimed


def test_device_pose_and_effects_without_parameters_are_always_supported():
    fit = machine(bar(link=BEAM), LONGER)
    assert not first(fit)
    finite = Acting(Hypothesis("geometric_stiffening", (), ()), np.zeros(0))
    assert supported(fit, finite)
    assert supported(fit, replace(fit.unknowns.effects[0], device=True))


def softer(robot, x, variance):
    """Return a fit of a modulus factor with the fitted unknown x = 1 / factor - 1."""
    one = hypothesis("modulus_scale", "tip", "tip.softer", Unknown("softer", 0.1))
    unknowns = Unknowns(robot, (Acting(one, np.zeros(1)),))
    C, nothing = np.array([[variance]]), np.zeros((0, 1))
    return MachineFit(unknowns, np.array([x]), C, nothing, np.zeros(0))


@pytest.mark.parametrize(("declared", "value", "std"), [
    # The declared factor of 0.8 is multiplied by the identified factor of 0.9.
    (0.8, 0.72, 0.8 * 0.81 * 1e-3),
    (None, 0.9, 0.81 * 1e-3),
])  # fmt: skip
def test_standard_deviation_of_a_modulus_factor_is_transformed(declared, value, std):
    """For x = 1 / f - 1, the standard deviation of f is f^2 times that of x."""
    robot = bar(link=BEAM).robot
    if declared is not None:
        robot = replace(robot, effects={"modulus_scale": {"tip": declared}})
    fit = softer(robot, 1 / 0.9 - 1, 1e-6)
    ((name, found, sigma),) = numbers(fit)
    assert (name, found) == ("tip", pytest.approx(value))
    assert sigma == pytest.approx(std, rel=1e-6)


def test_parameter_that_readings_do_not_determine_is_not_reported():
    """The posterior standard deviation of such a parameter equals that of the prior."""
    robot = bar(link=BEAM).robot
    prior = softer(robot, 0.0, 1.0).unknowns.std[0] ** 2
    assert numbers(softer(robot, 0.0, prior)) == []
    assert len(numbers(softer(robot, 0.0, 0.5 * prior))) == 1


def test_fitted_spring_compliance_is_not_negative():
    """The drive rotates against its moment."""
    M = 30.0
    seen = np.tile([0, 0, -M / 1e5, 0, 0, 0], (8, 1))
    campaign = bar(
        [0, 0, M, 0, 0, 0], seen, spring=np.diag([np.inf] * 2 + [1e6] + [np.inf] * 3)
    )
    springs = Small(SPRINGS, np.zeros(1, int), np.array([2]), np.array([1e-5]))
    fit = fit_machine(
        campaign, Unknowns(campaign.robot, (), (springs,)), np.ones(8, bool)
    )
    assert fit.x == pytest.approx([0.0], abs=1e-15)
    declared, found = (r.frames[0].joint_stiffness for r in (campaign.robot, fit.robot))
    assert np.array_equal(declared, found)


def test_geometric_error_agrees_with_ridge_regression():
    """The estimate is the mean of eight readings, multiplied by a shrinkage factor."""
    size, std = 3e-6, 2e-6
    plain = bar(link=BEAM)
    campaign = bar(link=BEAM, measured=fit_of(plain, size))
    part = Small(GEOMETRY, np.ones(1, int), np.array([3]), np.array([std]))
    fit = fit_machine(campaign, Unknowns(campaign.robot, (), (part,)), np.ones(8, bool))
    told = 8 * std**2 / (8 * std**2 + SIGMA[3] ** 2)
    assert fit.x == pytest.approx([told * size], rel=1e-4)
    assert fit.determined == pytest.approx([told], rel=1e-4)
    assert fit.covariance[0, 0] == pytest.approx((1 - told) * std**2, rel=1e-4)
