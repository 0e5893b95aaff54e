"""What a fit looks for: units, bounds that physics sets, sizes that machines have."""

import pytest

from assembly.effects import LIBRARY
from assembly.model.robot import Frame, Robot
from assembly.robots import load_robot
from tests.assembly.effects.test_effects import arm

SLIDES = Robot("slides", "tip", (
    Frame("drive", joint="prismatic", actuated=True), Frame("tip", "drive"),
))  # fmt: skip
UNITS = {  # by effect and parameter: of an arm that turns, of one that slides
    ("self_weight", "g.x"): ("m/s^2", "m/s^2"),
    ("thermal_expansion", "tip"): ("1/K", "1/K"),
    ("drive_compliance", "drive"): ("N m/rad", "N/m"),
    ("encoder_offset", "drive"): ("rad", "m"),
    ("encoder_eccentricity", "drive.amplitude"): ("rad", "rad"),
    ("encoder_eccentricity", "drive.phase"): ("rad", "rad"),
    ("link_length", "tip"): ("m", "m"),
    ("registration", "base.ry"): ("rad", "rad"),
    ("registration", "base.tz"): ("m", "m"),
    ("registration", "tool.tx"): ("m", "m"),
    ("modulus_scale", "tip"): ("1", "1"),
    ("joint_clearance", "drive.radial"): ("m", "m"),
    ("joint_clearance", "drive.axial"): ("m", "m"),
    ("joint_clearance", "drive.tilt"): ("rad", "rad"),
    ("friction_hysteresis", "drive"): ("N m", "N"),
    ("contact_stiffening", "drive.coefficient"): ("N m/rad^n", "N/m^n"),
    ("contact_stiffening", "drive.exponent"): ("1", "1"),
    ("load_gain", "factor"): ("1", "1"),
    ("load_gain", "offset.mz"): ("N m", "N m"),
    ("load_gain", "offset.fx"): ("N", "N"),
    ("drift", "amplitude.rz"): ("rad", "rad"),
    ("drift", "amplitude.tx"): ("m", "m"),
    ("drift", "time_constant"): ("s", "s"),
    ("base_compliance", "stiffness.ry"): ("N m/rad", "N m/rad"),
    ("base_compliance", "stiffness.tz"): ("N/m", "N/m"),
}


@pytest.mark.parametrize(("effect", "name"), UNITS)
def test_units_are_those_of_what_is_moved(effect, name):
    unit = LIBRARY[effect].unit
    assert (unit(arm(), name), unit(SLIDES, name)) == UNITS[effect, name]


@pytest.mark.parametrize(("effect", "before", "after"), [
    ("drive_compliance", "{}.compliance", "{}"),
    ("base_compliance", "compliance.{}", "stiffness.{}"),
])  # fmt: skip
def test_a_stiffness_is_one_over_its_compliance_and_none_if_rigid(
    effect, before, after
):
    found = {"rx": 2e-6, "tz": 1e-8, "rz": 0.0}
    values = {before.format(name): c for name, c in found.items()}
    expected = {after.format("rx"): 5e5, after.format("tz"): 1e8}
    public = LIBRARY[effect].public(load_robot("arm6"), values)
    assert public == pytest.approx(expected)


def test_where_an_effect_can_act():
    """Both drives, those that turn; beams, of which one has a body of its own."""
    beam = arm().frames[1].link
    robot = Robot("both", "tip", (
        Frame("turn", joint="revolute", actuated=True), Frame("bar", "turn",
              [0.2, 0, 0], link=beam),
        Frame("slide", "bar", joint="prismatic", actuated=True),
        Frame("pin", "slide", joint="revolute"), Frame("tip", "pin"),
    ))  # fmt: skip
    drives, turning, beams = ("turn", "slide"), ("turn",), ("bar",)
    frames = {name: effect.frames for name, effect in LIBRARY.items() if effect.frames}
    assert {name: where(robot) for name, where in frames.items()} == {
        "thermal_expansion": beams, "delayed_expansion": beams,
        "body_mass": beams, "drive_compliance": drives,
        "encoder_offset": drives, "encoder_eccentricity": turning,
        "link_length": beams, "modulus_scale": beams,
        "joint_clearance": (*drives, "pin"), "friction_hysteresis": (),
        "contact_stiffening": drives,
    }  # fmt: skip
