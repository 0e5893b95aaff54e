"""Tests of effects in a robot file along a path."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import Frame, Robot, place_robot, platform_stiffness, solve_assembly
from forcefit.assembly.effects.robot_effects import apply_robot_effects
from forcefit.assembly.model.function import Function
from forcefit.assembly.path.path_errors import path_errors
from forcefit.inputs.table import BadInput
from tests.assembly.path.moving_robots_for_tests import (
    at_one_instant,
    hinge,
    instants,
    rod,
)
from tests.assembly.path.test_path_errors import heavy
from tests.tolerances_for_tests import without_clearances

MASS, LENGTH, ALPHA = 2.0, 0.5, 40.0
TORQUE = MASS * LENGTH**2 / 3 * ALPHA  # [N m] torque that accelerates a thin rod
GRAVITY = [0.0, -9.81, 0.0]
LOAD = [5.0, 0, 0, 100.0, -40.0, -200.0]
WARM = {"temperature": 8.0, "time": 60.0}
EFFECTS = {
    "self_weight": {"g.z": -9.81},
    "thermal_expansion": {"leg1.link_a": 2e-5},
    "delayed_expansion": {"leg2.link_a": 2e-5, "leg2.link_a.time_constant": 600.0},
    "drive_compliance": {"leg2.drive": 4e4},
    "encoder_offset": {"leg1.drive": 1e-4},
    "encoder_eccentricity": {"leg1.drive.amplitude": 2e-4, "leg1.drive.phase": 0.5},
    "link_length": {"leg1.link_a": 1e-5},
    "registration": {"base.rx": 1e-3},
    "device_scale": {"factor": 1.001},
    "modulus_scale": {"leg1.link_a": 0.9},
    "body_mass": {"platform.mass": 0.4},
    "contact_stiffening": {"leg1.drive.coefficient": 3e6, "leg1.drive.exponent": 1.5},
    "load_gain": {"factor": 1.1, "offset.fz": -3.0},
    "drift": {"amplitude.tz": 1e-5, "time_constant": 600.0},
    "base_compliance": {"stiffness.rz": 5e4, "stiffness.tx": 4e6},
}
SOFT = Function(
    "leg2.drive", ("rz",), ("q.leg2.drive",), "powers", {"0": 1e-6, "1": 2e-6},
    kind="compliance",
)  # fmt: skip
SPRING = {"drive_compliance": {"hub": 4e3}}
CONTACT = {"contact_stiffening": {"hub.coefficient": 1e6, "hub.exponent": 1.5}}
ERRORS = ("encoder_offset", "link_length", "thermal_expansion")


def arm(**other):
    """Return a rod on an actuated hinge about z."""
    tip = Frame("arm", "hub", [LENGTH, 0, 0], **rod(MASS, LENGTH))
    return Robot("arm", "arm", (hinge("hub"), tip), **other)


def turned(robot, **given):
    """Return the rotation error [rad] of the rod due to its acceleration."""
    found = path_errors(robot, at_one_instant(0.0, ALPHA), **given)
    assert found.status[0] == "ok"
    return found.inertial[0, 2]


@pytest.mark.parametrize(
    ("effects", "rotation"),
    [
        (SPRING, TORQUE / 4e3),
        ({"base_compliance": {"stiffness.rz": 2e3}}, TORQUE / 2e3),
        (
            SPRING | {"base_compliance": {"stiffness.rz": 2e3}},
            TORQUE / 4e3 + TORQUE / 2e3,
        ),
        (CONTACT, (TORQUE / 1e6) ** (1 / 1.5)),
        # an additional mass of 1 kg at the middle of the rod
        (
            SPRING | {"body_mass": {"arm.mass": 1.0, "arm.moment.x": -LENGTH / 2}},
            (TORQUE + 1.0 * (LENGTH / 2) ** 2 * ALPHA) / 4e3,
        ),
    ],
)
def test_rotation_of_accelerated_rod_equals_torque_over_stiffness(effects, rotation):
    assert turned(arm(effects=effects)) == pytest.approx(-rotation, rel=1e-9)


@pytest.mark.parametrize("state", ["nominal", "contact", "exact"])
def test_deflection_equals_compliance_function_times_torque(state):
    """At q = 0.5, the compliance of the drive is 1e-6 + 2e-6 q = 2e-6 rad/(N m)."""
    soft = Function("hub", ("rz",), ("q.hub",), "powers", {"0": 1e-6, "1": 2e-6},
                    kind="compliance")  # fmt: skip
    path = at_one_instant(0.0, ALPHA, 0.5)
    found = path_errors(arm(functions=(soft,)), path, state=state)
    assert found.inertial[0, 2] == pytest.approx(-TORQUE * 2e-6, rel=1e-9)
    assert found.arrays["drive_force"][0, 0] == pytest.approx(TORQUE, rel=1e-9)
    assert found.arrays["compliance"][0, 2, 2] == pytest.approx(2e-6, rel=1e-9)


def test_first_frequency_includes_drive_compliance():
    robot = arm(effects=SPRING)
    path = instants(["q.hub"], [[0.0], [0.1]], [[0.0]] * 2, [[0.0]] * 2)
    expected = np.sqrt(4e3 / (TORQUE / ALPHA)) / (2 * np.pi)
    assert path_errors(robot, path).frequency == pytest.approx(expected, rel=1e-9)


def test_geometric_effects_do_not_change_inertial_deflection():
    """Thermal expansion and a length error do not change the inertial loads."""
    lengths = {"link_length": {"arm": 3e-5}, "thermal_expansion": {"arm": 1e-5}}
    found = path_errors(arm(effects=SPRING | lengths), at_one_instant(0.0, ALPHA),
                        under={"temperature": 8.0})  # fmt: skip
    longer = found.arrays["platform_screw"][0, 3]
    assert longer == pytest.approx(1e-5 * LENGTH * 8.0 + 3e-5, rel=1e-12)
    assert found.inertial[0, 2] == pytest.approx(-TORQUE / 4e3, rel=1e-9)


def test_time_of_effects_equals_start_time_plus_path_time():
    growing = Function("arm", ("tx",), ("time",), "powers", {"1": 1e-6})
    path = instants(["q.hub"], [[0.0]] * 3, [[0.0]] * 3, [[0.0]] * 3)
    path = replace(path, times=np.array([5.0, 6.0, 8.0]))
    found = path_errors(arm(functions=(growing,)), path, under={"time": 100.0})
    np.testing.assert_allclose(
        found.arrays["platform_screw"][:, 3], [100e-6, 101e-6, 103e-6], rtol=1e-12
    )


def at_rest(robot, gravity=None, load=None, **given):
    """Return the errors along a path at zero speed, and those of its postures."""
    values = np.array([[-0.05, -0.5], [0.0, -0.45], [0.06, -0.42]])
    path = instants(["tx", "tz"], values, np.zeros((3, 2)), np.zeros((3, 2)))
    found = path_errors(robot, path, gravity=gravity, load=load, under=WARM, **given)
    poses = [{"tx": tx, "tz": tz} for tx, tz in values.tolist()]
    postures = [place_robot(robot, pose=pose) for pose in poses]
    applied = [apply_robot_effects(p, load, gravity, WARM) for p in postures]
    return found, applied


@pytest.mark.parametrize("name", [*EFFECTS, "all", "function"])
def test_errors_at_zero_speed_equal_errors_at_rest(name):
    effects = (
        EFFECTS if name == "all" else {k: EFFECTS[k] for k in EFFECTS if k == name}
    )
    functions = (SOFT,) if name in {"all", "function"} else ()
    robot = replace(
        without_clearances(heavy("irsbot2")), effects=effects, functions=functions
    )
    found, applied = at_rest(robot, GRAVITY, LOAD)
    for i, one in enumerate(applied):
        alone = solve_assembly(one.posture, one.load, gravity=one.gravity)
        screw = found.arrays["platform_screw"][i]
        scale = np.abs(alone.platform_screw).max()
        np.testing.assert_allclose(screw, alone.platform_screw, atol=1e-12 * scale)
        assert found.arrays["energy"][i] == pytest.approx(alone.energy, rel=1e-9)
        nominal = platform_stiffness(one.posture).compliance
        if "contact_stiffening" not in effects:
            np.testing.assert_allclose(
                found.arrays["compliance"][i], nominal,
                atol=1e-12 * np.abs(nominal).max(),
            )  # fmt: skip
    np.testing.assert_array_equal(found.inertial, 0.0)


def test_energies_at_zero_speed_equal_energies_at_rest():
    """The energies are compared, because clearances make the pose undetermined."""
    effects = {name: EFFECTS[name] for name in ERRORS}
    robot = replace(heavy("irsbot2"), effects=effects)
    found, applied = at_rest(robot, assumption="frozen")
    energies = [solve_assembly(one.posture).energy for one in applied]
    np.testing.assert_allclose(found.arrays["energy"], energies, rtol=1e-12, atol=1e-15)
    assert (found.status == "ok").all()


def test_self_weight_effect_equals_gravity_option():
    path = at_one_instant(2.0, ALPHA, 0.3)
    weight = {"self_weight": {"g.y": -9.81}}
    known = path_errors(arm(effects=SPRING | weight), path).arrays
    asked = path_errors(arm(effects=SPRING), path, gravity=GRAVITY).arrays
    for name in ("platform_screw", "wrench", "drive_force"):
        np.testing.assert_array_equal(known[name], asked[name])


LAG = Function("arm", ("tx",), ("cov.oil",), "lag",
               {"gain": 1e-6, "time_constant": 60.0})  # fmt: skip
APPROACH = Function("arm", ("tx",), ("approach",), "powers", {"1": 1.0})


@pytest.mark.parametrize(
    ("changes", "options", "message"),
    [
        ({"effects": {"friction_hysteresis": {"hub": 1.0}}}, {},
         '"friction_hysteresis" depends on the direction of approach'),
        ({"effects": {"geometric_stiffening": {}}}, {},
         '"geometric_stiffening" is defined for finite motions'),
        ({"effects": {"thermal_expansion": {"arm": 1e-5}}}, {},
         "depends on temperature"),
        ({"functions": (APPROACH,)}, {},
         "arm tx of approach.* depends on the direction of approach"),
        ({"functions": (LAG,)}, {},
         '"arm tx of cov.oil" has the form "lag", which depends on earlier rows'),
        ({"effects": CONTACT}, {"state": "contact"}, 'nonlinear law at frame "hub"'),
        ({}, {"under": {"heat": 1.0}}, '--under: unknown covariate "heat"'),
    ],
)  # fmt: skip
def test_unsupported_effect_or_covariate_is_rejected(changes, options, message):
    with pytest.raises(BadInput, match=message):
        path_errors(arm(**changes), at_one_instant(0.0, ALPHA), **options)
