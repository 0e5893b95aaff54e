"""Times one sweep here, on one worker process and on two; prints a table.

Run from the repository's root: ``python benchmarks/sweep_scaling.py [DRAWS]``.  The
sweep is the five-bar robot at 100 postures with DRAWS draws of errors each; worker
processes are started and warmed by a short sweep of their own before the clock runs.
Two processes are compared with one worker, so what Dask costs shows in the first ratio
and how it scales in the second.  The three files are compared byte by byte.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from distributed import Client, LocalCluster

from assembly.model.error_distributions import tolerance_sources
from assembly.robots import load_robot
from assembly.sweeps.cluster import cluster_solver
from assembly.sweeps.plan import Sweep
from assembly.sweeps.quantities import Question
from assembly.sweeps.sweep import run_sweep, solve_here
from assembly.sweeps.targets import grid_targets, parse_grid


def sweep(draws):
    """100 postures of the five-bar robot, all within reach."""
    robot = load_robot("five_bar")
    targets = grid_targets(parse_grid("tx=-0.018:0.018:0.004,ty=0.11:0.146:0.004"))
    sources = tolerance_sources(robot, np.array([1e-4] * 3 + [1e-5] * 3))
    question = Question(robot, None, (), targets.names, sources, 1, "frozen")
    return Sweep(question, targets, (), draws)


def timed(asked, path, solve, tasks):
    """Seconds of a sweep after a short one."""
    run_sweep(sweep(20), path, solve=solve)
    tasks.clear()
    start = time.perf_counter()
    run_sweep(asked, path, solve=solve)
    return time.perf_counter() - start


def main(draws=400):
    """Run, compare and print."""
    asked = sweep(draws)
    print(f"{asked.size} points in {asked.blocks} blocks")
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{n}.nc" for n in range(3)]
        times = [timed(asked, paths[0], solve_here, [])]
        print(
            f"here           {times[0]:6.1f} s  {asked.size / times[0]:6.0f} points/s"
        )
        for workers in (1, 2):
            with (
                LocalCluster(
                    n_workers=workers, threads_per_worker=1, dashboard_address=None
                ) as cluster,
                Client(cluster),
            ):
                tasks = []
                solve = cluster_solver(
                    scheduler=cluster.scheduler_address, report=tasks.append
                )
                times.append(timed(asked, paths[workers], solve, tasks))
            seconds, ratio = times[-1], times[-2] / times[-1]
            rate = f"{asked.size / seconds:6.0f} points/s"
            print(f"{workers} process(es)  {seconds:6.1f} s  {rate}, {ratio:.2f} times "
                  f"the row above; {tasks[0]}")  # fmt: skip
        same = len({path.read_bytes() for path in paths}) == 1
    print("the three files are", "the same, byte by byte" if same else "DIFFERENT")
    return same


if __name__ == "__main__":
    sys.exit(0 if main(*map(int, sys.argv[1:2])) else 1)
