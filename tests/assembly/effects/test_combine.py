"""Combination of two effects of the same kind."""

import numpy as np
import pytest

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.effects.combine import combined
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.robot import BeamLink, Frame, Robot

SPRING = np.diag([np.inf, np.inf, 5e4, np.inf, np.inf, np.inf])
TUBE = BeamLink({"radius": 0.03, "inner_radius": 0.025}, 70e9, 0.33, density=2700.0)
FRAME_1 = {"base.rx": 0.3, "base.ry": -0.2, "base.rz": 0.9, "base.tx": 1.0}
FRAME_2 = {"base.rx": -0.1, "base.rz": 0.4, "base.ty": -0.5, "tool.tz": 1e-3}
IN_TURN = {
    "self_weight": ({"g.z": -5.0}, {"g.x": 1.0, "g.z": -4.81}),
    "thermal_expansion": ({"j2": 2.34e-5}, {"j2": -1.14e-5, "tool": 1e-5}),
    "delayed_expansion": (
        {"j2": 2e-5, "j2.time_constant": 300.0},
        {"j2": -1e-5, "j2.time_constant": 300.0, "tool": 1e-5,
         "tool.time_constant": 90.0},
    ),
    "drive_compliance": ({"j1": 4e4}, {"j1": 9e4, "j2": 1e5}),
    "encoder_offset": ({"j1": 2e-4}, {"j1": -3e-4, "j3": 1e-4}),
    "encoder_eccentricity": (
        {"j1.amplitude": 2e-4, "j1.phase": 0.4},
        {"j1.amplitude": 3e-4, "j1.phase": 2.9, "j2.amplitude": 1e-4},
    ),
    "link_length": ({"tool": 1e-4}, {"tool": 5e-5, "j2": -1e-4}),
    "registration": (FRAME_1, FRAME_2),
    "device_scale": ({"factor": 1.001}, {"factor": 0.9995}),
    "body_mass": (
        {"tool.mass": 0.3, "tool.moment.x": 0.02}, {"tool.mass": -0.1, "j2.mass": 0.4}
    ),
    "modulus_scale": ({"j2": 0.8}, {"j2": 0.9, "tool": 1.2}),
    "friction_hysteresis": ({"j1": 2.0}, {"j1": 1.0, "j2": -0.5}),
    "load_gain": ({"factor": 1.2, "offset.fx": 3.0}, {"factor": 0.9, "offset.fy": 1.0}),
    "drift": (
        {"amplitude.tz": 1e-5, "time_constant": 600.0},
        {"amplitude.tz": 2e-5, "amplitude.rx": 1e-5, "time_constant": 600.0},
    ),
    "base_compliance": (
        {"stiffness.rx": 1e6, "stiffness.tz": 1e8},
        {"stiffness.rx": 3e6, "stiffness.tz": 2e8},
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def standing():
    """Return conditions of a robot with three elastic drives under load."""
    turning = {"joint": "revolute", "actuated": True, "joint_stiffness": SPRING}
    robot = Robot("arm", "tool", (
        Frame("j1", **turning),
        Frame("j2", "j1", [0.1, 0, 0.3], [np.pi / 2, 0, 0.3], link=TUBE, **turning),
        Frame("j3", "j2", [0.35, 0.1, 0], [0, np.pi / 3, 0], **turning),
        Frame("tool", "j3", [0.3, 0.05, 0.1], link=TUBE, mass=0.8),
    ))  # fmt: skip
    placed = place_robot(robot, joints={"j1": 0.3, "j2": -0.4, "j3": 0.6})
    given = {"temperature": 6.0, "time": 900.0, "approach": 1.0}
    load = np.array([1.0, -2.0, 0.5, 20.0, 30.0, -10.0])
    return as_declared(placed, load, gravity=[0, 0, -9.81], covariates=given)


@pytest.mark.parametrize("name", IN_TURN)
def test_combined_effect_equals_both_effects_in_sequence(name, standing):
    declared, found = ({name: values} for values in IN_TURN[name])
    in_turn = predict(apply_effects(apply_effects(standing, declared), found)).deviation
    once = predict(apply_effects(standing, combined(declared, found))).deviation
    change = np.abs(in_turn - predict(standing).deviation).max()
    assert change > 1e-6
    np.testing.assert_allclose(once, in_turn, rtol=0, atol=1e-9 * change + 1e-13)


def test_every_additive_effect_has_a_combination_case():
    """The list of cases contains every effect that can be combined."""
    others = {"joint_clearance", "contact_stiffening", "geometric_stiffening"}
    assert IN_TURN.keys() | others == LIBRARY.keys()


def test_combined_joint_clearances_are_their_sums():
    declared, found = {"a.radial": 1e-5}, {"a.radial": 2e-5, "a.tilt": 1e-4}
    both = combined({"joint_clearance": declared}, {"joint_clearance": found})
    assert both["joint_clearance"] == pytest.approx({"a.radial": 3e-5, "a.tilt": 1e-4})


def test_combination_does_not_change_effects_at_different_frames():
    declared = {"drift": {"amplitude.tz": 1e-5, "time_constant": 60.0}}
    found = {"encoder_offset": {"a": 1e-4}}
    assert combined(declared, found) == declared | found
    assert combined(declared, {}) == declared
    assert combined({}, found) == found


def test_effects_with_different_exponents_or_time_constants_cannot_be_combined():
    """There is no equivalent single effect."""
    law = {"a.coefficient": 1e7, "a.exponent": 1.5}
    slow, slower = ({"a": 1e-5, "a.time_constant": t} for t in (60.0, 90.0))
    with pytest.raises(ValueError, match="two delayed expansions"):
        combined({"delayed_expansion": slow}, {"delayed_expansion": slower})
    with pytest.raises(ValueError, match="two contact laws in series at one joint"):
        combined({"contact_stiffening": law}, {"contact_stiffening": law})
    other = {"b.coefficient": 2e7, "b.exponent": 2.0}
    both = combined({"contact_stiffening": law}, {"contact_stiffening": other})
    assert both == {"contact_stiffening": law | other}
    drifts = [{"drift": {"amplitude.tz": 1e-5, "time_constant": t}} for t in (60, 600)]
    with pytest.raises(ValueError, match="two drifts with different"):
        combined(*drifts)
