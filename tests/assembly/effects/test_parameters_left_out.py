"""Effects with omitted parameters, and conversion of fitted parameters."""

from dataclasses import replace
from math import atan2, cos, hypot, sin

import pytest

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.effects.functions import covariates_of
from forcefit.assembly.effects.robot_effects import check_covariates
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Clearance
from forcefit.inputs.errors import BadInput
from tests.assembly.effects.test_effects import K, L, arm, change, here


def public(name, values, robot=None):
    """Convert fitted unknowns to the parameters of an effect."""
    return LIBRARY[name].public(robot or arm(), values)


def test_contact_without_an_exponent_uses_the_hertz_exponent():
    F, c = 25.0, 1e7
    load = (0, 0, 0, 0, F, 0)
    seen = change(
        here(arm(rigid=True), load), "contact_stiffening", {"drive.coefficient": c}
    )
    assert seen[2] == pytest.approx((F * L / c) ** (2 / 3), rel=1e-9)


@pytest.mark.parametrize("exponent", [None, 2.0])
def test_fitted_contact_deflection_becomes_a_coefficient(exponent):
    give, n = 1e-4, exponent or 1.5
    values = {"drive.give": give}
    if exponent:
        values["drive.exponent"] = exponent
    found = public("contact_stiffening", values)
    assert found["drive.coefficient"] * give**n == pytest.approx(1.0, rel=1e-12)
    assert found["drive.exponent"] == n
    assert public("contact_stiffening", {"drive.give": 0.0}) == {}


def test_encoder_sine_and_cosine_become_amplitude_and_phase():
    """The amplitude a and phase p satisfy s sin q + c cos q = a sin(q + p)."""
    for values in ({"drive.sine": 2e-5, "drive.cosine": 3e-5}, {"drive.sine": -2e-5},
                   {"drive.cosine": 3e-5}):  # fmt: skip
        s, c = (values.get(f"drive.{part}", 0.0) for part in ("sine", "cosine"))
        found = public("encoder_eccentricity", values)
        assert found["drive.amplitude"] == pytest.approx(hypot(s, c), rel=1e-12)
        assert found["drive.phase"] == pytest.approx(atan2(c, s), rel=1e-12)
        q = 0.7
        wave = found["drive.amplitude"] * sin(q + found["drive.phase"])
        assert wave == pytest.approx(s * sin(q) + c * cos(q), rel=1e-12)


def test_friction_is_zero_without_an_approach_direction():
    values = {"drive": 2.0}
    for approach, part in ((0.0, 0.0), (0.5, -0.5)):
        seen = change(here(arm(K), approach=approach), "friction_hysteresis", values)
        assert seen[2] == pytest.approx(part * 2.0 / K, rel=1e-9, abs=1e-18)


def test_joint_clearance_effect_is_added_to_the_robot_clearance():
    robot = arm(rigid=True)
    drive = replace(robot.frames[0], clearance=Clearance(axial=2e-5))
    robot = replace(robot, frames=(drive, robot.frames[1]))
    values = {"drive.axial": 3e-5, "drive.radial": 1e-5, "drive.tilt": 0.0}
    found = apply_effects(here(robot), {"joint_clearance": values}).robot.frames[0]
    assert found.clearance.axial == pytest.approx(5e-5, rel=1e-12)
    assert found.clearance.radial == 1e-5
    assert not found.clearance.tilt
    fitted = {"drive.radial": 2e-9, "drive.axial": 1e-9, "drive.tilt": 0.0}
    assert public("joint_clearance", fitted) == {"drive.radial": 2e-9}


def test_fitted_modulus_change_becomes_a_factor():
    assert public("modulus_scale", {"tip.softer": 0.25}) == {"tip": 0.8}
    assert public("modulus_scale", {"tip.softer": -0.5}) == {"tip": 2.0}


@pytest.mark.parametrize(("form", "variables", "needed"), [
    ("reversal", ("q.drive",), ["approach"]),
    ("lag", ("cov.speed",), ["speed", "time"]),
    ("creep", ("load.fz",), ["time"]),
    ("powers", ("cov.speed",), ["speed"]),
    ("powers", ("time",), ["time"]),
    ("powers", ("q.drive",), []),
])  # fmt: skip
def test_covariates_of_functions_depend_on_the_session(form, variables, needed):
    function = Function("drive", ("rz",), variables, form, {"1": 0.0})
    robot = replace(arm(), functions=(function,))
    assert list(covariates_of(robot, [])) == needed
    in_one = replace(robot, functions=(replace(function, session="a"),))
    assert list(covariates_of(in_one, ["b"])) == []
    assert list(covariates_of(in_one, ["b", "a"])) == needed


def test_geometric_stiffening_without_finite_motions_is_rejected():
    robot = replace(arm(K), effects={"geometric_stiffening": {}})
    check_covariates(robot, {}, finite=True)
    with pytest.raises(BadInput, match="is defined for finite motions only"):
        check_covariates(robot, {})
    check_covariates(arm(K), {})
