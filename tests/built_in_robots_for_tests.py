"""Workspaces and functions shared by the tests of built-in robots."""

import itertools
from dataclasses import replace

import numpy as np

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly

# typical workspace of each robot: range of each pose component [m, rad]
WORKSPACE = {
    "irsbot2": {"tx": (-0.3, 0.3), "tz": (-0.6, -0.35)},
    "four_bar": {"tx": (0.02, 0.38)},
    "five_bar": {"tx": (-0.03, 0.03), "ty": (0.13, 0.15)},
    "3rrr": {"tx": (-0.05, 0.05), "ty": (-0.05, 0.05), "rz": (-0.3, 0.3)},
    "hexapod": {
        "tx": (-0.06, 0.06), "ty": (-0.06, 0.06), "tz": (0.5, 0.58),
        "rx": (-0.15, 0.15), "ry": (-0.15, 0.15), "rz": (-0.15, 0.15),
    },
    "delta": {"tx": (-0.4, 0.4), "ty": (-0.4, 0.4), "tz": (-1.1, -0.8)},
    "orthoglide": {"tx": (-0.08, 0.08), "ty": (-0.08, 0.08), "tz": (-0.08, 0.08)},
    "arm6": {
        "tx": (0.5, 0.65), "ty": (-0.25, -0.05), "tz": (-0.1, 0.1),
        "rx": (-0.2, 0.2), "ry": (1.4, 1.7), "rz": (-0.2, 0.2),
    },
}  # fmt: skip


# tight gaps between bounds [rad, m], so that stored bounds can be compared
CLOSE = {"tolerance_rotation": 1e-11, "tolerance_translation": 1e-11}
LOAD = [3.0, -2.0, 1.0, 40.0, -30.0, 20.0]  # [N m, N]


def random_pose(name, rng):
    """Return a random platform pose in the workspace of a robot."""
    return {key: rng.uniform(*box) for key, box in WORKSPACE[name].items()}


def drives(robot):
    """Return the names of the actuated joints."""
    return [frame.name for frame in robot.frames if frame.actuated]


def joints_of(posture):
    """Return the coordinates of the actuated joints by name."""
    robot = posture.robot
    return {n: posture.coordinates[robot.index(n)] for n in drives(robot)}


def only_drives_give(robot):
    """Return the robot with elastic joints only, and without clearances."""
    bare = (replace(f, link=None, clearance=None) for f in robot.frames)
    return replace(robot, frames=tuple(bare))


def only_play(robot):
    """Return the robot with clearances but without elasticity."""
    kept = {f.name: f.clearance for f in robot.frames}
    frames = (
        replace(f, link=None, joint_stiffness=None, clearance=kept[f.name])
        for f in robot.frames
    )
    return replace(robot, frames=tuple(frames))


def platform_compliance(posture):
    """Return the platform screws due to unit loads (1 N m, 1 N) as columns, (6, 6)."""
    loaded = (solve_assembly(posture, load) for load in np.eye(6))
    return np.column_stack([answer.platform_screw for answer in loaded])


def drive_jacobian(posture, step=1e-4):
    """Return the platform Jacobian by central differences, (6, drives)."""
    robot, here = posture.robot, joints_of(posture)
    R = posture.platform[:3, :3]
    columns = []
    for key, value in here.items():
        after, before = (
            place_robot(robot, joints=here | {key: value + s}).platform
            for s in (step, -step)
        )
        spin = (after - before)[:3, :3] @ R.T / (2 * step)
        shift = (after - before)[:3, 3] / (2 * step)
        columns.append([spin[2, 1], spin[0, 2], spin[1, 0], *shift])
    return np.array(columns).T


def farthest_corner(lines, plays):
    """Return the largest rotation and translation if all clearances are at a bound.

    Args:
        lines: (k, k) map from the platform screw to the clearances.
        plays: (k,) bound of each clearance.
    """
    signs = np.array(list(itertools.product([-1, 1], repeat=len(plays))))
    screws = np.linalg.solve(lines, (signs * plays).T).T
    turns, shifts = np.split(
        screws, [len(plays) // 2 if len(plays) == 6 else 1], axis=1
    )
    return [np.linalg.norm(part, axis=1).max() for part in (turns, shifts)]
