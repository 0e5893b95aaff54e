"""Singular postures, operation modes, and poses beyond a singularity."""

import math
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.crossing import beyond_singularity
from forcefit.assembly.kinematics.nominal import Target
from forcefit.assembly.kinematics.posture import home_posture, place_many, place_robot
from forcefit.assembly.kinematics.singular_posture import is_singular
from forcefit.assembly.kinematics.singularity import find_singularities
from forcefit.assembly.kinematics.verdict import limits_passed, posture_remarks
from forcefit.assembly.robots import BUILT_IN, load_robot
from forcefit.inputs.table import BadInput
from tests.linkages_for_tests import slider_crank
from tests.three_upu_for_tests import BASE, HEIGHT, LENGTH, PLATFORM, three_upu


def singular(posture):
    return is_singular(posture.robot, posture.coordinates, posture.transforms)


def flat(x=0.0, y=0.0, z=HEIGHT):
    """Return a pose of pure translation."""
    return {"tx": x, "ty": y, "tz": z, "rx": 0.0, "ry": 0.0, "rz": 0.0}


@pytest.mark.parametrize("z", [0.3, HEIGHT, 0.6])
def test_three_upu_is_singular_above_its_centre(z):
    """The three constraint couples are parallel at the centre only."""
    robot = three_upu()
    assert singular(place_robot(robot, pose=flat(z=z)))
    assert not singular(place_robot(robot, pose=flat(x=0.002, z=z)))


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_robots_are_regular_at_home(name):
    assert not singular(home_posture(load_robot(name)))


def test_robot_without_drives_is_regular():
    robot = load_robot("four_bar")
    loose = tuple(replace(frame, actuated=False) for frame in robot.frames)
    assert not singular(home_posture(replace(robot, frames=loose)))


def test_slider_driven_at_its_dead_centre_is_singular():
    """With crank and rod collinear, the locked slide does not lock the crank."""
    assert singular(home_posture(slider_crank(0.0)))
    assert not singular(home_posture(slider_crank(0.4)))


GIVEN = [{"tz": HEIGHT}, {"tx": 0.0, "ty": 0.0, "tz": HEIGHT}, flat()]


@pytest.mark.parametrize("pose", GIVEN)
def test_singularity_distances_vanish_at_a_singular_pose(pose):
    robot = three_upu()
    found = find_singularities(robot, place_robot(robot, pose=pose).transforms[None])
    assert found.parallel[0] == 0.0
    assert found.closure[0] == 0.0


def test_motion_from_a_singular_home_is_a_pure_translation():
    """Pure translations are possible at every position."""
    robot = three_upu()
    pose = {"tx": 0.002, "ty": 0.001, "tz": HEIGHT}
    posture = place_robot(robot, pose=pose)
    assert posture.pose() == pytest.approx(flat(0.002, 0.001), abs=1e-9)
    (posture,), (reason,) = place_many(robot, [[0.002, 0.001, HEIGHT, *[np.nan] * 3]])
    assert reason == ""
    assert posture.pose() == pytest.approx(flat(0.002, 0.001), abs=1e-9)


def test_drive_motions_from_a_singular_home_are_translations():
    """The intersection of three spheres is x = (L^2 - l^2) / (3 (b - p)), y = 0."""
    robot = three_upu()
    posture = place_robot(robot, joints={"leg1.slide": 0.5})
    gap = BASE - PLATFORM
    x = (LENGTH**2 - 0.5**2) / (3 * gap)
    z = math.sqrt(0.25 - (x - gap) ** 2)
    assert posture.pose() == pytest.approx(flat(x, 0.0, z), abs=1e-9)
    (remark,) = posture_remarks(posture)
    assert "home is a singular posture" in remark
    assert "pure translation" in remark


def test_pose_in_another_operation_mode_is_reported():
    posture = place_robot(three_upu(), pose={"rx": 0.05})
    assert posture.pose()["rx"] == pytest.approx(0.05, abs=1e-9)
    assert "rotates" in posture_remarks(posture)[0]


def test_message_about_an_unreachable_pose_reports_a_singular_home():
    with pytest.raises(BadInput, match=r"home is a singular posture: specify all six"):
        place_robot(three_upu(), pose={"tz": HEIGHT, "rz": 3.0})


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_hexapod_rotated_beyond_90_degrees_is_beyond_its_singularity(side):
    """A regular hexapod is singular at 90 degrees about z (Fichter 1986)."""
    robot = load_robot("hexapod")
    height = home_posture(robot).pose()["tz"]
    angles = side * np.radians([60.0, 85.0, 95.0, 110.0])
    poses = np.array([[0, 0, height, 0, 0, angle] for angle in angles])
    postures, _ = place_many(robot, poses)
    T = np.array([posture.transforms for posture in postures])
    far = beyond_singularity(robot, Target(pose=poses), T)
    assert far.tolist() == [False, False, True, True]
    assert "without passing a singularity" in posture_remarks(postures[2])[0]


def test_five_bar_below_its_elbows_is_beyond_its_singularity():
    """At tx = 0, the distal arms are collinear for ty = sqrt(90^2 - 30^2) mm."""
    robot, line = load_robot("five_bar"), math.sqrt(0.09**2 - 0.03**2)
    poses = np.full((4, 6), np.nan)
    poses[:, 0], poses[:, 1] = 0.0, line + np.array([0.03, 0.002, -0.002, -0.02])
    postures, _ = place_many(robot, poses)
    T = np.array([posture.transforms for posture in postures])
    far = beyond_singularity(robot, Target(pose=poses), T)
    assert far.tolist() == [False, False, True, True]


def test_joint_beyond_its_limits_is_reported():
    robot = load_robot("four_bar")
    frames = tuple(
        replace(f, limits=(-0.5, 1.5)) if f.actuated else f for f in robot.frames
    )
    robot = replace(robot, frames=frames)
    within, beyond = (place_robot(robot, joints={"crank": q}) for q in (1.5, 1.6))
    assert limits_passed(robot, within.coordinates) == ""
    said = limits_passed(robot, beyond.coordinates)
    assert said == "crank at 1.6 rad, limits -0.5 to 1.5"
    assert posture_remarks(beyond) == [f"beyond the limits of its joints: {said}"]
