"""Effects of the library, compared with closed forms for a single-beam arm."""

from dataclasses import replace
from math import cos, exp, pi, sin

import numpy as np
import pytest
from scipy.optimize import brentq

from forcefit.assembly.effects import apply_effects
from forcefit.assembly.effects.friction_hysteresis import elastic_joints
from forcefit.assembly.effects.joint_clearance import moving_joints
from forcefit.assembly.kinematics.posture import place_robot, together
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import assemble_row, predict, read
from forcefit.assembly.measurement.variables import with_history
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot
from forcefit.assembly.robots import load_robot

L, RADIUS, E, NU, RHO = 0.8, 0.015, 70e9, 0.33, 2700.0
AREA, I = pi * RADIUS**2, pi * RADIUS**4 / 4
K = 4e4  # [N m/rad] stiffness of elastic drives
G = 9.81


def arm(stiffness=None, rigid=False, theory="euler"):
    """Return an arm with a drive about z and a beam along x."""
    beam = BeamLink({"radius": RADIUS}, E, NU, RHO, theory=theory)
    K_B = None
    if stiffness is not None:
        K_B = np.diag([np.inf, np.inf, stiffness, np.inf, np.inf, np.inf])
    return Robot("arm", "tip", (
        Frame("drive", joint="revolute", actuated=True, joint_stiffness=K_B),
        Frame("tip", "drive", [L, 0, 0], link=None if rigid else beam),
    ))  # fmt: skip


def here(robot, load=(0, 0, 0, 0, 0, 0), q=0.0, **covariates):
    posture = place_robot(robot, joints={"drive": q})
    return as_declared(posture, np.array(load, dtype=float), covariates=covariates)


def change(conditions, name, values):
    """Return the change of the reading due to an effect."""
    with_effect = predict(apply_effects(conditions, {name: values}))
    assert list(with_effect.reason) == [""] * len(conditions)
    return (with_effect.deviation - predict(conditions).deviation)[0]


def test_self_weight_deflection_equals_the_closed_form():
    """The deflection is q L^4 / 8 E I, and the slope q L^3 / 6 E I."""
    q = RHO * AREA * G
    seen = change(here(arm()), "self_weight", {"g.z": -G})
    expected = [0, q * L**3 / (6 * E * I), 0, 0, 0, -q * L**4 / (8 * E * I)]
    assert seen == pytest.approx(expected, rel=1e-12, abs=1e-18)


def test_thermal_expansion_increases_the_beam_length():
    seen = change(
        here(arm(), temperature=12.0, q=0.4), "thermal_expansion", {"tip": 23e-6}
    )
    dL = 23e-6 * 12.0 * L
    assert seen == pytest.approx([0, 0, 0, dL * cos(0.4), dL * sin(0.4), 0], abs=1e-18)


def test_drive_compliance_equals_rotation_divided_by_moment():
    F = 30.0
    seen = change(
        here(arm(rigid=True), (0, 0, 0, 0, F, 0)), "drive_compliance", {"drive": K}
    )
    assert seen == pytest.approx([0, 0, F * L / K, 0, F * L**2 / K, 0], rel=1e-6)


def test_base_compliance_includes_the_moment_of_the_force():
    F = 50.0
    stiff = {"stiffness.ry": 2e5, "stiffness.tz": 1e6}
    seen = change(here(arm(), (0, 0, 0, 0, 0, F)), "base_compliance", stiff)
    turn = -F * L / 2e5  # An upward force at the tip rotates the base about -y.
    expected = [0, turn, 0, 0, 0, F / 1e6 - turn * L]
    assert seen == pytest.approx(expected, rel=1e-6, abs=1e-12)


def test_arm_rotation_equals_the_encoder_offset():
    seen = change(here(arm(), q=0.7), "encoder_offset", {"drive": 1e-5})
    expected = [0, 0, 1e-5, -1e-5 * L * sin(0.7), 1e-5 * L * cos(0.7), 0]
    assert seen == pytest.approx(expected, rel=1e-4, abs=1e-10)


