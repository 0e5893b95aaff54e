"""Measure the time of a sweep in this process and on one or two worker processes.

Run ``python -m benchmarks.sweep_scaling [DRAWS]`` in the root of the repository.  The
five-bar robot has 100 postures with DRAWS sets of random errors each.  The program
prints the ratio of the times with one worker and without workers, which shows the
overhead of Dask, and the ratio with two workers and with one.  The files are compared
byte by byte.

For comparison, a loop of sums and products and the points of the sweep without output
are run on one worker and on two workers simultaneously.  The shortest of five times is
used.  Processor times are more reliable than wall times if other programs are running.
"""

import os
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import dask
import numpy as np
from distributed import Client, LocalCluster

from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.robots import load_robot
from forcefit.assembly.sweeps.cluster import _QUIET, cluster_solver
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.points import solve_points
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.sweep import run_sweep, solve_here
from forcefit.assembly.sweeps.targets import grid_targets, parse_grid

TURNS = 5


def sweep(draws):
    """Return a sweep of the five-bar robot with 100 postures."""
    robot = load_robot("five_bar")
    targets = grid_targets(parse_grid("tx=-0.018:0.018:0.004,ty=0.11:0.146:0.004"))
    sources = tolerance_sources(robot, np.array([1e-4] * 3 + [1e-5] * 3))
    question = Question(robot, None, (), targets.names, sources, 1, "frozen")
    return Sweep(question, targets, (), draws)


def loop(_):
    """Return the time [s] of a loop of sums and products."""
    start, x = time.perf_counter(), 1.0
    for _ in range(8_000_000):
        x = 0.999999 * x + 1e-9
    return time.perf_counter() - start


def points(draws):
    """Return the time [s] to compute the first blocks of the sweep without output."""
    asked = sweep(draws)
    blocks = [asked.points(block) for block in range(min(asked.blocks, 64))]
    start = time.perf_counter()
    for block in blocks:
        solve_points(asked.question, block)
    return time.perf_counter() - start


def at_once(client, workers, work, draws):
    """Return the longest time [s] of simultaneous equal work on several workers."""
    asked = [
        client.submit(work, draws, workers=[worker], pure=False) for worker in workers
    ]
    return max(client.gather(asked))


def timed(asked, path, solve, client):
    """Return the wall time [s] of a sweep, and processor times of all processes."""

    def spent():
        workers = client.run(time.process_time).values() if client else ()
        return np.array([time.perf_counter(), time.process_time(), sum(workers)])

    before = spent()
    run_sweep(asked, path, solve=solve)
    return spent() - before


def main(draws=400):
    """Run all sweeps, compare the files, and print the times."""
    asked, short = sweep(draws), sweep(20)
    print(
        f"{asked.size} points in {asked.blocks} blocks; load {os.getloadavg()[0]:.1f}"
    )
    with ExitStack() as kept:
        folder = Path(kept.enter_context(tempfile.TemporaryDirectory()))
        kept.enter_context(dask.config.set(_QUIET))
        ways, tasks = {"here": (solve_here, None)}, []
        for count in (1, 2):
            cluster = kept.enter_context(
                LocalCluster(
                    n_workers=count, threads_per_worker=1, dashboard_address=None
                )
            )
            client = kept.enter_context(Client(cluster))
            address = cluster.scheduler_address
            ways[f"{count} process(es)"] = (
                cluster_solver(scheduler=address, report=tasks.append), client
            )  # fmt: skip
        workers = list(client.nthreads())  # the two
        best, machine = {}, {}
        for solve, _ in ways.values():
            run_sweep(short, folder / "short.nc", solve=solve)
        for work in (loop, points):
            at_once(client, workers, work, draws)
        for _ in range(TURNS):
            for name, (solve, own) in ways.items():
                taken = timed(asked, folder / f"{name[0]}.nc", solve, own)
                best[name] = np.minimum(best.get(name, np.inf), taken)
            for work in (loop, points):
                pair = [
                    at_once(client, some, work, draws)
                    for some in (workers[:1], workers)
                ]
                machine[work] = np.minimum(machine.get(work, np.inf), pair)
        same = len({path.read_bytes() for path in folder.glob("[h12].nc")}) == 1
    before = None
    for name, (seconds, here, theirs) in best.items():
        ratio = f", {before / seconds:.2f} times the row above" if before else ""
        print(
            f"{name:14} {seconds:6.2f} s  {asked.size / seconds:6.0f} points/s{ratio}; "
            f"processor {here:.2f} s in this process, {theirs:.2f} s in workers"
        )
        before = seconds
    print(f"last: {tasks[-1]}")
    for work, (one, two) in machine.items():
        print(
            f"the machine, {work.__name__}: two workers {2 * one / two:.2f} times one"
        )
    print("the files are", "identical" if same else "DIFFERENT")
    print(f"load {os.getloadavg()[0]:.1f}")
    return same


if __name__ == "__main__":
    sys.exit(0 if main(*map(int, sys.argv[1:2])) else 1)
