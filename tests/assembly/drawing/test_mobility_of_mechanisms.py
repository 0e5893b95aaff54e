"""Mobility and redundant constraints of mechanisms from the literature.

The expected numbers were computed by another program from the singular values of the
joint screws.
"""

import numpy as np
import pytest

from forcefit.assembly.drawing.drawing import (
    Drawing,
    DrawnBody,
    DrawnJoint,
    perpendicular,
    unit,
)
from forcefit.assembly.drawing.frames import robot_of_drawing
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.robots.hexapod import points

X, Y, Z = np.eye(3)


def joint(kind, first, second, at, axis=Z, axis2=None, driven=False):
    """Return a joint whose name consists of the names of its bodies."""
    axis = unit(np.array(axis, float))
    across = perpendicular(axis) if axis2 is None else perpendicular(axis, axis2)
    axis2 = across if axis2 is None else unit(np.array(axis2, float))
    at, name = np.array(at, float), f"{first}-{second}"
    return DrawnJoint(name, kind, first, second, at, axis, across, axis2, driven)


def mechanism(platform, at, *joints):
    """Return a robot with the given joints and massless bodies."""
    names = dict.fromkeys(n for j in joints for n in (j.first, j.second) if n != "base")
    bodies = tuple(DrawnBody(name) for name in names)
    drawing = Drawing("mechanism", platform, np.array(at, float), bodies, joints)
    return robot_of_drawing(drawing)


def turn(angle, axis=Z):
    """Return the rotation by an angle [rad] about an axis, (3, 3)."""
    K = np.cross(np.eye(3), axis)
    return np.eye(3) - np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def thirds():
    return [turn(2 * np.pi * k / 3) for k in range(3)]


def four_bar():
    return mechanism(
        "coupler", [0.5, 0.4, 0],
        joint("revolute", "base", "crank", [0, 0, 0], driven=True),
        joint("revolute", "crank", "coupler", [0.1, 0.3, 0]),
        joint("revolute", "coupler", "rocker", [0.7, 0.5, 0]),
        joint("revolute", "base", "rocker", [0.8, 0, 0]),
    )  # fmt: skip


def bennett(turned=0.0):
    """Return Bennett's linkage with twist angles of 50 and 100 deg.

    One axis can be rotated by an angle [rad].  The joint angles satisfy tan(q1 / 2)
    tan(q2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2), q3 = -q1 and
    q4 = -q2.
    """
    alpha, beta, a = np.deg2rad(50), np.deg2rad(100), 0.2
    b = a * np.sin(beta) / np.sin(alpha)
    first = np.deg2rad(70)
    half = np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2)
    second = 2 * np.arctan(half / np.tan(first / 2))
    R, p, joints = np.eye(3), np.zeros(3), []
    names = ("base", "one", "two", "three", "base")
    links = zip((first, second, -first, -second), (a, b) * 2, (alpha, beta) * 2,
                strict=True)  # fmt: skip
    for k, (q, length, twist) in enumerate(links):
        axis = R @ turn(turned if k == 2 else 0.0, X) @ Z
        joints.append(joint("revolute", *names[k : k + 2], p, axis, driven=k == 0))
        R = R @ turn(q)
        p = p + R @ (length * X)
        R = R @ turn(twist, X)
    assert np.abs(p).max() < 1e-12  # the loop is closed
    return mechanism("two", [0.1, 0.2, 0.3], *joints)


def sarrus():
    """Return a Sarrus linkage with two legs of three parallel axes."""
    legs = []
    for name, axis, side in (("a", X, Y), ("b", Y, X)):
        legs += [
            joint("revolute", "base", name, 0.2 * side, axis, driven=name == "a"),
            joint("revolute", name, f"{name}2", 0.4 * side + 0.2 * Z, axis),
            joint("revolute", f"{name}2", "platform", 0.2 * side + 0.5 * Z, axis),
        ]
    return mechanism("platform", 0.5 * Z, *legs)


def agile_eye():
    """Return a spherical robot whose axes intersect at one point."""
    joints = []
    for k, axis in enumerate(np.eye(3)):
        middle, last = np.roll(axis, 1), np.roll(axis, 2)
        near, far = f"near{k}", f"far{k}"
        joints += [
            joint("revolute", "base", near, 0.1 * axis, axis, driven=True),
            joint("revolute", near, far, 0.1 * middle, middle),
            joint("revolute", far, "platform", 0.1 * last, last),
        ]
    return mechanism("platform", [0, 0, 0], *joints)


def three_upu(outer, radius=0.08):
    """Return a 3-UPU robot with given outer joint axes and platform radius [m]."""
    joints = []
    for k, R in enumerate(thirds()):
        low, high = np.array([0.24, 0, 0]), np.array([radius, 0, 0.45])
        inner = np.cross(high - low, Y) if outer is Y else Y
        tube, rod = f"tube{k}", f"rod{k}"
        joints += [
            joint("universal", "base", tube, R @ low, R @ outer, R @ inner),
            joint("prismatic", tube, rod, R @ low, R @ (high - low), driven=True),
            joint("universal", rod, "platform", R @ high, R @ inner, R @ outer),
        ]
    return mechanism("platform", [0, 0, 0.45], *joints)


