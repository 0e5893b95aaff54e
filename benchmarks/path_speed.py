"""Measure the time of errors along a path, compared with single points.

Run ``python -m benchmarks.path_speed``.  Three built-in robots with masses move by 0.1
m with an acceleration of up to 20 G.  The path has 1000 points.  The motion, the loads,
problem (22) and K_C are computed for all points together and ``point by point``, by the
same functions for each instant.  Stress, verdicts and natural frequencies are
computed only for the whole path.  The table contains the shortest wall and processor
times of several runs, and the ratio of processor times.
"""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from forcefit.assembly.kinematics.posture import (
    POSE,
    home_posture,
    place_many,
    together,
)
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.model.robot import BeamLink, Robot
from forcefit.assembly.path.idle_motions import (
    idle_motions,
    momentum_free_rates,
    with_idle_accelerations,
)
from forcefit.assembly.path.inertial_loads import inertial_loads
from forcefit.assembly.path.motion import follow_path
from forcefit.assembly.path.path_errors import path_errors
from forcefit.assembly.path.path_file import PathTable
from forcefit.assembly.path.trajectory import Trajectory, profiled
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from forcefit.assembly.sweeps.targets import goals_of

POINTS, RUNS, ONE_BY_ONE = 1000, 5, 50
MOVES = {"irsbot2": ("tx", "tz"), "hexapod": POSE, "delta": ("tx", "ty", "tz")}


def heavy(name: str) -> Robot:
    """Return a built-in robot with aluminium beams and a platform of 1 kg."""
    robot = load_robot(name)
    frames = []
    for frame in robot.frames:
        if isinstance(frame.link, BeamLink):
            frame = replace(frame, link=replace(frame.link, density=2700.0))
        if frame.name == robot.platform:
            frame = replace(frame, mass=1.0)
        frames.append(frame)
    return replace(robot, frames=tuple(frames))


def path_of(robot: Robot, names: tuple[str, ...]) -> Trajectory:
    """Return a path of 0.1 m along x, with an acceleration of up to 20 G."""
    pose = home_posture(robot).pose()
    rows = np.array([[pose[name] for name in names]] * 2)
    rows[:, 0] += [-0.05, 0.05]
    table = PathTable(names, rows)
    return profiled(table, POINTS, "quintic", 1.0, acceleration=20 * 9.80665)


def solve_instant(robot: Robot, path: Trajectory, row: int) -> None:
    """Compute an instant of a path by the functions for single postures."""
    parts = (part[row : row + 1] for part in (path.values, path.first, path.second))
    values, first, second = parts
    placed, _ = place_many(robot, goals_of(path.names, robot, values))
    posture = placed[0]
    assert posture is not None
    there, at = together([posture]), (values, first, second)
    motion = follow_path(there, path.names, at)
    idle = idle_motions(motion)
    if idle is not None:
        rates = momentum_free_rates(motion, idle)
        motion = follow_path(there, path.names, at, rates)
        motion = with_idle_accelerations(motion, idle, np.zeros(3))
    loads = inertial_loads(motion)
    moving = solve_assembly(posture, bodies=loads.bodies[0], carried=loads.carried[0])
    static = solve_assembly(posture)
    np.subtract(moving.platform_screw, static.platform_screw)
    np.array(platform_stiffness(posture).compliance)


def solve_some(robot: Robot, path: Trajectory) -> None:
    """Compute selected instants of a path one by one."""
    for row in np.linspace(0, POINTS - 1, ONE_BY_ONE).astype(int).tolist():
        solve_instant(robot, path, row)


def least(run: Callable[[], object], runs: int) -> tuple[float, float]:
    """Return the shortest wall and processor times [s] of several runs."""
    spent = []
    for _ in range(runs):
        start = time.perf_counter(), time.process_time()
        run()
        spent.append((time.perf_counter() - start[0], time.process_time() - start[1]))
    clock, processor = zip(*spent, strict=True)
    return min(clock), min(processor)


def main() -> None:
    """Print a row of the table for each robot."""
    head = f"{'robot':10}{'path [s]':>10}{'(clock)':>10}{'point by point [s]':>20}"
    print(f"{head}{'ratio':>8}")
    for name, names in MOVES.items():
        robot = heavy(name)
        path = path_of(robot, names)
        clock, processor = least(lambda r=robot, p=path: path_errors(r, p), RUNS)
        each = least(lambda r=robot, p=path: solve_some(r, p), 3)[1]
        each *= POINTS / ONE_BY_ONE
        numbers = f"{processor:10.2f}{clock:10.2f}{each:20.1f}"
        print(f"{name:10}{numbers}{each / processor:8.0f}")


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