def test_encoder_eccentricity_adds_one_sine_period_per_turn():
    values = {"drive.amplitude": 2e-5, "drive.phase": 0.9}
    for q in (-1.2, 0.0, 2.0):
        seen = change(here(arm(), q=q), "encoder_eccentricity", values)
        assert seen[2] == pytest.approx(2e-5 * sin(q + 0.9), rel=1e-9, abs=1e-18)


@pytest.mark.parametrize("frame", ["drive", "tip"])
def test_body_without_a_beam_expands_along_its_joint_line(frame):
    """The bar is at an angle of 0.4 rad."""
    robot = arm(rigid=True)
    first = replace(robot.frames[0], translation=np.array([0, 0, 0.3]))
    robot = replace(robot, frames=(first, robot.frames[1]))
    grown = {"drive": [0, 0, 0.3], "tip": [L * cos(0.4), L * sin(0.4), 0]}[frame]
    there = here(robot, temperature=12.0, q=0.4)
    warm = change(there, "thermal_expansion", {frame: 23e-6})
    assert warm == pytest.approx([0, 0, 0, *(23e-6 * 12 * np.array(grown))], abs=1e-18)
    longer = change(there, "link_length", {frame: 1e-4})
    unit = np.array(grown) / np.linalg.norm(grown)
    assert longer == pytest.approx([0, 0, 0, *(1e-4 * unit)], abs=1e-18)


def test_delayed_expansion_equals_the_lagged_temperature():
    """For a ramp r t, the body temperature is r (t - T + T exp(-t/T))."""
    time, late = np.array([0.0, 50.0, 80.0, 300.0]), 100.0
    rows = together([place_robot(arm(), joints={"drive": 0.0})] * 4)
    covariates = {"temperature": 5.0 + 0.02 * time, "time": time}
    there = with_history(as_declared(rows, covariates=covariates))
    values = {"tip": 20e-6, "tip.time_constant": late}
    warm = apply_effects(there, {"delayed_expansion": values})
    seen = (predict(warm).deviation - predict(there).deviation)[:, 3]
    kelvin = 5.0 + 0.02 * (time - late + late * np.exp(-time / late))
    assert seen == pytest.approx(20e-6 * L * kelvin, rel=1e-12)


def test_device_scale_multiplies_positions_from_the_device_origin():
    """The device origin is at (-1, 0, 0), and its axes are rotated by 90 degrees."""
    there = here(arm(), q=0.4)
    seen = change(there, "device_scale", {"factor": 1.001})
    at = np.array([L * cos(0.4), L * sin(0.4), 0])
    assert seen == pytest.approx([0, 0, 0, *(1e-3 * at)], abs=1e-15)
    turned = replace(there, base=np.array([0, 0, pi / 2, 0, 1, 0]))
    seen = change(turned, "device_scale", {"factor": 1.001})
    assert seen[3:] == pytest.approx(1e-3 * np.array([-at[1], 1 + at[0], 0]), abs=1e-12)


def test_deflection_due_to_body_mass_equals_the_closed_form():
    """The deflection is m g L^3/3 E I, plus m c g L^2/2 E I for an offset c."""
    there = replace(here(arm()), gravity=np.array([[0, 0, -G]]))
    seen = change(there, "body_mass", {"tip.mass": 3.0})
    assert seen[5] == pytest.approx(-3.0 * G * L**3 / (3 * E * I), rel=1e-9)
    seen = change(there, "body_mass", {"tip.moment.x": 0.2})
    assert seen[5] == pytest.approx(-0.2 * G * L**2 / (2 * E * I), rel=1e-6)


