"""Properties of all built-in robots."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.reference.as_printed import energy_as_printed
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.links import joint_compliances
from forcefit.assembly.model.random_errors import frames_named
from forcefit.assembly.model.robot import BeamLink, Robot, beam_axis
from forcefit.assembly.robots import BUILT_IN, load_robot
from forcefit.assembly.robots.irsbot2 import ERROR_FRAMES
from forcefit.inputs.table import BadInput
from tests.built_in_robots_for_tests import (
    LOAD,
    WORKSPACE,
    drive_jacobian,
    drives,
    joints_of,
    only_drives_give,
    platform_compliance,
    random_pose,
)

# published degrees of freedom with free and with locked drives, and overconstraint
COUNTS = {
    "irsbot2": (2, 0, 8),  # 8 = 2 x 3 of parallelograms + 2 of legs
    "four_bar": (1, 0, 3),  # one planar loop
    "five_bar": (2, 0, 3),  # one planar loop
    "3rrr": (3, 0, 6),  # two planar loops
    "hexapod": (6, 0, 0),
    "delta": (9, 6, 0),  # 9 = 3 translations + 6 rotations of rods
    "orthoglide": (3, 0, 12),  # 12 = 3 x 3 of parallelograms + 3 of legs
    "arm6": (6, 0, 0),
}


@pytest.fixture(params=BUILT_IN, scope="module")
def name(request):
    return request.param


@pytest.fixture(scope="module")
def robot(name):
    return BUILT_IN[name]()


ELASTIC_DRIVES = [n for n in COUNTS if n != "irsbot2"]  # irsbot2 has rigid drives


WITHOUT_SPRINGY_PASSIVE_JOINTS = sorted(set(COUNTS) - {"irsbot2"})


def with_random_errors(robot, rng, rotation=1e-3, translation=2e-4):
    """Return the robot with random errors, at selected frames for irsbot2."""
    errors = np.zeros((len(robot.frames), 6))
    rows = np.arange(len(robot.frames))
    if robot.name == "irsbot2":
        rows = [robot.index(n) for n in frames_named(robot, ERROR_FRAMES)]
    size = [rotation] * 3 + [translation] * 3
    errors[rows] = rng.uniform(-1, 1, (len(rows), 6)) * size
    return robot.with_errors(errors)


def test_beams_extend_from_the_parent_origin_to_the_frame_origin(robot):
    """Beams after a slide have a given length."""
    origins = home_posture(robot).transforms[:, :3, 3]
    beams = [f for f in robot.frames if isinstance(f.link, BeamLink)]
    assert beams
    for frame in beams:
        row = robot.index(frame.name)
        parent = robot.parents[row]
        start = origins[parent] if parent >= 0 else np.zeros(3)
        length, axis = beam_axis(frame)
        R = home_posture(robot).transforms[row, :3, :3]
        assert np.abs(origins[row] - start - length * R @ axis).max() < 1e-12


def test_mobility_and_overconstraint_equal_published_values(name, robot, rng):
    """The counts are equal at home and at another pose."""
    postures = [home_posture(robot)]
    postures += [place_robot(robot, pose=random_pose(name, rng)) for _ in range(3)]
    for posture in postures:
        found = mobility(posture)
        counts = (found.freedoms, found.locked_freedoms, found.overconstraint)
        assert counts == COUNTS[name]


def test_pose_is_recovered_from_its_joint_positions(name, robot, rng):
    """The tolerance of both postures is 1e-10."""
    for _ in range(4):
        pose = random_pose(name, rng)
        there = place_robot(robot, pose=pose)
        found = there.pose()
        assert max(abs(found[key] - pose[key]) for key in pose) < 1e-9
        back = place_robot(robot, joints=joints_of(there))
        assert np.abs(back.platform - there.platform).max() < 1e-8
        assert max(there.mismatch, back.mismatch) < 1e-9


@pytest.mark.parametrize("load", [None, LOAD], ids=["free", "loaded"])
def test_energies_of_built_in_robots_agree_with_cvxpy(name, robot, rng, load):
    """Robots without overconstraint have no energy without load."""
    faulty = with_random_errors(robot, rng)
    posture = place_robot(faulty, pose=random_pose(name, rng))
    answer = solve_assembly(posture, load)
    expected, screw = energy_as_printed(posture, load)
    assert answer.energy == pytest.approx(expected, rel=1e-6, abs=1e-10)
    if load is not None:
        work = float(np.dot(load, answer.platform_screw))
        assert work == pytest.approx(float(np.dot(load, screw)), rel=1e-6)


def test_energy_and_margin_do_not_depend_on_frame_or_closure_order(name, robot, rng):
    """The order of frames and closures is reversed."""
    pose = random_pose(name, rng)
    faulty = with_random_errors(robot, rng)
    order = rng.permutation(len(faulty.frames))
    pairs = tuple((b, a) for a, b in reversed(faulty.closures))
    shuffled = tuple(faulty.frames[i] for i in order)
    other = Robot(faulty.name, faulty.platform, shuffled, pairs)
    one, two = (
        solve_assembly(place_robot(r, pose=pose), LOAD) for r in (faulty, other)
    )
    assert two.energy == pytest.approx(one.energy, rel=1e-6)
    assert two.potential == pytest.approx(one.potential, rel=1e-6)
    margins = [zone_margin(answer.posture).margin for answer in (one, two)]
    assert margins[0] == pytest.approx(margins[1], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", ELASTIC_DRIVES)
def test_platform_compliance_of_elastic_drives_equals_j_c_jt(name, rng):
    """The compliance is J diag(1 / k) J^T (Salisbury 1980).

    The Jacobian J is computed by central differences with a relative error of 1e-8.
    """
    robot = only_drives_give(BUILT_IN[name]())
    posture = place_robot(robot, pose=random_pose(name, rng))
    own = [(robot.index(n), robot.frame(n).own_axis) for n in drives(robot)]
    soft = joint_compliances(robot)
    gives = np.diag([soft[row, axis, axis] for row, axis in own])
    J = drive_jacobian(posture)
    expected = J @ gives @ J.T
    found = platform_compliance(posture)
    for part in (slice(0, 3), slice(3, 6)):  # rotation [rad], translation [m]
        size = max(np.abs(expected[part, part]).max(), 1e-12)
        assert np.abs((found - expected)[part, part]).max() < 1e-5 * size


@pytest.mark.parametrize("name", WITHOUT_SPRINGY_PASSIVE_JOINTS)
def test_drive_error_moves_the_platform_by_a_jacobian_column(name, rng):
    """The Jacobian is computed by differences of postures."""
    robot = BUILT_IN[name]()
    tight = replace(
        robot, frames=tuple(replace(f, clearance=None) for f in robot.frames)
    )
    posture = place_robot(tight, pose=random_pose(name, rng))
    size = [1.0] * 3 + [np.abs(posture.platform[:3, 3]).max()] * 3
    for drive, column in zip(drives(robot), drive_jacobian(posture).T, strict=True):
        errors = np.zeros((len(robot.frames), 6))
        row, axis = robot.index(drive), robot.frame(drive).own_axis
        errors[row, axis] = 1e-3
        faulty = replace(posture, robot=tight.with_errors(errors))
        answer = solve_assembly(faulty)
        assert answer.energy < 1e-20
        left = answer.platform_screw / 1e-3 - column
        assert np.abs(left / size).max() < 1e-5 * max(np.abs(column / size).max(), 1.0)


@pytest.mark.parametrize("name", sorted(set(BUILT_IN) - {"hexapod"}))
def test_pose_out_of_reach_is_rejected(name):
    """The hexapod is omitted, because its stroke is unlimited."""
    robot = BUILT_IN[name]()
    with pytest.raises(BadInput, match="cannot be reached"):
        place_robot(robot, pose={next(iter(WORKSPACE[name])): 10.0})


def test_message_about_a_misspelt_robot_suggests_a_name():
    assert load_robot("3rrr").name == "3rrr"
    with pytest.raises(BadInput, match="hexapod"):
        load_robot("hexpod")
