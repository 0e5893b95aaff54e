"""Measure the number of certified energy problems per second at one posture.

Run ``python benchmarks/monte_carlo_speed.py [DRAWS]``.  The geometric errors of
IRSBot-2 have uniform distributions up to a fraction of the errors in the paper.  For
each fraction, the program prints the fractions of draws without energy, of certified
draws, and of draws that the reference method solved.  It also prints the number of
draws per second of processor time and of wall time, and the time for 1e7 draws.
"""

import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.model.error_distributions import ErrorSources
from forcefit.assembly.model.random_errors import frames_named
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.linear_response import LinearResponse, linear_response

FRAMES = ("elbow_a", "link_a", "elbow_b", "link_b", "loop2_platform", "tip")
PAPER = np.array([2e-2] * 3 + [2e-4] * 3)  # [rad, m]
SHARES = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02)
# number of draws per block, target number of draws, and target time [s]
BLOCK, TARGET, GOAL = 4096, 1e7, 600.0


def paper_sources(share: float) -> ErrorSources:
    """Return random errors with a multiple of the widths of the paper."""
    robot = load_robot("irsbot2")
    rows = [robot.index(name) for name in frames_named(robot, FRAMES)]
    count = 6 * len(rows)
    zero = np.zeros(count)
    return ErrorSources(
        robot, np.repeat(rows, 6), np.tile(np.arange(6), len(rows)),
        np.zeros(count, dtype=int), zero, share * np.tile(PAPER, len(rows)), zero, zero,
        np.ones(count, dtype=bool),
    )  # fmt: skip


def solve_block(one: LinearResponse, sources: ErrorSources, block: int) -> NDArray:
    """Return the numbers of draws without energy, certified, and by the reference."""
    errors = sources.errors(sources.draw(block * BLOCK, BLOCK, seed=1))
    draws = one.solve(errors)
    reference = draws.method == "reference"
    none = np.sum(draws.energy <= 1e-20)
    return np.array([none, draws.certified.sum(), reference.sum()])


def run(one: LinearResponse, sources: ErrorSources, blocks: int, threads: int) -> tuple:
    """Return the draws per second of processor time and wall time, and fractions."""
    clock, processor = time.perf_counter(), time.process_time()
    with threadpool_limits(1), ThreadPoolExecutor(threads) as pool:
        counts = list(pool.map(lambda b: solve_block(one, sources, b), range(blocks)))
    draws = blocks * BLOCK
    used = time.process_time() - processor, time.perf_counter() - clock
    return draws / used[0], draws / used[1], np.sum(counts, axis=0) / draws


def main() -> None:
    """Print the table."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    blocks = -(-draws // BLOCK)
    posture = place_robot(load_robot("irsbot2"), pose={"tx": 0.1, "tz": -0.5})
    one = linear_response(posture)
    print(f"{blocks * BLOCK} draws in each row; target {TARGET:.0e} in {GOAL:.0f} s")
    print(
        "errors  no energy  certified  reference  per core s  1e7, 2 cores [s]  "
        "2 threads, per s"
    )
    for share in SHARES:
        sources = paper_sources(share)
        solve_block(one, sources, 0)  # the first call imports modules
        single, _, (without, certified, reference) = run(one, sources, blocks, 1)
        _, double, _ = run(one, sources, blocks, 2)
        print(
            f"{share:6.2f}  {without:9.3f}  {certified:9.5f}  {reference:9.4f}  "
            f"{single:10.0f}  {TARGET / single / 2:17.0f}  {double:16.0f}"
        )


if __name__ == "__main__":
    main()
