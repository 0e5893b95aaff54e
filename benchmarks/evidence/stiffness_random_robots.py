"""Compare K_C of random robots by several methods.

``python -m benchmarks.evidence.stiffness_random_robots``

There are 100 random robots with one to three legs, clearances, errors and loads.  Each
robot is evaluated in its home pose and at two other poses.  The built-in robots follow.
``--seed 10000 --robots 100`` selects other random robots.  The comparisons are:

- the exact tangent with finite differences of the exact equilibrium;
- the classical matrix with problem (22) without clearances, with the compiled method,
  and with Exudyn (load steps, and the linearised system);
- the exact tangent with errors and a load with the linearised system of Exudyn.

For each robot, the program prints the differences of the matrices, relative to
sqrt(C_ii C_jj), or the reason why there is no matrix.

The finite differences are extrapolated from several steps of the load.  Small steps
have large round-off errors, and large steps change the contacts.  The result that
differs least from the results of adjacent steps is used.

For the comparison under load, the locked rotations of an elastic joint have a stiffness
of 1e8, because large rotations of such a joint are not defined uniquely (see
``forcefit.validation.crosscheck.stiffness_check``).  The load moves the platform by
0.03 rad or 0.03 reference lengths, or less if there is no equilibrium.  If both
programs find different equilibria, they are not compared.
"""

import argparse
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.kinematics.posture import (
    Posture,
    home_posture,
    place_many_joints,
)
from forcefit.assembly.kinematics.se3 import turn_jacobian
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.platform_stiffness.exact_tangent import exact_tangent
from forcefit.assembly.platform_stiffness.linear_tangent import without_clearance
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import BUILT_IN, load_robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.stiffness.screws import rotation_vector
from forcefit.validation.crosscheck.link_models import link_models
from forcefit.validation.multibody.extrapolation import steadiest, without_squares
from forcefit.validation.multibody.exudyn_parts import OutOfTime, SimulationFailed
from forcefit.validation.multibody.simulation import without_clearance as unplayed
from forcefit.validation.multibody.tangent import simulated_tangent
from tests.robots_for_tests import random_robot

SIZES = (0.1, 0.3, 1.0)
LEGS = {1: 3, 2: 6, 3: 7}  # number of joints in each leg, by number of legs
TIME_LIMIT = 20.0  # [s] time limit of a simulation
ERRORS = np.repeat([1e-3, 1e-4], 3)  # [rad, m] largest errors of the built-in robots
# [rad or m] largest motion of drives, and smallest motion to another pose
_FAR, _MOVED = 0.1, 1e-3
_SIZE = np.repeat([1.0, 20.0], 3)  # [N m, N] standard deviation of loads
_STEPS = 0.5 * 0.2 ** np.arange(8)  # [-] load steps, relative to the load
_MOVES = 0.03  # [rad or reference lengths] motion of the platform under load
_STIFF = 1e8  # [N m/rad, N/m] stiffness of locked rotations


def relative(C: NDArray, other: NDArray) -> float:
    """Return the largest difference of finite entries, relative to sqrt(C_ii C_jj)."""
    size = np.sqrt(np.abs(np.diag(C)))
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(C - other) / np.outer(size, size)
    return float(np.nan_to_num(off, posinf=0.0).max(initial=0.0))


def limit(steps: list[float], slopes: list[NDArray]) -> NDArray:
    """Return central differences, extrapolated to a step of zero, (6,)."""
    better = without_squares(steps, slopes)
    # rotations and translations of a column are scaled separately
    size = np.abs(better).max(axis=0) + 1e-300
    return steadiest(better, lambda change: float((change / size).max()))[0]


def carried(posture: Posture, load: NDArray) -> tuple[ExactAssembly, float]:
    """Return the equilibrium under a load, which is reduced if none is found."""
    for share in (1.0, 0.1):
        try:
            return solve_exact(posture, share * load), share
        except SolverFailed:
            continue
    return solve_exact(posture, 0.01 * load), 0.01


def slope_by(equilibrium: ExactAssembly, unit: NDArray) -> NDArray:
    """Return the derivative with respect to a load by differences, (6,)."""
    steps, slopes = list[float](), list[NDArray]()
    for step in _STEPS:
        try:
            ahead, back = (
                solve_exact(
                    equilibrium.posture, equilibrium.load + sign * step * unit,
                    near=equilibrium,
                ).platform_screw
                for sign in (1, -1)
            )  # fmt: skip
        except SolverFailed:
            # there may be no equilibrium for a large step
            if step <= _STEPS[-3]:
                raise
            steps.clear()
            slopes.clear()
        else:
            steps.append(step)
            slopes.append((ahead - back) / (2 * step))
    return limit(steps, slopes)


