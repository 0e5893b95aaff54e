"""Units of the parameters of effects and functions."""

import pytest

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.effects.units import units_of, variable_unit
from forcefit.assembly.model.function import Function
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.robots import load_robot
from tests.assembly.effects.test_effects import arm
from tests.assembly.effects.test_functions import RIGID

SLIDES = Robot("slides", "tip", (Frame("drive", joint="prismatic", actuated=True),
                                 Frame("tip", "drive")))  # fmt: skip


@pytest.mark.parametrize(("robot", "name", "unit"), [
    (RIGID, "q.drive", {}), (SLIDES, "q.drive", {"m": 1}),
    (RIGID, "load.mx", {"N": 1, "m": 1}), (RIGID, "load.force", {"N": 1}),
    (RIGID, "wrench.drive.mz", {"N": 1, "m": 1}), (RIGID, "position.x", {"m": 1}),
    (RIGID, "time", {"s": 1}), (RIGID, "approach", {}),
    (RIGID, "cov.temperature", {"K": 1}), (RIGID, "cov.speed", {"[speed]": 1}),
])  # fmt: skip
def test_variables_have_the_documented_units(robot, name, unit):
    assert variable_unit(robot, name) == unit


# frame and components; variables; form and parameters; units
UNITS = [
    ("tip rx", "position.x", "powers 1", "rad/m"),
    ("reading rz", "position.x", "powers 1", "rad/m"),
    ("load mx", "position.x", "powers 1", "N"),
    ("tip rz tx", "cov.temperature", "powers rz.1 tx.1", "rad/K, m/K"),
    # Powers of two variables are divided by both units.
    ("tip tx", "position.x cov.temperature", "powers 0.0 1.0 2.1 3.2",
     "m, 1, 1/(m K), 1/(m^2 K^2)"),
    # Powers of a reversal refer to the second variable.
    ("drive tx", "q.drive load.fz", "reversal 0 2", "m, m/N^2"),
    ("drive tx", "q.drive", "reversal 0", "m"),
    # Scaled waves are divided by the unit of the second variable.
    ("drive tx", "q.drive load.fz", "scaled_waves 1.sine", "m/N"),
    ("drive tx", "q.drive position.x", "reversal_waves 1.sine", "m"),
    # A period has the unit of its variable.
    ("tip rz", "position.x load.fz", "scaled_waves period", "m"),
    ("tip tx", "time", "slow_wave period", "s"),
    # Parameters of a knee are slopes and a load; a depth has the unit of the variable.
    ("tip tx", "load.fz", "knee below above size at", "m/N, m/N, m, N"),
    ("drive tx", "load.fz", "slip size depth", "m, N"),
    # The ends of a spline have the unit of their variable.
    ("tip rz", "position.x cov.temperature",
     "spline first.1 last.1 first.2 last.2", "m, m, K, K"),
    ("drive rz", "cov.temperature", "lag gain start time_constant", "rad/K, rad, s"),
    ("drive rz", "time", "creep gain start time_constant", "rad, rad, s"),
]  # fmt: skip
# The units of a compliance are divided by the unit of the wrench component.
COMPLIANCES = [
    ("tip rz", "approach", "powers 1", "rad/(N m)"),
    ("tip tz", "approach", "powers 1", "m/N"),
    ("tip tz", "load.fz", "powers 1", "m/N^2"),
]


@pytest.mark.parametrize(
    ("kind", "place", "variables", "form", "units"),
    [("screw", *row) for row in UNITS] + [("compliance", *row) for row in COMPLIANCES],
)
def test_units_of_function_parameters_depend_on_the_variables(
    kind, place, variables, form, units
):
    where, *components = place.split()
    name, *numbers = form.split()
    function = Function(
        where, tuple(components), tuple(variables.split()), name,
        dict.fromkeys(numbers, 1.0), kind,
    )  # fmt: skip
    assert ", ".join(units_of(RIGID, function).values()) == units


def test_units_of_formula_parameters_are_consistent():
    formula = Function("drive", ("rz",), ("time",), "formula", {"a": 1.0, "k": 1.0},
                       formula="a*exp(-k*time)")  # fmt: skip
    assert units_of(RIGID, formula) == {"a": "1", "k": "1/s"}


EFFECTS = {  # units for a revolute and for a prismatic arm
    ("encoder_offset", "drive"): ("rad", "m"),
    ("encoder_eccentricity", "drive.amplitude"): ("rad", "rad"),
    ("encoder_eccentricity", "drive.phase"): ("rad", "rad"),
    ("registration", "base.ry"): ("rad", "rad"),
    ("registration", "base.tz"): ("m", "m"),
    ("modulus_scale", "tip"): ("1", "1"),
    ("joint_clearance", "drive.axial"): ("m", "m"),
    ("joint_clearance", "drive.tilt"): ("rad", "rad"),
    ("friction_hysteresis", "drive"): ("N m", "N"),
    ("contact_stiffening", "drive.coefficient"): ("N m/rad^n", "N/m^n"),
    ("contact_stiffening", "drive.exponent"): ("1", "1"),
    ("load_gain", "factor"): ("1", "1"),
    ("load_gain", "offset.fx"): ("N", "N"),
    ("drift", "amplitude.rz"): ("rad", "rad"),
    ("drift", "time_constant"): ("s", "s"),
    ("base_compliance", "stiffness.ry"): ("N m/rad", "N m/rad"),
}


@pytest.mark.parametrize(("effect", "name"), EFFECTS)
def test_effect_units_depend_on_the_joint_type(effect, name):
    unit = LIBRARY[effect].unit
    assert (unit(arm(), name), unit(SLIDES, name)) == EFFECTS[effect, name]


@pytest.mark.parametrize(("effect", "before", "after"), [
    ("drive_compliance", "{}.compliance", "{}"),
    ("base_compliance", "compliance.{}", "stiffness.{}"),
])  # fmt: skip
def test_fitted_compliance_becomes_a_stiffness_and_zero_is_omitted(
    effect, before, after
):
    found = {"rx": 2e-6, "tz": 1e-8, "rz": 0.0}
    values = {before.format(name): c for name, c in found.items()}
    expected = {after.format("rx"): 5e5, after.format("tz"): 1e8}
    public = LIBRARY[effect].public(load_robot("arm6"), values)
    assert public == pytest.approx(expected)
