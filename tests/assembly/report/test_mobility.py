"""Mobility of mechanisms with known motions."""

import json
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.drawing.drawing import DrawnJoint, perpendicular, unit
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.kinematics.pure_motions import pure_motions
from forcefit.assembly.report.mobility import mobility_lines, mobility_of
from tests.assembly.drawing import test_mobility_of_mechanisms as mechanisms
from tests.assembly.drawing.test_mobility_of_mechanisms import (
    MECHANISMS,
    X,
    Y,
    Z,
    joint,
    mechanism,
    three_upu,
)

DRAWN = Path(__file__).parents[3] / "examples" / "drawn"
ALL = "translates along x, y, z and turns about x, y, z"
MOVES = "translates along x, y, z"
WORDS = {
    "sarrus": "1 freedom: translates along z; 1 over-constraint",
    "agile_eye":
        "3 freedoms: turns about x, y, z through (0, 0, 0) m; 6 over-constraints",
    "tsai": f"3 freedoms: {MOVES}; 0 over-constraints",
    "snu": f"5 freedoms: {MOVES} and turns about x, y; 2 over-constraints",
    "delta of parallelograms": f"3 freedoms: {MOVES}; 12 over-constraints",
    "delta of rods": f"9 freedoms, 3 of the platform: {MOVES}; 0 over-constraints",
    "6-UPS": f"6 freedoms: {ALL}; 0 over-constraints",
    "6-SPS": f"12 freedoms, 6 of the platform: {ALL}; 0 over-constraints",
}  # fmt: skip


@pytest.mark.parametrize("name", WORDS)
def test_mobility_text_agrees_with_the_literature(name):
    found = mobility_of(home_posture(MECHANISMS[name][0]()))
    assert found["words"] == WORDS[name]
    assert found["counts_certain"]