def delta(rods):
    """Return a delta robot with ball joints, or with revolute joints otherwise."""
    joints = []
    for k, R in enumerate(thirds()):
        foot, elbow, end = ([0.2, 0, 0], [0.5, 0, -0.3], [0.1, 0, -0.9])
        arm, along = f"arm{k}", np.subtract(end, elbow)
        joints.append(joint("revolute", "base", arm, R @ foot, R @ Y, driven=True))
        upper, lower = arm, "platform"
        if not rods:
            upper, lower = f"upper{k}", f"lower{k}"
            joints += [
                joint("revolute", arm, upper, R @ elbow, R @ Y),
                joint("revolute", lower, "platform", R @ end, R @ Y),
            ]
        across = np.cross(along, Y)
        kind, axis = ("spherical", Z) if rods else ("revolute", across)
        for side, shift in (("a", 0.05 * Y), ("b", -0.05 * Y)):
            rod = f"rod{side}{k}"
            joints += [
                joint(kind, upper, rod, R @ (elbow + shift), R @ axis),
                joint(kind, rod, lower, R @ (end + shift), R @ axis),
            ]
    return mechanism("platform", [0, 0, -0.9], *joints)


def gough(first, shift=(0, 0, 0), rotation=np.eye(3), axis_along=False):  # noqa: B008
    """Return a 6-UPS or 6-SPS robot with a displaced platform.

    The first axis of a universal joint is horizontal, or parallel to the leg in the
    home pose if ``axis_along`` is true.
    """
    joints = []
    for k, (a, corner) in enumerate(zip(*points(), strict=True)):
        b = rotation @ corner + 0.53 * Z + shift
        first_axis = corner + 0.53 * Z - a if axis_along else np.cross(Z, b - a)
        second_axis = np.cross(first_axis, b - a)
        if np.linalg.norm(second_axis) < 1e-9:
            second_axis = np.cross(first_axis, Z)
        axes = first_axis, second_axis
        tube, rod = f"tube{k}", f"rod{k}"
        joints += [
            joint(first, "base", tube, a, *axes),
            joint("prismatic", tube, rod, a, b - a, driven=True),
            joint("spherical", rod, "platform", b),
        ]
    return mechanism("platform", 0.53 * Z, *joints)


# degrees of freedom of the mechanism and of the platform, first with free and then with
# locked drives; number of redundant constraints
MECHANISMS = {
    "four_bar": (four_bar, (1, 1, 0, 0, 3)),
    "bennett": (bennett, (1, 1, 0, 0, 3)),
    "sarrus": (sarrus, (1, 1, 0, 0, 1)),
    "agile_eye": (agile_eye, (3, 3, 0, 0, 6)),
    "tsai": (lambda: three_upu(Y), (3, 3, 0, 0, 0)),
    "snu": (lambda: three_upu(X, 0.24), (5, 5, 2, 2, 2)),
    "snu, smaller platform": (lambda: three_upu(X), (5, 5, 2, 2, 2)),
    "delta of rods": (lambda: delta(True), (9, 3, 6, 0, 0)),
    "delta of parallelograms": (lambda: delta(False), (3, 3, 0, 0, 12)),
    "6-UPS": (lambda: gough("universal"), (6, 6, 0, 0, 0)),
    "6-SPS": (lambda: gough("spherical"), (12, 6, 6, 0, 0)),
}


def counts(posture):
    found = mobility(posture)
    assert found.freedoms_drives_locked == found.locked_freedoms
    return (
        found.freedoms, found.platform_freedoms, found.freedoms_drives_locked,
        found.platform_freedoms_drives_locked, found.redundant_constraints,
    )  # fmt: skip


@pytest.mark.parametrize("name", MECHANISMS)
def test_mechanisms_have_degrees_of_freedom_of_the_literature(name):
    make, expected = MECHANISMS[name]
    assert counts(home_posture(make())) == expected


def test_snu_robot_has_three_degrees_of_freedom_outside_home_pose():
    """The legs remain parallel, because base and platform are equal triangles.

    With locked drives, the platform has two degrees of freedom.
    """
    pose = {"tx": 0.1, "ty": 0.08, "tz": 0.45, "rx": 0.0, "ry": 0.0, "rz": 0.0}
    at = place_robot(three_upu(X, 0.24), pose)
    assert counts(at) == (3, 3, 2, 2, 2)
    assert mobility(at).overconstraint == 0


def test_tsai_robot_has_three_degrees_of_freedom_outside_home_pose():
    at = place_robot(three_upu(Y), {"tx": 0.05, "ty": 0.02, "tz": 0.5})
    assert counts(at) == (3, 3, 0, 0, 0)
    rotation = [at.pose()[key] for key in ("rx", "ry", "rz")]
    assert rotation == pytest.approx([0.0] * 3, abs=1e-9)


def test_bennett_linkage_with_wrong_twist_angle_is_rigid():
    """One axis is rotated by 0.1 rad, which changes two twist angles."""
    assert counts(home_posture(bennett(0.1)))[0] == 0


def test_legs_can_rotate_if_universal_joint_axes_are_parallel_to_legs():
    """The robot has 9 degrees of freedom in the home pose and 6 in other poses."""
    robot = gough("universal", axis_along=True)
    home = home_posture(robot)
    assert (mobility(home).freedoms, mobility(home).overconstraint) == (9, 3)
    assert mobility(home).freedoms_drives_locked == 6
    moved = gough("universal", [0.02, 0.01, 0.0], turn(0.06) @ turn(0.05, X), True)
    assert counts(home_posture(moved)) == (6, 6, 0, 0, 0)
