"""Measure time and memory for up to a million points and ten million energies.

    python -m benchmarks.scale [LARGEST]

A sweep of a four-bar linkage with twelve random errors computes energy, margins and
pose error bounds for 1000 crank angles and 1, 10, 100, ... draws, up to LARGEST points
(10^6 by default).  Then 10^7 energies of IRSBot-2 at one posture are computed.  Each
computation runs in a separate process.  The table contains the number of points, the
processor time [s], the processor time per point [us], the peak memory and the file
size.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ANGLES, SMALLEST, LARGEST = 1000, 1000, 1_000_000
BLOCK, ENERGIES = 100_000, 10_000_000


def sweep(draws: int, path: Path) -> int:
    """Write a sweep with given draws to a file, and return the number of points."""
    from forcefit.assembly.model.error_distributions import tolerance_sources
    from forcefit.assembly.robots import load_robot
    from forcefit.assembly.sweeps.plan import Sweep
    from forcefit.assembly.sweeps.quantities import Question
    from forcefit.assembly.sweeps.sweep import run_sweep
    from forcefit.assembly.sweeps.targets import grid_targets, parse_grid

    robot = load_robot("four_bar")
    (drive,) = (frame.name for frame in robot.frames if frame.actuated)
    step = 6.0 / ANGLES
    grid = parse_grid(f"q.{drive}=0.0:{6.0 - step / 2}:{step}", robot)
    targets = grid_targets(grid)
    sources = tolerance_sources(robot, np.array([1e-5] * 6))
    question = Question(robot, None, (), targets.names, sources, 1, "frozen")
    asked = Sweep(question, targets, (), draws)
    run_sweep(asked, path)
    return asked.size


def energies(count: int) -> int:
    """Compute minimum energies at one posture for different errors."""
    from forcefit.assembly.kinematics.posture import place_robot
    from forcefit.assembly.linear.energy import solve_assembly
    from forcefit.assembly.robots import load_robot

    posture = place_robot(load_robot("irsbot2"), {"tx": 0.1, "tz": -0.5})
    n, done = len(posture.robot.frames), 0
    rng = np.random.default_rng(0)
    bodies = [frame.link is not None for frame in posture.robot.frames]
    while done < count:
        errors = np.zeros((min(BLOCK, count - done), n, 6))
        errors[:, bodies] = 1e-4 * rng.normal(size=(len(errors), sum(bodies), 6))
        assert solve_assembly(posture, errors=errors).certified.all()
        done += len(errors)
    return count


def case(name: str, count: int) -> None:
    """Run a computation, and print points, time [s], memory [MB] and file size [MB]."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sweep.nc"
        began = time.process_time()
        points = sweep(count, path) if name == "sweep" else energies(count)
        seconds = time.process_time() - began
        size = path.stat().st_size / 1e6 if path.exists() else 0.0
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(points, seconds, memory, size)


def measured(name: str, count: int) -> tuple[int, float, float, float]:
    """Run a computation in a separate process, and return its printed values."""
    words = [sys.executable, "-m", "benchmarks.scale", name, str(count)]
    done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True)
    points, *figures = done.stdout.splitlines()[-1].split()
    return int(points), *map(float, figures)  # type: ignore[return-value]


def main(largest: int = LARGEST) -> None:
    """Print the table."""
    print(f"{'':10}{'points':>10}{'s':>9}{'us/point':>10}{'MB':>8}{'file, MB':>10}")
    measured("sweep", 1)  # the first run compiles the code
    draws, first = 1, None
    while SMALLEST * draws <= largest:
        points, seconds, memory, size = measured("sweep", draws)
        first = first or (points, seconds)
        more = points - first[0]
        each = f"{(seconds - first[1]) / more * 1e6:10.1f}" if more else f"{'':10}"
        print(f"{'sweep':10}{points:10}{seconds:9.1f}{each}{memory:8.0f}{size:10.1f}")
        draws *= 10
    measured("energies", BLOCK)
    for count in (ENERGIES // 100, ENERGIES // 10, ENERGIES):
        points, seconds, memory, _ = measured("energies", count)
        each = f"{seconds / points * 1e6:10.1f}"
        print(f"{'energies':10}{points:10}{seconds:9.1f}{each}{memory:8.0f}")


if __name__ == "__main__":
    if len(sys.argv) > 2:
        case(sys.argv[1], int(sys.argv[2]))
    else:
        main(*map(int, sys.argv[1:]))
