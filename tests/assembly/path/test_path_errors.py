"""Tests of the errors along a path."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import load_robot, platform_stiffness
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import (
    POSE,
    home_posture,
    place_many,
    together,
)
from forcefit.assembly.model.robot import BeamLink, Clearance, Frame, Robot, beam_axis
from forcefit.assembly.path.motion import follow_path
from forcefit.assembly.path.path_errors import path_errors
from forcefit.assembly.path.path_file import PathTable
from forcefit.assembly.path.report import path_page
from forcefit.assembly.path.summary import path_summary
from forcefit.assembly.path.trajectory import Trajectory, profiled
from forcefit.assembly.sweeps.targets import goals_of
from forcefit.page.page import Provenance
from forcefit.stiffness.beam.sections import declared_section
from tests.assembly.path.moving_robots_for_tests import (
    GRAVITY,
    at_one_instant,
    hinge,
    instants,
    rod,
)
from tests.assembly.path.test_motion import CASES, path_of
from tests.tolerances_for_tests import without_clearances

GRAVITY_ALONG_Z = [0.0, 0.0, -9.81]


def heavy(name, density=2700.0, mass=1.5):
    """Return a built-in robot whose beams and platform have a mass."""
    robot = load_robot(name)
    frames = []
    for frame in robot.frames:
        if isinstance(frame.link, BeamLink):
            frame = replace(frame, link=replace(frame.link, density=density or None))
        if frame.name == robot.platform:
            frame = replace(frame, mass=mass, centre_of_mass=[0.01, -0.02, 0.03],
                            inertia=np.diag([1e-3, 2e-3, 2.5e-3]))  # fmt: skip
        frames.append(frame)
    return replace(robot, frames=tuple(frames))


def energy(motion, gravity):
    """Return the kinetic plus potential energy of all bodies, (k,)."""
    robot, T = motion.postures.robot, motion.postures.transforms
    total = np.zeros(len(T))
    for i, frame in enumerate(robot.frames):
        R, p, V = T[:, i, :3, :3], T[:, i, :3, 3], motion.twists[:, i]
        bodies = [(frame.mass, p + R @ frame.centre_of_mass, frame.inertia)]
        if isinstance(frame.link, BeamLink) and frame.link.density:
            length, axis = beam_axis(frame)
            section = declared_section(frame.link.section, frame.link.poisson)
            mass = frame.link.density * section.area * length
            assert section.I_y == pytest.approx(section.I_z)
            turning = frame.link.density * section.I_y * length
            across = np.eye(3) - np.outer(axis, axis)
            inertia = (mass * length**2 / 12 + turning) * across
            inertia += 2 * turning * np.outer(axis, axis)
            bodies.append((mass, p - length / 2 * R @ axis, inertia))
        for mass, centre, inertia in bodies:
            velocity = V[:, 3:] + np.cross(V[:, :3], centre)
            spin = np.einsum("kji,kj->ki", R, V[:, :3])
            total += mass / 2 * np.sum(velocity**2, axis=1) - mass * centre @ gravity
            total += np.einsum("ki,ij,kj->k", spin, inertia, spin) / 2
    return total


@pytest.mark.parametrize("name", ["irsbot2", "hexapod", "delta", "arm6"])
def test_drive_power_equals_energy_rate(name):
    """The rate of kinetic and potential energy is computed by finite differences."""
    robot, names = heavy(name), CASES[name]
    pose = home_posture(robot).pose()
    home, h = np.array([pose[one] for one in names]), 2e-3
    times = 0.4 + h * np.arange(-2, 3)
    path = path_of(names, home, times)
    postures, _ = place_many(robot, goals_of(names, robot, path[0]))
    motion = follow_path(together(postures), names, path)
    E = energy(motion, GRAVITY)
    rate = (8 * (E[3] - E[1]) - (E[4] - E[0])) / (12 * h)
    way = Trajectory(names, times, *path, "times")
    found = path_errors(robot, way, gravity=GRAVITY)
    driven = [f.actuated for f in robot.frames]
    power = found.arrays["drive_force"][2] @ motion.rates[2, driven]
    assert (found.status == "ok").all()
    assert abs(rate) > 1e-3
    assert power == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("name", ["hexapod", "five_bar"])
def test_inertial_deflection_equals_compliance_times_inertial_wrench(name):
    """The deflection is the product of C and the d'Alembert wrench of the platform."""
    robot, names = heavy(name, density=0.0), CASES[name]
    tight = without_clearances(robot)
    pose = home_posture(tight).pose()
    path = path_of(names, np.array([pose[one] for one in names]), np.array([0.3]))
    found = path_errors(tight, Trajectory(names, np.zeros(1), *path, "times"))
    arrays, frame = found.arrays, tight.frame(tight.platform)
    R = arrays["platform"][0, :3, :3]
    omega = arrays["platform_velocity"][0, :3]
    alpha, of_origin = np.split(arrays["platform_acceleration"][0], 2)
    c, J = R @ frame.centre_of_mass, R @ frame.inertia @ R.T
    a = of_origin + np.cross(alpha, c)
    force = -frame.mass * (a + np.cross(omega, np.cross(omega, c)))
    moment = np.cross(c, force) - J @ alpha - np.cross(omega, J @ omega)
    place, _ = place_many(tight, goals_of(names, tight, path[0]))
    C = platform_stiffness(place[0]).compliance
    expected = C @ np.r_[moment, force]
    tol = 1e-8 * np.abs(expected).max()
    np.testing.assert_allclose(arrays["inertial_screw"][0], expected, atol=tol)
    size = np.sqrt(np.outer(np.diag(C), np.diag(C)))
    np.testing.assert_allclose(arrays["compliance"][0] / size, C / size, atol=1e-9)


