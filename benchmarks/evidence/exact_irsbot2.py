"""Compute exact equilibria of IRSBot-2 over its workspace.

Run ``python -m benchmarks.evidence.exact_irsbot2 [STEP_MM]``.  It prints the tables of
``docs/exact.md``: convergence, residuals, errors of the linear model, and times.  The
robot has the geometric errors of the paper, which are positive (``literal``) or have
random signs (``signed``).
"""

import sys
import time

import numpy as np

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import place_many
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.solvers.conic import SolverFailed
from tests.robots_for_tests import NUMBERS, irsbot2_with

COLUMNS = {
    "steps": "iterations",
    "closure": "open closure [rad, reference lengths]",
    "balance": "imbalance of forces, relative",
    "excess": "clearance excess, relative",
    "curvature": "least curvature [J/rad^2]",
    "rotation": "linear minus exact, rotation [rad]",
    "translation": "linear minus exact, translation [m]",
    "energy": "linear minus exact, energy, relative",
    "linear_time": "linear solve [s]",
    "exact_time": "exact solve [s], from the linear answer",
}


def workspace(step: float) -> np.ndarray:
    """Return the poses of a grid with z <= 0, (k, 6)."""
    x = step * np.arange(-round(0.7 / step), round(0.7 / step) + 1)
    z = step * np.arange(-round(0.8 / step), 1)
    X, Z = np.meshgrid(x, z)
    poses = np.full((X.size, 6), np.nan)
    poses[:, 0], poses[:, 2] = X.ravel(), Z.ravel()
    return poses


def measure(case: dict, poses: np.ndarray) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return the results at all reachable points, and the error messages."""
    rows, failed = [], []
    for posture in place_many(irsbot2_with(case), poses)[0]:
        if posture is None:
            continue
        started = time.perf_counter()
        linear = solve_assembly(posture)
        between = time.perf_counter()
        try:
            exact = solve_exact(posture, start=linear)
        except SolverFailed as error:
            pose = posture.pose()
            failed.append(f"x = {pose['tx']:.3f}, z = {pose['tz']:.3f}: {error}")
            continue
        done = time.perf_counter()
        error = exact.linearisation_error
        rows.append([
            exact.iterations, exact.closure_residual(), exact.stationarity,
            exact.clearance_excess(), exact.least_curvature,
            np.linalg.norm(error.rotation), np.linalg.norm(error.translation),
            abs(error.relative_energy), between - started, done - between,
        ])  # fmt: skip
    return dict(zip(COLUMNS, np.array(rows).T, strict=True)), failed


def main() -> None:
    """Print a table for each set of errors."""
    step = float(sys.argv[1]) * 1e-3 if len(sys.argv) > 1 else 0.025
    poses = workspace(step)
    for case in NUMBERS["cases"]:
        figures, failed = measure(case, poses)
        solved = len(figures["steps"])
        print(f"\n{case['name']}: {solved} of {solved + len(failed)} points converged")
        print(f"{'':44}{'least':>10}{'median':>10}{'99 %':>10}{'largest':>10}")
        for name, title in COLUMNS.items():
            least, *others = np.quantile(figures[name], [0, 0.5, 0.99, 1])
            cells = "".join(f"{value:10.2g}" for value in (least, *others))
            print(f"{title:44}{cells}")
        print(*failed, sep="\n")


if __name__ == "__main__":
    main()