def by_differences(posture: Posture, load: NDArray) -> tuple[float, str]:
    """Compare the exact tangent with central differences, or return a reason."""
    try:
        equilibrium, share = carried(posture, load)
        C = exact_tangent(equilibrium).compliance
        finite = np.flatnonzero(np.isfinite(C).all(axis=0))
        size = share * _SIZE
        columns = [
            slope_by(equilibrium, size[row] * np.eye(6)[row]) / size[row]
            for row in finite
        ]
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return np.nan, type(error).__name__
    if not len(finite):
        return np.nan, "free in all directions"
    J = np.eye(6)
    J[:3, :3] = turn_jacobian(equilibrium.platform_screw[:3])
    if len(finite) < 6 and np.abs(J - np.eye(6)).max() > 1e-12:
        return np.nan, "rotated, and free in some directions"
    D = J @ np.column_stack(columns)
    D = D @ J.T if len(finite) == 6 else D
    off = relative(C[np.ix_(finite, finite)], D[finite])
    return off, f"compared under {share:g} of the load"


def by_least_energy(posture: Posture) -> float:
    """Compare the classical matrix with problem (22), without clearances and errors."""
    robot = posture.robot
    frames = tuple(replace(f, clearance=None) for f in robot.frames)
    tight = replace(robot, frames=frames).with_errors(np.zeros_like(robot.errors))
    posture = replace(posture, robot=tight)
    C = without_clearance(posture).compliance
    finite = np.flatnonzero(np.isfinite(C).all(axis=0))
    moved = [solve_assembly(posture, np.eye(6)[row]).platform_screw for row in finite]
    if not moved:
        return np.nan
    part = np.ix_(finite, finite)
    return relative(C[part], np.array(moved).T[finite])


def by_simulation(posture: Posture) -> tuple[dict[str, float], str]:
    """Compare the classical matrix with Exudyn for the robot without errors."""
    robot = unplayed(posture.robot)
    posture = replace(posture, robot=robot.with_errors(np.zeros_like(robot.errors)))
    C = without_clearance(posture)
    if C.free.size:
        return {}, "FreeMotion"
    model = link_models(posture.robot, "spring")
    try:
        answer = simulated_tangent(posture, model, time_limit=TIME_LIMIT)
    except SimulationFailed as error:
        return {}, type(error).__name__
    return {
        "steps": relative(C.compliance, answer.stepped),
        "linearised": relative(C.compliance, answer.linearised),
        "steps known to": answer.stepped_error,
        "error of the linearisation": answer.linearised_error,
    }, "compared"


def loaded_by_simulation(posture: Posture, load: NDArray) -> tuple[float, str]:
    """Compare the exact tangent under a load with the linearised system of Exudyn."""
    robot = replace(posture.robot, frames=tuple(map(all_elastic, posture.robot.frames)))
    posture = replace(posture, robot=unplayed(robot))
    classical = without_clearance(posture)
    if classical.free.size:
        return np.nan, "FreeMotion"
    moved = classical.compliance @ load / np.repeat([1.0, classical.length], 3)
    model = link_models(posture.robot, "spring")
    reason = ""
    for share in (1.0, 0.1, 0.01):
        w = share * _MOVES / np.abs(moved).max() * load
        couples = np.zeros((len(robot.frames), 6))
        couples[robot.index(robot.platform), :3] = w[:3]
        try:
            equilibrium = solve_exact(posture, w * [0, 0, 0, 1, 1, 1], bodies=couples)
            C = exact_tangent(equilibrium).compliance
            answer = simulated_tangent(
                posture, model, w, steps=False, time_limit=TIME_LIMIT
            )
        except (
            CannotAssemble,
            FreeMotion,
            SolverFailed,
            OutOfTime,
            SimulationFailed,
        ) as error:
            reason = reason or type(error).__name__
        else:
            here = equilibrium.platform_screw
            if stands_elsewhere(posture, classical.length, here, answer.platform):
                which = "stable" if answer.stable else "unstable"
                return np.nan, f"another equilibrium in Exudyn, {which}"
            off = relative(C, answer.linearised)
            return off, f"compared under {share:g} of the load"
    return np.nan, reason


def stands_elsewhere(
    posture: Posture, length: float, screw: NDArray, platform: NDArray
) -> bool:
    """Return whether two platform poses differ by more than a tenth of the motion."""
    nominal = posture.platform
    turn = rotation_vector(platform[:3, :3] @ nominal[:3, :3].T)
    other = np.concatenate([turn, platform[:3, 3] - nominal[:3, 3]])
    scale = np.repeat([length, 1.0], 3)
    way = max(np.linalg.norm(scale * screw), np.linalg.norm(scale * other))
    return bool(np.linalg.norm(scale * (other - screw)) > 0.1 * way)


