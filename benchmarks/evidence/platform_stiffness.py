"""Measure the time of K_C for IRSBot-2, compared with problem (22).

``python -m benchmarks.evidence.platform_stiffness`` prints the shortest time [us] per
posture of several runs.  It also prints the largest difference of K_C from the results
for single postures.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from forcefit.assembly.kinematics.posture import Posture, place_many, together
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.platform_stiffness.linear_tangent import without_clearance
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot

_RUNS = 9
# frames with geometric errors in the paper
_DRAWN = ("elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip")


def least(function: Callable[[], object], count: int) -> float:
    """Return the shortest time [us] per point of several runs."""
    times = []
    for _ in range(_RUNS):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times) / count * 1e6


def main() -> None:
    """Print the table."""
    robot = load_robot("irsbot2")
    grid = [
        (x, z)
        for x in np.arange(-0.7, 0.701, 0.025)
        for z in np.arange(-0.75, 0.001, 0.025)
    ]
    poses = np.full((len(grid), 6), np.nan)
    poses[:, [0, 2]] = grid
    postures = [p for p in place_many(robot, poses)[0] if p is not None]
    at = together(postures)
    T = at.transforms
    rng = np.random.default_rng(1)
    drawn = [f.name.rpartition(".")[2] in _DRAWN for f in robot.frames]
    errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * np.repeat([1e-2, 1e-4], 3)
    errors[~np.array(drawn)] = 0.0
    forced = robot.with_errors(errors)
    count = len(T)
    print(f"{count} postures of {robot.name}, one thread")
    solve_assembly(postures[:2])
    platform_stiffness(postures[:2])
    for name, function in (
        ("(22) without errors", lambda: solve_assembly(at)),
        ("(22) with errors", lambda: solve_assembly(replace(at, robot=forced))),
        ("K_C", lambda: platform_stiffness(at)),
        ("K_C, eigen-screws, shares", lambda: everything(at)),
    ):
        print(f"{name:28s}{least(function, count):8.1f} us")
    batched = platform_stiffness(at).compliance
    worst = 0.0
    for i in range(0, count, 40):
        C = without_clearance(postures[i]).compliance
        size = np.sqrt(np.diag(C))
        worst = max(worst, np.abs((batched[i] - C) / np.outer(size, size)).max())
    print(f"largest difference from one posture at a time: {worst:.1e}")


def everything(postures: Posture) -> None:
    """Compute all quantities of the stiffness that a sweep stores."""
    found: Any = platform_stiffness(postures)
    _ = found.eigen_stiffnesses, found.eigen_screws
    for axis in np.eye(6):
        found.shares(axis)


if __name__ == "__main__":
    main()