def test_coupler_of_a_four_bar_rotates_about_its_instant_centre():
    """The lines along crank and rocker intersect at y = 3x = -5 (x - 0.8)."""
    (turn,) = mobility_of(home_posture(MECHANISMS["four_bar"][0]()))["motions"]
    assert turn["kind"] == "turn"
    np.testing.assert_allclose(turn["point"], [0.5, 1.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(turn["direction"], Z, atol=1e-12)


def test_redundant_drive_is_reported():
    robot = mechanism(
        "coupler", [0.5, 0.3, 0],
        joint("revolute", "base", "crank", [0, 0, 0], driven=True),
        joint("revolute", "crank", "coupler", [0, 0.3, 0]),
        joint("revolute", "coupler", "rocker", [0.5, 0.3, 0]),
        joint("revolute", "base", "rocker", [0.5, 0, 0], driven=True),
    )  # fmt: skip
    found = mobility_of(home_posture(robot))
    assert (found["actuation_redundancy"], found["local_freedoms"]) == (1, 0)
    assert mobility_lines(found)["redundant drives"] == "1"


def test_seoul_robot_has_fewer_degrees_of_freedom_near_its_singular_home():
    """It has 5 in the home pose and 3 nearby (Zlatanov, Bonev, Gosselin 2002)."""
    found = mobility_of(home_posture(three_upu(X, 0.24)))
    assert (found["freedoms"], found["singular"]) == (5, True)
    assert (found["finite_freedoms"], found["near"]["freedoms"]) == (3, 3)
    assert "near it 3 freedoms" in mobility_lines(found)["singular posture"]


def test_three_coplanar_parallel_axes_allow_only_infinitesimal_motions():
    """Collinear bars of 0.3 and 0.2 m between hinges at a distance of 0.5 m cannot
    move.
    """
    robot = mechanism(
        "one", [0.1, 0, 0],
        joint("revolute", "base", "one", [0, 0, 0], driven=True),
        joint("revolute", "one", "two", [0.3, 0, 0]),
        joint("revolute", "base", "two", [0.5, 0, 0]),
    )  # fmt: skip
    found = mobility_of(home_posture(robot))
    assert (found["freedoms"], found["finite_freedoms"]) == (1, 0)
    assert found["singular"]
    assert "near" not in found


@pytest.mark.parametrize("name", ["agile_eye", "tsai", "sarrus", "6-SPS", "bennett"])
def test_regular_home_pose_is_not_reported_as_singular(name):
    found = mobility_of(home_posture(MECHANISMS[name][0]()))
    assert not found["singular"]
    assert found["finite_freedoms"] == found["freedoms"]
    assert "near" not in found


def test_ball_joint_rotated_by_a_right_angle_has_three_degrees_of_freedom():
    """The result does not depend on the axes that model the ball joint."""
    robot = mechanism("ball", [0, 0, 0.2], joint("spherical", "base", "ball", [0] * 3))
    home = home_posture(robot)
    for axis in (X, Y, Z):
        pose = dict(zip(("rx", "ry", "rz"), np.pi / 2 * axis, strict=True))
        found = mobility_of(place_robot(robot, pose))
        assert (found["freedoms"], found["platform_freedoms"]) == (3, 3)
        assert "turns about x, y, z through (0, 0, 0) m" in found["words"]
    assert mobility(home).freedoms == 3


SCREWS = {
    # Rotation about z through (1, 2, 0), with the velocity v = p x w at the origin.
    "turn": ([[0, 0, 1, 2, -1, 0]], [("turn", [1, 2, 0], None)]),
    "screw": ([[0, 0, 1, 2, -1, 0.3]], [("screw", [1, 2, 0], 0.3 * 2 * np.pi)]),
    # The screw is the sum of a rotation and a translation along its axis.
    "cylindrical": (
        [[0, 0, 1, 2, -1, 0.3], [0, 0, 0, 0, 0, 1]],
        [("translation", None, None), ("turn", [1, 2, 0], None)],
    ),
    "planar": (
        [[0, 0, 1, 2, -1, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, 1, 1, 0]],
        [("translation", None, None)] * 2 + [("turn", None, None)],
    ),
    # Rotations about lines along x at z = 0 and along y at z = 0.4. The principal
    # screws of this cylindroid are along the bisectors at z = 0.2, with pitches -0.2
    # and 0.2.
    "two skew turns": (
        [[1, 0, 0, 0, 0, 0], [0, 1, 0, -0.4, 0, 0]],
        [("screw", [0, 0, 0.2], -0.4 * np.pi), ("screw", [0, 0, 0.2], 0.4 * np.pi)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SCREWS)
@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_pure_motions_of_screw_systems_equal_hand_calculation(name, size):
    screws, expected = SCREWS[name]
    found = pure_motions(np.array(screws, float), np.zeros(3), size)
    assert [m.kind for m in found] == [kind for kind, _, _ in expected]
    for motion, (_, point, pitch) in zip(found, expected, strict=True):
        assert (motion.point is None) == (point is None)
        if point is not None:
            np.testing.assert_allclose(motion.point, point, atol=1e-9)
        assert motion.pitch == (None if pitch is None else pytest.approx(pitch))


def rounded(digits):
    """Return a function that creates joints with rounded points and axes."""

    def make(name, kind, first, second, at, axis, across, axis2, driven):
        axis, axis2 = (unit(np.round(v, digits)) for v in (axis, axis2))
        across, at = perpendicular(axis, axis2), np.round(at, digits)
        return DrawnJoint(name, kind, first, second, at, axis, across, axis2, driven)

    return make


@pytest.mark.parametrize("name", [*WORDS, "bennett"])
def test_mobility_of_files_rounded_to_6_digits_equals_that_of_exact_files(
    name, monkeypatch
):
    """Rounding makes all singular values of Bennett's linkage nonzero."""
    make, expected = MECHANISMS[name]
    monkeypatch.setattr(mechanisms, "DrawnJoint", rounded(6))
    found = mobility_of(home_posture(make()))
    names = ("freedoms", "platform_freedoms", "freedoms_drives_locked",
             "platform_freedoms_drives_locked", "redundant_constraints")  # fmt: skip
    assert tuple(found[key] for key in names) == expected
    assert found["counts_certain"]
    assert found["words"] == WORDS.get(name, found["words"])
    assert found["finite_freedoms"] == found["freedoms"] - 2 * (name == "snu")


def test_mobility_without_a_singular_value_gap_is_uncertain():
    """The axes are tilted by 1e-4 and 2e-5 rad."""
    robot = mechanism(
        "one", [0.1, 0.2, 0],
        joint("revolute", "base", "one", [0, 0, 0], driven=True),
        joint("revolute", "one", "two", [0.1, 0.3, 0]),
        joint("revolute", "two", "three", [0.4, 0.6, 0], [1e-4, 0, 1]),
        joint("revolute", "three", "four", [0.7, 0.5, 0], [0, 2e-5, 1]),
        joint("revolute", "base", "four", [0.8, 0, 0]),
    )  # fmt: skip
    found = mobility_of(home_posture(robot))
    assert 1 < found["singular_value_gap"] < 100
    assert not found["counts_certain"]
    assert "differ only by" in mobility_lines(found)["counts not certain"]


def test_show_command_writes_mobility_without_a_picture(run):
    status, out, err = run("assembly", "show", DRAWN / "three_upu.toml", "--json", "-")
    assert (status, err) == (0, "")
    found = json.loads(out)
    assert found["mobility"]["words"] == WORDS["tsai"]
    slide = found["axes"]["leg1.slide"]
    along = np.array([-16, 0, 45]) / np.hypot(16, 45)
    np.testing.assert_allclose(slide["z"], along, atol=1e-12)
    np.testing.assert_allclose(slide["x"] @ np.array(slide["z"]), 0.0, atol=1e-12)