def test_deflection_is_proportional_to_squared_speed():
    """If the duration is halved, the deflection is multiplied by four."""
    tight = without_clearances(heavy("five_bar"))
    table = PathTable(("tx", "ty"), np.array([[0.0, 0.14], [0.02, 0.13]]))
    slow, fast = (
        path_errors(tight, profiled(table, 21, "quintic", 1.0, duration=T))
        for T in (0.2, 0.1)
    )
    np.testing.assert_allclose(fast.inertial, 4 * slow.inertial, rtol=1e-8, atol=1e-15)
    assert fast.periods == pytest.approx(slow.periods / 2)
    table = fast.to_pandas()
    np.testing.assert_allclose(table.index, np.linspace(0, 0.1, 21))
    np.testing.assert_array_equal(table["inertial_screw"], fast.inertial)


def test_clearance_adds_to_deflection_of_accelerated_arm():
    """A mass with a radial clearance of 10 um moves outward by 10 um."""
    link = BeamLink({"radius": 0.01}, 70e9, 0.3)
    joint = Clearance(radial=1e-5)
    frames = (
        hinge("hub"), Frame("arm", "hub", [0.3, 0, 0], link=link, clearance=joint),
        Frame("tool", "arm", [0.0, 0, 0], mass=0.5),
    )  # fmt: skip
    robot, path = Robot("arm", "tool", frames), at_one_instant(50.0)
    found = path_errors(robot, path)
    force = 0.5 * 50.0**2 * 0.3
    moved = force * 0.3 / (70e9 * np.pi * 0.01**2) + 1e-5
    assert found.arrays["platform_screw"][0, 3] == pytest.approx(moved, rel=1e-6)
    frozen = path_errors(robot, path, assumption="frozen")
    lower, upper = frozen.arrays["translation_error"][0]
    assert lower - 1e-9 <= moved <= upper


def test_robot_without_mass_and_unknown_assumption_are_rejected():
    path = at_one_instant(1.0)
    frames = (hinge("hub"), Frame("arm", "hub", [0.3, 0, 0]))
    with pytest.raises(ValueError, match="found no moving mass"):
        path_errors(Robot("arm", "arm", frames), path)
    heavy_arm = (frames[0], Frame("arm", "hub", [0.3, 0, 0], **rod(1.0, 0.3)))
    with pytest.raises(ValueError, match='--assumption: found "frosen"'):
        path_errors(Robot("arm", "arm", heavy_arm), path, assumption="frosen")


def test_path_duration_equals_closed_form_for_peak_acceleration():
    """The peak acceleration of the quintic profile is 10/sqrt(3) D/T^2."""
    robot = heavy("irsbot2")
    table = PathTable(("tx", "tz"), np.array([[-0.05, -0.5], [0.05, -0.5]]))
    path = profiled(table, 101, "quintic", 1.0, acceleration=20 * 9.80665)
    assert path.duration == pytest.approx(np.sqrt(10 / 3**0.5 * 0.1 / (20 * 9.80665)))
    assert path.duration == pytest.approx(54.2e-3, abs=0.1e-3)
    found = path_errors(robot, path)
    speed = np.linalg.norm(found.arrays["platform_velocity"][:, 3:], axis=1)
    assert speed.max() == pytest.approx(3.46, abs=0.01)
    # robot and path are symmetric about x = 0
    mirrored = found.inertial[::-1] * [1, -1, -1, -1, 1, 1]
    size = np.abs(found.inertial).max()
    np.testing.assert_allclose(mirrored, found.inertial, atol=1e-6 * size)


def test_deflection_without_equilibrium_at_rest_is_unknown():
    """A rod falls from the horizontal position.  The force on its hinge is m g / 4."""
    rail = Frame("rail", rotation=[0.0, np.pi / 2, 0.0], joint="prismatic",
                 actuated=True)  # fmt: skip
    cart = Frame("cart", "rail", rotation=[0.0, -np.pi / 2, 0.0], mass=1.0)
    pin = Frame("pin", "cart", joint="revolute")
    bob = Frame("bob", "pin", [0.5, 0.0, 0.0], **rod(2.0, 0.5))
    robot = Robot("crane", "cart", (rail, cart, pin, bob))
    errors = path_errors(robot, instants(["q.rail"], [[0.0]], [[0.0]], [[0.0]]),
                         gravity=GRAVITY)  # fmt: skip
    summary = path_summary(errors)
    assert summary["status"] == "ok"
    assert summary["largest"]["force"]["value"] == pytest.approx(4.905 + 9.81)
    assert "inertial_translation" not in summary["largest"]
    assert any("no equilibrium at rest" in one for one in summary["remarks"])
    assert "unknown" in path_page(summary, errors, Provenance())


