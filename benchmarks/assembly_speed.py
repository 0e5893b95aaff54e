"""Measure the speed of problems (22) and (21) on one core, compared with other solvers.

Run ``python -m benchmarks.assembly_speed``, which takes about ten seconds.  The robot
is IRSBot-2 with the first set of errors in ``tests/irsbot2_numbers.json``.  The
postures are a 25 mm grid of its workspace.  The program prints tables of

- the processor time [us] per point for the energy (22), for the errors multiplied by 1
  and by 0.2;
- the same under loads, for the errors multiplied by 1, 0.2 and 0, and for random errors
  at one posture;
- the same for the margin (21), with compliant joints rigid and free;
- the time of other functions;
- the fraction of points with a certified energy, and the number of points solved by the
  reference method.

The methods are cvxpy with a new model for each point, cvxpy with parameters (DPP),
Clarabel on the full problem and on the reduced problem, moreau on a batch of full
problems, the reference method in numpy, and ``solve_assembly`` for one and for many
postures.  The tables contain the ratio of the DPP time to each time.

Slow methods run on a sample of the grid.  Only the batches of forcefit are repeated,
and the shortest time is used.
"""

# ruff: noqa: E402  one thread must be asked for before numpy is imported
import json
import os

for name in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{name}_NUM_THREADS"] = "1"

import gc
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.assembly_peers import (
    GRAVITY,
    LOAD,
    Dpp,
    clarabel_full,
    clarabel_reduced,
    closure_matrices,
    cvxpy_rebuilt,
    loaded_matrices,
    moreau_batched,
)
from forcefit.assembly.kinematics.posture import (
    Posture,
    place_many,
    place_robot,
    together,
)
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots.irsbot2 import NAMES, irsbot2

NUMBERS = Path(__file__).parents[1] / "tests" / "irsbot2_numbers.json"
SAMPLE = 24  # number of points for the slow methods
READINGS = ("rigid", "free")


def paper_robot() -> Robot:
    """Return IRSBot-2 with the first set of errors."""
    robot = irsbot2()
    case = json.loads(NUMBERS.read_text())["cases"][0]
    errors = np.zeros((len(robot.frames), 6))
    for key, value in case["dl"].items():
        leg, index = key.split("_frame")
        errors[robot.index(f"{leg}.{NAMES[int(index) - 1]}")] = value
    return robot.with_errors(errors)


def workspace(robot: Robot, step: float = 0.025) -> list[Posture]:
    """Return the postures on a grid below the base."""
    x, z = np.meshgrid(np.arange(-0.65, 0.651, step), np.arange(-0.75, 0.001, step))
    poses = np.full((x.size, 6), np.nan)
    poses[:, 0], poses[:, 2] = x.ravel(), z.ravel()
    return [posture for posture in place_many(robot, poses)[0] if posture is not None]


def timed(solve: Callable[..., object], postures: Iterable) -> float:
    """Return the processor time [us] per point, and the number of failures."""
    failed = count = 0
    gc.collect()
    gc.disable()  # a garbage collection takes as long as a thousand calls
    start = time.process_time()
    for one in postures:
        count += 1
        try:
            solve(one)
        except RuntimeError:
            failed += 1
    taken = (time.process_time() - start) / count * 1e6
    gc.enable()
    if failed:
        print(f"  ({failed} of {count} failed in the next row)")
    return taken


def batched(solve: Callable[..., object], postures: list[Posture]) -> float:
    """Return the shortest processor time [us] per point of ten runs of a batch."""
    at, best = together(postures), np.inf
    for _ in range(10):
        start = time.process_time()
        solve(at)
        best = min(best, (time.process_time() - start) / len(postures) * 1e6)
    return best


def print_table(title: str, rows: dict[str, float]) -> None:
    """Print the times, and the ratio of the DPP time to each time."""
    print(f"\n{title}\n{'':38}{'us/point':>10}{'DPP / time':>13}")
    dpp = rows["cvxpy DPP, scaled"]
    for name, value in rows.items():
        print(f"{name:38}{value:10.1f}{dpp / value:13.2f}")


