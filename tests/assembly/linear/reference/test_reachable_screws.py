"""Sets of platform screws: points within them, and how far they extend."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear.energy import solve_assembly
from assembly.linear.reference.pose_error import (
    ReachableSet,
    loaded_cones,
    reachable_screws,
)
from assembly.model.robot import Clearance, Frame, Robot
from tests.robots_for_tests import coaxial_beams


def test_what_nothing_bounds_is_infinite_in_its_own_half():
    """A free shift along x of 2e-8 m leaves the rotation, and the other shifts."""
    free = np.zeros((6, 1))
    free[3] = 2e-8
    reachable = ReachableSet(
        np.arange(6.0), np.eye(6)[:, :1], np.zeros((0, 1)), np.zeros(1),
        np.zeros(1, dtype=int), free,
    )  # fmt: skip
    assert not reachable.unbounded(0)
    assert reachable.unbounded(3)
    (low, high), screw, supports = reachable.farthest(3, 1e-6)
    assert (low, high, supports) == (np.inf, np.inf, 0)
    assert screw.tolist() == reachable.centre.tolist()
    for size in (1e-6, 1.0, 1e6):  # whatever the direction's size
        d = size * np.eye(6)
        assert reachable.support(d[3]).height == np.inf
        assert np.isfinite(reachable.support(d[4]).height)
        assert reachable.support(1e-3 * d[3] + d[4]).height < np.inf


E3 = 1e-3  # [rad] of clearance about z, three times, and of an error


def pin_against_plays(limit, start):
    """A pin of a bounded turn about z against three clearances in a row, E3 each.

    Closed by q + E3 = v_1 + v_2 + v_3; clearances are at ``start`` of their bounds.
    """
    clearance = Clearance(spin=E3)
    robot = Robot("pin", "end", (
        Frame("pin", joint="revolute", clearance=Clearance(spin=limit),
              geometric_error=[0, 0, E3, 0, 0, 0]),
        Frame("end", "pin", [1.0, 0, 0]),
        Frame("a", clearance=clearance), Frame("b", "a", clearance=clearance),
        Frame("c", "b", clearance=clearance), Frame("stop", "c", [1.0, 0, 0]),
    ), (("end", "stop"),))  # fmt: skip
    assembly = solve_assembly(home_posture(robot))
    assert assembly.clearances.shape == (3,)
    u = np.asarray(start, dtype=float)
    return replace(assembly, clearances=u, motions=np.array([E3 * (u.sum() - 1.0)]))


@pytest.mark.parametrize("start", [(0, 0, 0), (0.5, 0.2, 0.3), (-0.5, 0.1, -0.6)])
def test_a_joints_own_bound_counts_where_its_motion_may_pass_it(start):
    """It turns by -4 E3 at most: a bound of 3.9 E3 counts, one of 4.1 does not."""
    for limit, counts in ((4.1 * E3, False), (3.9 * E3, True), (2.5 * E3, True)):
        reachable = reachable_screws(pin_against_plays(limit, start), "free")
        assert len(reachable.start) == 3 + counts
        # the platform turns by q + E3
        up, down = (reachable.support(d).height for d in (np.eye(6)[2], -np.eye(6)[2]))
        assert up == pytest.approx(min(3 * E3, limit + E3), rel=1e-6)
        assert down == pytest.approx(min(3 * E3, limit - E3), rel=1e-6)


@pytest.mark.parametrize("stiffness", [1e6, 1e-6, 1e-12])
def test_clearances_on_their_bound_under_a_wrench_are_held(stiffness):
    """A gap of five radial clearances holds it, in soft robots as in stiff ones."""
    clearance = Clearance(radial=2e-5, axial=3e-5, tilt=1e-3)
    robot = coaxial_beams([0, 0, 0, 0, 1e-4, 0], (stiffness,) * 2, clearance=clearance)
    assembly = solve_assembly(home_posture(robot))
    joints = assembly.joints
    held = loaded_cones(assembly, joints)
    rows = np.abs(joints.cones).argmax(axis=0) % 6
    assert sorted(rows[held].tolist()) == ([4, 5] if 3 in rows[~held] else [3, 4])