SPHERICAL_ENDS = """
format = 2
platform = "plate"
platform_at = [0, 0, 0.5]
body = [{ name = "plate", mass = 3.0, centre = [0, 0, 0.5] }]
"""
LEG = """
[[leg]]
name = "leg{name}"
repeat = {{ count = 3, about = [0, 0, 1] }}
body = [{{ name = "nut" }}, {{ name = "screw", mass = {mass}, centre = {middle}, inertia = {inertia} }}]
joint = [
    {{ name = "low", type = "{kind}", between = ["base", "nut"], at = {low}, {axes} }},
    {{ name = "drive", type = "prismatic", between = ["nut", "screw"], at = {low}, axis = {along}, actuated = true }},
    {{ name = "top", type = "spherical", between = ["screw", "plate"], at = {top} }},
]
"""  # noqa: E501


def six_legs(file, kind, mass=0.0, across=0.0, about=0.0):
    """Return a Gough platform with six heavy legs, and the vector along a leg.

    The moments of inertia of a leg across and about its axis are in kg m^2.
    """
    text = SPHERICAL_ENDS
    for name, below, above in (("a", 10, 50), ("b", 110, 70)):
        low, top = (
            np.array([r * np.cos(np.radians(at)), r * np.sin(np.radians(at)), z])
            for r, at, z in ((0.5, below, 0.0), (0.25, above, 0.5))
        )
        along = top - low
        first = np.cross(along, [0.0, 0.0, 1.0])
        second = np.cross(along, first)
        axes = f"axis = {first.tolist()}, axis2 = {second.tolist()}"
        u = along / np.linalg.norm(along)
        J = across * np.eye(3) + (about - across) * np.outer(u, u)
        inertia = [*np.diag(J).tolist(), *J[np.triu_indices(3, 1)].tolist()]
        text += LEG.format(
            name=name, kind=kind, mass=mass, axes=axes, low=low.tolist(),
            top=top.tolist(), along=along.tolist(), middle=(low + 0.7 * along).tolist(),
            inertia=inertia,
        )  # fmt: skip
    file.write_text(text)
    return read_robot(file), along


def forces_of_six_legs(robot):
    """Return the drive forces of an accelerated Gough platform, (6,)."""
    pose, rate, second = [0.05, -0.02, 0.55, 0.1, -0.1, 0.2], [0.5] * 6, [-3.0] * 6
    path = instants(POSE, [pose], [rate], [second])
    return path_errors(robot, path, gravity=GRAVITY_ALONG_Z).arrays["drive_force"][0]


def test_drive_forces_of_gough_platform_equal_closed_form(tmp_path):
    """Each force is m (g + a) / (6 cos b) for an angle b between the legs and z."""
    robot, along = six_legs(tmp_path / "six_sps.toml", "spherical")
    pose = [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]
    path = instants(POSE, [pose], [np.zeros(6)], [[0, 0, 5.0, 0, 0, 0]])
    errors = path_errors(robot, path, gravity=GRAVITY_ALONG_Z)
    expected = 3.0 * (9.81 + 5.0) / (6 * along[2] / np.linalg.norm(along))
    np.testing.assert_allclose(errors.arrays["drive_force"][0], expected, rtol=1e-9)


@pytest.mark.parametrize(
    "legs",
    [
        (("spherical", 0.8), ("universal", 0.8)),
        (("spherical", 0.8, 0.02, 0.0), ("spherical", 0.8, 0.02, 0.02)),
    ],
    ids=["joints", "axial inertia"],
)
def test_drive_forces_do_not_depend_on_spin_of_legs(tmp_path, legs):
    """The legs can spin between ball joints, but not on universal joints. They do not
    spin, so forces do not depend on their axial inertia.
    """
    one, other = (
        forces_of_six_legs(six_legs(tmp_path / "six.toml", *leg)[0]) for leg in legs
    )
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_screw_torque_equals_slide_force_times_lead(tmp_path):
    """The torque of a screw is the product of h = pitch / 2 pi and the force.

    The screw has no moment of inertia about its axis.
    """
    file = tmp_path / "six.toml"
    slides, _ = six_legs(file, "universal", mass=0.8)
    screw = 'type = "helical", pitch = 0.01'
    file.write_text(file.read_text().replace('type = "prismatic"', screw))
    force, torque = map(forces_of_six_legs, (slides, read_robot(file)))
    np.testing.assert_allclose(torque, 0.01 / (2 * np.pi) * force, rtol=1e-9)