def print_energies(robot: Robot, postures: list[Posture], kappa: float) -> None:
    """Print the table of problem (22) at a multiple of the errors."""
    scaled = robot.with_errors(kappa * robot.errors)
    own = [replace(p, robot=scaled) for p in postures]
    few = own[:: len(own) // SAMPLE][:SAMPLE]
    for posture in own:  # the first calls import and compile code
        solve_assembly(posture)
    data = [closure_matrices(p) for p in few]
    rows = {
        "cvxpy rebuilt, SI": timed(cvxpy_rebuilt, few[::3]),
        "cvxpy DPP, scaled": timed(Dpp(robot, False, False, data), data),
        "Clarabel, full problem, scaled": timed(clarabel_full, few),
        "Clarabel, our reduction (numpy)": timed(clarabel_reduced, few),
        "moreau, batched, full problem": moreau_batched(own),
        "ours, reference in numpy": timed(
            partial(solve_assembly, method="reference"), few
        ),
        "ours, one at a time": timed(solve_assembly, own),
        "ours, batched": batched(solve_assembly, own),
    }
    print_table(f"energy (22), errors times {kappa:g}", rows)


def print_loaded(robot: Robot, postures: list[Posture], kappa: float) -> None:
    """Print the table of problem (22) under loads at a multiple of the errors."""
    scaled = robot.with_errors(kappa * robot.errors)
    own = [replace(p, robot=scaled) for p in postures]
    few = own[:: len(own) // SAMPLE][:SAMPLE]

    loaded = {"load": LOAD, "gravity": GRAVITY}
    for posture in own:
        solve_assembly(posture, **loaded)
    data = [loaded_matrices(p) for p in few]
    dpp = Dpp(robot, False, False, data)
    rows = {
        "cvxpy DPP, scaled": timed(dpp, data),
        "ours, reference in numpy": timed(
            partial(solve_assembly, **loaded, method="reference"), few
        ),
        "ours, one at a time": timed(partial(solve_assembly, **loaded), own),
        "ours, batched": batched(partial(solve_assembly, **loaded), own),
    }
    errors = kappa * np.linspace(-1, 1, 2000)[:, None, None] * robot.errors
    draw = partial(solve_assembly, own[len(own) // 2], **loaded, errors=errors)
    taken = batched(lambda at: draw(), own)
    rows["ours, draws at one posture"] = taken * len(own) / len(errors)
    print_table(f"energy (22) under loads, errors times {kappa:g}", rows)


def print_margins(postures: list[Posture]) -> None:
    """Print the table of problem (21) with compliant joints rigid and free."""
    few = postures[:: len(postures) // SAMPLE][:SAMPLE]
    for reading in READINGS:
        ours = partial(zone_margin, compliant=reading)
        ours(few[0])
        reference = partial(zone_margin, compliant=reading, method="reference")
        data = [closure_matrices(p, False, reading == "free") for p in few]
        rows = {
            "cvxpy DPP, scaled": timed(
                Dpp(few[0].robot, reading == "free", True, data), data
            ),
            "ours, reference in numpy": timed(reference, few),
            "ours, one at a time": timed(ours, postures),
            "ours, batched": batched(ours, postures),
        }
        print_table(f"margin (21), compliant {reading}", rows)


def print_calls(robot: Robot, postures: list[Posture]) -> None:
    """Print the table of the times of other functions."""
    some = [solve_assembly(posture) for posture in postures[::8]]
    poses = [{k: v for k, v in p.pose().items() if k in ("tx", "tz")} for p in postures]
    grid = np.full((len(poses), 6), np.nan)
    grid[:, [0, 2]] = [list(pose.values()) for pose in poses]
    calls: dict[str, tuple[Callable[..., object], list]] = {
        f"bound_pose_error, {reading}": (
            partial(bound_pose_error, assumption=reading), some
        )
        for reading in ("frozen", "free")
    }  # fmt: skip
    for reading in ("frozen", "free"):
        calls[f"the same in numpy, {reading}"] = (
            partial(bound_pose_error, assumption=reading, method="reference"),
            some[::12],
        )  # fmt: skip
    calls["place_robot"] = partial(place_robot, robot), poses[::4]
    print("\ntimes of other functions [us]")
    for name, (call, questions) in calls.items():
        call(questions[0])
        print(f"{name:38}{timed(call, questions):10.1f}")
    start = time.process_time()
    place_many(robot, grid)
    taken = (time.process_time() - start) / len(grid) * 1e6
    print(f"{'place_many, a pose within reach':38}{taken:10.1f}")


def print_certified(robot: Robot, postures: list[Posture]) -> None:
    """Print the fractions of certified points and of reference solutions."""
    at = together(postures)
    print(f"\ncertified energies of {len(postures)} points")
    for kappa in (0.0, 0.05, 0.1, 0.2, 0.5, 1.0):
        sets = np.repeat(kappa * robot.errors[None], len(postures), axis=0)
        answers = solve_assembly(at, errors=sets)
        share, slow = answers.certified.mean(), np.mean(answers.method == "reference")
        print(
            f"errors times {kappa:<5g} {share:8.2%}, by the reference method {slow:.2%}"
        )
    for size in (1e-3, 0.1, 1.0, 10.0):
        for kappa in (0.0, 0.2, 1.0):
            scaled = robot.with_errors(kappa * robot.errors)
            own = replace(at, robot=scaled)
            answers = solve_assembly(own, size * LOAD, gravity=size * GRAVITY)
            share = answers.certified.mean()
            slow = np.mean(answers.method == "reference")
            print(
                f"loads times {size:<6g} errors times {kappa:<5g} {share:8.2%}, by the "
                f"reference method {slow:.2%}"
            )


def main() -> None:
    """Print all tables."""
    robot = paper_robot()
    postures = workspace(robot)
    print(f"{robot.name}, {len(postures)} points, one core")
    for kappa in (1.0, 0.2):
        print_energies(robot, postures, kappa)
    for kappa in (1.0, 0.2, 0.0):
        print_loaded(robot, postures, kappa)
    print_margins(postures)
    print_calls(robot, postures)
    print_certified(robot, postures)


if __name__ == "__main__":
    main()
