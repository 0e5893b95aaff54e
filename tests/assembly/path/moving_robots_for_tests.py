"""Robots that move along a path, for tests."""

import numpy as np

from forcefit.assembly.kinematics.posture import place_many_joints, together
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.assembly.path.motion import follow_path
from forcefit.assembly.path.trajectory import Trajectory
from forcefit.assembly.sweeps.targets import goals_of
from forcefit.stiffness.screws import rotation_matrix

GRAVITY = np.array([0.0, -9.81, 0.0])


def hinge(name, parent="base", at=(0, 0, 0), **other):
    """Return an actuated hinge about z."""
    return Frame(name, parent, at, joint="revolute", actuated=True, **other)


def instants(names, values, first, second):
    """Return a trajectory of independent instants."""
    rows = [np.atleast_2d(np.array(x, dtype=float)) for x in (values, first, second)]
    return Trajectory(tuple(names), np.arange(len(rows[0])) * 1.0, *rows, "times")


def rod(mass, length):
    """Return the inertial data of a thin rod along x, for the frame at its tip."""
    turning = mass * length**2 / 12
    return {
        "mass": mass, "centre_of_mass": [-length / 2, 0, 0],
        "inertia": np.diag([0, turning, turning]),
    }  # fmt: skip


def spinning_beam(
    rate, acceleration, pieces=1, theory="euler", radius=0.01, axis=(0, 0, 1)
):
    """Return a beam along x on a rotating hub, and its motion at one instant."""
    link = BeamLink({"radius": radius}, 70e9, 0.3, 2700.0, theory)
    turn = _turn_of_z(axis)
    step = np.array([0.5 / pieces, 0, 0])
    first = rotation_matrix(turn).T @ step
    frames = [hinge("hub", rotation=turn)]
    frames.append(Frame("piece0", "hub", first, -turn, link=link))
    for k in range(1, pieces):
        frames.append(Frame(f"piece{k}", f"piece{k - 1}", step, link=link))
    robot = Robot("beam", frames[-1].name, tuple(frames))
    return robot, at_one_instant(rate, acceleration)


def _turn_of_z(axis):
    """Return the rotation vector that rotates z to a given axis."""
    axis = np.array(axis) / np.linalg.norm(axis)
    across = np.cross([0, 0, 1], axis)
    sine = np.linalg.norm(across)
    if sine < 1e-12:
        return np.zeros(3)
    return across / sine * np.arctan2(sine, axis[2])


def moving_drives(robot, names, path):
    """Return the motion of a robot for given drive coordinates and derivatives."""
    postures, reasons = place_many_joints(robot, goals_of(names, robot, path[0]))
    assert not any(reasons)
    return follow_path(together(postures), names, path)


def at_one_instant(rate=0.0, acceleration=0.0, position=0.0):
    """Return the motion of the hub at one instant."""
    return instants(["q.hub"], [[position]], [[rate]], [[acceleration]])