def test_registration_applies_a_finite_rotation_and_translation():
    """The measured point is p' = R p + t."""
    b, t = 0.3, np.array([0.01, -0.02, 0.03])
    values = {"base.rz": b, "base.tx": t[0], "base.ty": t[1], "base.tz": t[2]}
    seen = change(here(arm(), q=0.5), "registration", values)
    p = L * np.array([cos(0.5), sin(0.5), 0])
    R = np.array([[cos(b), -sin(b), 0], [sin(b), cos(b), 0], [0, 0, 1]])
    expected = [0, 0, b, *(R @ p + t - p)]
    assert seen == pytest.approx(expected, rel=1e-12, abs=1e-15)
    tool = change(here(arm(), q=0.5), "registration", {"tool.tx": 1e-3})
    assert tool[3:] == pytest.approx([1e-3 * cos(0.5), 1e-3 * sin(0.5), 0], abs=1e-15)


def test_modulus_scale_divides_the_bending_deflection():
    F, factor = 20.0, 0.8
    seen = change(here(arm(), (0, 0, 0, 0, F, 0)), "modulus_scale", {"tip": factor})
    bent = F * L**3 / (3 * E * I)
    assert seen[4] == pytest.approx(bent * (1 / factor - 1), rel=1e-6)


def test_load_moves_a_joint_to_the_bound_of_its_clearance():
    """The joint moves by the radial clearance and the tilt clearance."""
    values = {"drive.radial": 2e-5, "drive.axial": 1e-5, "drive.tilt": 3e-5}
    # The forces along y and z cause the moment (0, -Fz L, Fy L) at the drive.
    seen = change(
        here(arm(rigid=True), (0, 0, 0, 0, 3.0, 4.0)), "joint_clearance", values
    )
    expected = [0, -3e-5, 0, 0, 2e-5, 1e-5 + 3e-5 * L]
    assert seen == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_reading_with_unloaded_clearance_is_undetermined():
    values = {"joint_clearance": {"drive.radial": 2e-5}}
    found = predict(apply_effects(here(arm(rigid=True)), values))
    assert found.undetermined.all()
    assert found.deviation == pytest.approx(0.0, abs=1e-18)


def test_friction_rotates_the_drive_against_the_approach():
    for approach in (-1.0, 1.0):
        seen = change(
            here(arm(K), approach=approach), "friction_hysteresis", {"drive": 2.0}
        )
        assert seen[2] == pytest.approx(-2.0 * approach / K, rel=1e-9)


def test_effects_on_a_helical_drive_move_the_nut_along_its_thread():
    """A rotation of the nut translates it by the lead times the angle."""
    lead, F = 0.004 / (2 * pi), 500.0
    K_B = np.diag([np.inf, np.inf, K, np.inf, np.inf, np.inf])
    drive = Frame("drive", joint="helical", pitch=0.004, actuated=True)
    rigid = Robot("screw", "tip", (drive, Frame("tip", "drive")))
    soft = replace(rigid, frames=(replace(drive, joint_stiffness=K_B), rigid.frames[1]))
    loaded = here(rigid, (0, 0, 0, 0, 0, F))
    for conditions, name, values, angle in (
        (here(rigid), "encoder_offset", {"drive": 1e-5}, 1e-5),
        (loaded, "drive_compliance", {"drive": K}, F * lead / K),
        (here(soft, approach=1.0), "friction_hysteresis", {"drive": 2.0}, -2.0 / K),
    ):
        seen = change(conditions, name, values)
        assert seen == pytest.approx(
            [0, 0, angle, 0, 0, angle * lead], rel=1e-9, abs=1e-18
        )


@pytest.mark.parametrize("exponent", [1.5, 2.0, 3.0])
def test_contact_deflection_equals_the_power_law(exponent):
    F, c = -25.0, 1e7
    values = {"drive.coefficient": c, "drive.exponent": exponent}
    seen = change(
        here(arm(rigid=True), (0, 0, 0, 0, F, 0)), "contact_stiffening", values
    )
    assert seen[2] == pytest.approx(-((abs(F) * L / c) ** (1 / exponent)), rel=1e-9)


def test_load_gain_multiplies_the_recorded_load():
    F = 20.0
    values = {"factor": 1.1, "offset.fz": 5.0}
    seen = change(here(arm(), (0, 0, 0, 0, F, 0)), "load_gain", values)
    give = L**3 / (3 * E * I)
    assert seen[4:] == pytest.approx([0.1 * F * give, 5.0 * give], rel=1e-4)