def all_elastic(frame: Frame) -> Frame:
    """Return a frame with a large finite stiffness instead of locked directions."""
    if frame.springs is None:
        return frame
    K = np.diag(frame.springs).copy()
    if not np.isinf(K).any() or np.isinf(K).all():
        return frame
    K[np.isinf(K)] = _STIFF
    return replace(frame, joint_stiffness=np.diag(K))


def moved_postures(robot: Robot, rng: np.random.Generator) -> list[Posture]:
    """Return the home posture and up to two other postures."""
    home = home_posture(robot)
    driven = np.array([frame.actuated for frame in robot.frames])
    steps = rng.uniform(-_FAR, _FAR, (8, len(driven)))
    goals = np.where(driven, robot.positions + steps, np.nan)
    moved = [
        posture
        for posture in place_many_joints(robot, goals)[0]
        if posture and np.abs(posture.platform - home.platform).max() > _MOVED
    ]
    return [home, *moved[:2]]


def built_in() -> Iterator[tuple[str, list[Posture], NDArray]]:
    """Yield postures and loads of built-in robots with random errors."""
    for seed, name in enumerate(BUILT_IN):
        rng, robot = np.random.default_rng(seed), load_robot(name)
        errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * ERRORS
        robot = robot.with_errors(errors)
        load = rng.normal(size=6) * _SIZE
        postures = moved_postures(robot, rng)
        if len(postures) < 3:
            sized = (robot.with_errors(size * robot.errors) for size in SIZES)
            postures = [replace(postures[0], robot=one) for one in sized]
        yield name, postures, load


def random_ones(seed: int, robots: int) -> Iterator[tuple[str, list[Posture], NDArray]]:
    """Yield postures and loads of random robots that can move."""
    drawn, kept, loops = 0, 0, 0
    while kept < robots:
        rng = np.random.default_rng(seed + drawn)
        drawn += 1
        legs = int(rng.integers(1, 4))
        robot = random_robot(rng, legs=legs, joints=LEGS[legs])
        load = rng.normal(size=6) * _SIZE
        postures = moved_postures(robot, rng)
        if len(postures) == 3:
            kept, loops = kept + 1, loops + (legs > 1)
            yield str(seed + drawn - 1), postures, load
    print(f"{robots} of {drawn} random robots can move, {loops} of them with loops")


def compare(robots: Iterable[tuple[str, list[Posture], NDArray]]) -> None:
    """Print the comparisons for the given robots."""
    reasons: dict[str, Counter[str]] = {
        "exact": Counter(), "Exudyn": Counter(), "Exudyn, loaded": Counter()
    }  # fmt: skip
    values: dict[str, list[tuple[float, str]]] = {}
    for name, postures, load in robots:
        for k, posture in enumerate(postures):
            case = f"{name}/{k}"
            many = platform_stiffness([posture])
            one = without_clearance(posture)
            rows = {"classical, (22)": by_least_energy(posture)}
            if not one.free.size:
                rows["compiled, one by one"] = relative(
                    one.compliance, many.compliance[0]
                )
            off, reason = by_differences(posture, load)
            rows["exact tangent, differences"] = off
            reasons["exact"][reason] += 1
            simulated, reason = by_simulation(posture)
            rows |= {f"classical, Exudyn, {key}": v for key, v in simulated.items()}
            reasons["Exudyn"][reason] += 1
            off, reason = loaded_by_simulation(posture, load)
            rows["exact, Exudyn, linearised"] = off
            reasons["Exudyn, loaded"][reason] += 1
            for key, value in rows.items():
                values.setdefault(key, []).append((value, case))
    for key, differences in values.items():
        known = sorted(pair for pair in differences if np.isfinite(pair[0]))
        sizes = [value for value, _ in known]
        largest = ", ".join(f"{v:.1e} ({case})" for v, case in known[:-4:-1])
        print(
            f"{key:40s} {len(known):4d}: median {np.median(sizes):.1e}, "
            f"90 % {np.quantile(sizes, 0.9):.1e}, largest {largest}"
        )
    for key, counts in reasons.items():
        print(key, ", ".join(f"{r}: {n}" for r, n in counts.most_common()))


def main() -> None:
    """Print the comparisons for random and built-in robots."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=10_000)
    parser.add_argument("--robots", type=int, default=100)
    asked = parser.parse_args()
    print("built-in robots")
    compare(built_in())
    print("random robots")
    compare(random_ones(asked.seed, asked.robots))


if __name__ == "__main__":
    main()
