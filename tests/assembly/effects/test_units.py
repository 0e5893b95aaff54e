"""Units of functions' numbers: value = number x powers of the variables, by hand."""

from dataclasses import replace

import pytest

from assembly.effects.units import units_of, variable_unit
from assembly.model.function import Function
from assembly.model.robot import Frame, Robot
from tests.assembly.effects.test_functions import RIGID

SLIDES = Robot("slides", "tip", (Frame("slide", joint="prismatic", actuated=True),
                                 Frame("tip", "slide")))  # fmt: skip


def units(where, components, variables, form, names, **more):
    function = Function(where, components, variables, form, dict.fromkeys(names, 1.0))
    return list(units_of(RIGID, replace(function, **more)).values())


@pytest.mark.parametrize(("robot", "name", "unit"), [
    (RIGID, "q.drive", {}), (SLIDES, "q.slide", {"m": 1}),
    (RIGID, "load.mx", {"N": 1, "m": 1}), (RIGID, "load.fx", {"N": 1}),
    (RIGID, "load.force", {"N": 1}),
    (RIGID, "wrench.drive.mz", {"N": 1, "m": 1}), (RIGID, "wrench.drive.fz", {"N": 1}),
    (RIGID, "position.x", {"m": 1}), (RIGID, "time", {"s": 1}),
    (RIGID, "approach", {}), (RIGID, "cov.temperature", {"K": 1}),
    (RIGID, "cov.speed", {"[speed]": 1}),
])  # fmt: skip
def test_units_of_variables(robot, name, unit):
    assert variable_unit(robot, name) == unit


@pytest.mark.parametrize(("where", "component", "unit"), [
    ("tip", "rx", "rad/m"), ("tip", "tx", "1"), ("base", "ty", "1"),
    ("reading", "rz", "rad/m"), ("load", "mx", "N"), ("load", "fx", "N/m"),
])  # fmt: skip
def test_a_slope_over_a_position_by_what_it_gives(where, component, unit):
    assert units(where, (component,), ("position.x",), "powers", ["1"]) == [unit]


def test_powers_of_two_variables_divide_by_both():
    variables = ("position.x", "cov.temperature")
    found = units("tip", ("tx",), variables, "powers", ["0.0", "1.0", "2.1", "3.2"])
    assert found == ["m", "1", "1/(m K)", "1/(m^2 K^2)"]


def test_a_reversals_powers_are_of_what_its_size_depends_on():
    variables = ("q.drive", "load.fz")
    assert units("drive", ("tx",), variables, "reversal", ["0", "2"]) == ["m", "m/N^2"]
    assert units("drive", ("tx",), ("q.drive",), "reversal", ["0"]) == ["m"]


def test_waves_that_are_scaled_divide_by_their_second_variable_alone():
    variables = ("q.drive", "load.fz")
    assert units("drive", ("tx",), variables, "scaled_waves", ["1.sine"]) == ["m/N"]
    turned = ("q.drive", "position.x")
    assert units("drive", ("tx",), turned, "reversal_waves", ["1.sine"]) == ["m"]


def test_a_period_has_the_unit_of_what_turns():
    variables = ("approach", "position.x")
    assert units("tip", ("rz",), variables, "reversal_waves", ["period"]) == ["m"]
    variables = ("position.x", "load.fz")
    assert units("tip", ("rz",), variables, "scaled_waves", ["period"]) == ["m"]


def test_a_knee_is_a_slope_up_to_a_load_and_beyond_it():
    names = ["below", "above", "size", "at"]
    found = units("tip", ("tx",), ("load.fz",), "knee", names)
    assert found == ["m/N", "m/N", "m", "N"]


def test_a_depth_has_the_unit_of_what_slips():
    found = units("drive", ("tx",), ("load.fz",), "slip", ["size", "depth"])
    assert found == ["m", "N"]


def test_shapes_have_the_units_of_their_own_variable():
    ends = ["first.1", "last.1", "first.2", "last.2"]
    found = units("tip", ("rz",), ("position.x", "cov.temperature"), "spline", ends)
    assert found == ["m", "m", "K", "K"]
    assert units("tip", ("rz",), ("load.fz",), "spline", ["first", "last"]) == ["N"] * 2
    assert units("tip", ("tx",), ("q.drive",), "waves", ["period"]) == ["rad"]
    assert units("tip", ("tx",), ("time",), "slow_wave", ["period"]) == ["s"]
    assert units("tip", ("tx",), ("load.fz",), "step", ["at", "size"]) == ["N", "m"]


def test_a_number_for_each_component_has_that_components_unit():
    names = ["rz.1", "tx.1"]
    found = units("tip", ("rz", "tx"), ("cov.temperature",), "powers", names)
    assert found == ["rad/K", "m/K"]


def test_a_compliance_is_over_the_wrench_of_its_component():
    for component, unit in (("rz", "rad/(N m)"), ("tz", "m/N")):
        found = units("tip", (component,), ("approach",), "powers", ["1"],
                      kind="compliance")  # fmt: skip
        assert found == [unit]
    found = units("tip", ("tz",), ("load.fz",), "powers", ["1"], kind="compliance")
    assert found == ["m/N^2"]