def test_rod_angle_with_geometric_stiffening_satisfies_equilibrium():
    """A rigid rod on a torsion spring satisfies k a = F L cos a - P L sin a."""
    P, F = 4e4, 200.0
    seen = change(
        here(arm(K, rigid=True), (0, 0, 0, P, F, 0)), "geometric_stiffening", {}
    )
    a = brentq(lambda a: F * L * cos(a) - P * L * sin(a) - K * a, 0, 0.1, xtol=1e-15)
    assert seen[2] == pytest.approx(a - F * L / K, rel=1e-9)


def test_drift_approaches_its_amplitude_exponentially():
    values = {"amplitude.tx": 1e-5, "amplitude.ry": 2e-5, "time_constant": 100.0}
    seen = change(here(arm(), time=50.0), "drift", values)
    part = 1 - exp(-0.5)
    assert seen == pytest.approx([0, 2e-5 * part, 0, 1e-5 * part, 0, 0], abs=1e-18)


# parameters of the effects that are compared with the cone solver
CASES = {
    "drive_compliance": {"leg1.drive": 3e4, "leg2.drive": 5e4},
    "self_weight": {"g.x": 1.0, "g.z": -G},
    "contact_stiffening": {"leg2.drive.coefficient": 1e7, "leg2.drive.exponent": 1.5},
    "base_compliance": {"stiffness.rx": 1e6, "stiffness.tz": 1e8},
    "encoder_offset": {"leg3.drive": 1e-4},
    "load_gain": {"factor": 1.2, "offset.fx": 3.0},
}


@pytest.fixture(scope="module")
def parallel():
    """Return a 3-RRR robot with elastic links at two postures under loads."""
    robot = load_robot("3rrr")
    beam = BeamLink({"radius": 0.012, "inner_radius": 0.008}, 70e9, 0.33, 2700.0)
    links = {
        f.name: beam
        for f in robot.frames
        if f.name.endswith(("elbow", "wrist")) and np.linalg.norm(f.translation) > 0
    }
    robot = robot.with_links(links)
    rng = np.random.default_rng(3)
    robot = robot.with_errors(1e-4 * rng.standard_normal(robot.errors.shape))
    drives = [f.name for f in robot.frames if f.actuated]
    placed = [
        place_robot(robot, joints={n: robot.frame(n).position + d for n in drives})
        for d in (0.0, 0.05)
    ]
    load = rng.normal(0, 20, (2, 6))
    return as_declared(together(placed), load, point=[0.02, 0.0, 0.05])


@pytest.mark.parametrize("name", CASES)
def test_effects_on_many_measurements_agree_with_the_cone_solver(name, parallel):
    there = apply_effects(parallel, {name: CASES[name]})
    fast = predict(there).deviation
    slow = read(
        there, np.array([assemble_row(there, i).platform_screw for i in (0, 1)])
    )
    moved = np.abs(fast - predict(parallel).deviation).max()
    assert moved > 1e-7
    assert np.abs(fast - slow).max() < 1e-7 * np.abs(fast).max()


def test_friction_and_slip_are_limited_to_suitable_joints():
    """Friction requires a joint spring, and slip a joint without clearance."""
    own = np.diag([np.inf, np.inf, 0.4, np.inf, np.inf, np.inf])
    robot = Robot("chain", "tip", (
        Frame("soft", joint="revolute", actuated=True, joint_stiffness=own),
        Frame("rigid", "soft", joint="revolute", actuated=True,
              clearance=Clearance(radial=0.0, spin=1e-3)),
        Frame("loose", "rigid", joint="revolute", actuated=True,
              clearance=Clearance(radial=0.0, tilt=1e-4)),
        Frame("tip", "loose", joint_stiffness=own),
    ))  # fmt: skip
    assert elastic_joints(robot) == ("soft",)
    assert moving_joints(robot) == ("soft", "rigid")
