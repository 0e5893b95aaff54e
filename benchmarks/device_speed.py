"""(22) and (21) on a GPU against the processor, in one run.

    python -m benchmarks.device_speed [POINTS]

The paper's robot at one posture, POINTS (default 10^6) draws of errors: seconds from
arrays to arrays, transfers counted, problems a second, and by how much the answers
differ over what both certificates allow.  The first launch, which compiles, is left
out.  Without a device it says so.
"""

import sys
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import Posture, place_robot
from assembly.linear import device
from assembly.linear.energy import minimise_energies
from assembly.linear.zone import zone_margins
from assembly.robots import load_robot

POINTS = 1_000_000
SIGMA = 1e-4  # [rad, m] of the bodies' errors


def draws(posture: Posture, count: int) -> tuple[NDArray, NDArray]:
    """(k, n, 4, 4) frames and (k, n, 6) errors."""
    frames = posture.robot.frames
    bodies = [frame.link is not None for frame in frames]
    errors = np.zeros((count, len(frames), 6))
    normal = np.random.default_rng(0).normal(size=(count, sum(bodies), 6))
    errors[:, bodies] = SIGMA * normal
    T = np.broadcast_to(posture.transforms, (count, *posture.transforms.shape))
    return np.ascontiguousarray(T), errors


def timed(solve: Callable[[], NDArray]) -> tuple[float, NDArray]:
    """Seconds, and the answers."""
    began = time.perf_counter()
    answers = solve()
    return time.perf_counter() - began, answers


def main(count: int = POINTS) -> None:
    """Print a line for each problem."""
    if device.cuda_device() is None:
        print("no CUDA device, or CuPy is not installed (the extra `device`)")
        return
    posture = place_robot(load_robot("irsbot2"), {"tx": 0.1, "tz": -0.5})
    T, errors = draws(posture, count)
    off = np.full(count, posture.mismatch)

    def energies() -> NDArray:
        solved = minimise_energies(posture.robot, T, errors, off)
        assert solved.certified.all()
        return solved.energy

    def margins() -> NDArray:
        return zone_margins(posture.robot, T, "rigid", off, errors).margin

    for name, solve in (("(22)", energies), ("(21)", margins)):
        solve()  # compiles
        seconds, there = timed(solve)
        least, device.LEAST = device.LEAST, count + 1
        here_seconds, here = timed(solve)
        device.LEAST = least
        worst = np.max(np.abs(there - here) / (1e-8 * np.abs(here) + 1e-30))
        print(f"{name}: {count / seconds:.3g} a second on the device, "
              f"{count / here_seconds:.3g} on the processor; answers differ by "
              f"{worst:.2g} of what is certified")  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
