"""Evaluate cross-checks with clearances: convergence rate, time and agreement.

Run ``python benchmarks/evidence/crosscheck_play.py [draws [robot ...]]``.  With 120
draws for each robot, it takes several minutes.  It prints a table of
``docs/crosscheck.md``.
"""

import sys
import time

import numpy as np
from crosscheck_robots import drawn, hexapod, papers_robot, three_rrr

from forcefit.assembly.kinematics.posture import Posture, home_posture, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.inputs.table import BadInput
from forcefit.validation.crosscheck.clearance_metric import FLOOR_ENERGY
from forcefit.validation.crosscheck.pair import exact_solution
from forcefit.validation.multibody.simulation import (
    SimulationFailed,
    SimulationModel,
    simulate_assembly,
)


def posture(name: str, seed: int) -> Posture:
    """Return a posture of a robot with random errors.  IRSBot-2 has a random pose."""
    if name != "irsbot2":
        make = {"hexapod": hexapod, "three_rrr": three_rrr}[name]
        return home_posture(drawn(make(play=True), seed, 2e-3, 2e-4))
    robot, rng = papers_robot(seed, signed=seed % 2 == 1), np.random.default_rng(seed)
    while True:
        pose = {"tx": rng.uniform(-0.4, 0.4), "tz": rng.uniform(-0.6, -0.2)}
        try:
            return place_robot(robot, pose)
        except BadInput:
            continue


def main() -> None:
    """Print a row of the table for each robot."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 120
    print("robot      converged  seconds, median and most   energy against exact, "
          "median, 90 %, most   against linear")  # fmt: skip
    for name in sys.argv[2:] or ("irsbot2", "hexapod", "three_rrr"):
        seconds, exact, linear, converged = [], [], [], 0
        for seed in range(draws):
            case = posture(name, seed)
            started = time.perf_counter()
            try:
                simulated = simulate_assembly(
                    case, model=SimulationModel(clearances=True)
                )
            except SimulationFailed as error:
                print(f"  {name} {seed}: {error}")
                continue
            finally:
                seconds.append(time.perf_counter() - started)
            converged += 1
            best = solve_assembly(case)
            for values, model in ((linear, best), (exact, exact_solution(best))):
                if model is not None:
                    size = max(model.energy, FLOOR_ENERGY)
                    values.append(abs(simulated.rigid_energy - model.energy) / size)
        print(
            f"{name:10} {converged}/{draws}    {np.median(seconds):.2f} "
            f"{max(seconds):.2f}   "
            + " ".join(f"{v:.1e}" for v in np.percentile(exact, [50, 90, 100]))
            + f" ({len(exact)})   "
            + " ".join(f"{v:.1e}" for v in np.percentile(linear, [50, 90, 100]))
        )


if __name__ == "__main__":
    main()
