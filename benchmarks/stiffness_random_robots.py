"""K_C of random robots by several methods.

``python -m benchmarks.stiffness_random_robots``

100 robots of one to three legs, and the built-in ones, with play, errors and loads,
each three times: at home and two more poses to which its drives take it, or at three
sizes of its errors where they move nothing, as in most random loops.  The exact tangent
against differences of the exact equilibrium by the load; the classical matrix against
the least energy (22) without play; the compiled one against that of one posture at a
time.  Every robot has a matrix or a reason; differences are entries over
sqrt(C_ii C_jj).  Differences by the load are extrapolated from several steps, each by
itself, and of them that is taken which differs least from its neighbours (Ridders):
small steps leave the solver's noise, large ones meet other contacts.  The compared
tangent has no part in the choice.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import Posture, home_posture, place_many_joints
from assembly.kinematics.se3 import turn_jacobian
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.reduction import FreeMotion
from assembly.model.robot import Robot
from assembly.platform_stiffness.exact_tangent import exact_tangent
from assembly.platform_stiffness.linear_tangent import without_clearance
from assembly.platform_stiffness.many_stiffnesses import platform_stiffnesses
from assembly.robots import BUILT_IN, load_robot
from assembly.solvers.conic import SolverFailed
from tests.robots_for_tests import random_robot

ROBOTS, SIZES = 100, (0.1, 0.3, 1.0)
ERRORS = np.repeat([1e-3, 1e-4], 3)  # [rad, m] of the built-in robots
_FAR, _MOVED = 0.1, 1e-3  # [rad or m] of drives; what counts as another pose
_SIZE = np.repeat([1.0, 20.0], 3)  # [N m, N] of loads
_STEPS = 0.02 * 0.2 ** np.arange(5)  # of the loads' sizes


def relative(C: NDArray, other: NDArray) -> float:
    """Largest difference of finite entries over sqrt(C_ii C_jj)."""
    size = np.sqrt(np.abs(np.diag(C)))
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(C - other) / np.outer(size, size)
    return float(np.nan_to_num(off, posinf=0.0).max(initial=0.0))


def limit(slopes: NDArray) -> NDArray:
    """(6,) central differences at step zero, from (k, 6) at falling steps."""
    square = (_STEPS[0] / _STEPS[1]) ** 2
    better = (square * slopes[1:] - slopes[:-1]) / (square - 1)
    # rotations and translations of one column have the sizes they have
    size = np.abs(better).max(axis=0) + 1e-300
    change = np.abs(np.diff(better, axis=0) / size).max(axis=1)
    return better[int(np.argmin(change)) + 1]


def by_differences(posture: Posture, load: NDArray) -> tuple[float, str]:
    """Exact tangent against central differences, or why there is none."""
    try:
        equilibrium = solve_exact(posture, load)
        C = exact_tangent(equilibrium).compliance
        finite = np.flatnonzero(np.isfinite(C).all(axis=0))
        columns = []
        for row in finite:
            unit = _SIZE[row] * np.eye(6)[row]
            slopes = [
                np.subtract(*(
                    solve_exact(posture, load + sign * step * unit, near=equilibrium)
                    .platform_screw for sign in (1, -1)
                )) / (2 * step * _SIZE[row])
                for step in _STEPS
            ]  # fmt: skip
            columns.append(limit(np.array(slopes)))
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return np.nan, type(error).__name__
    if not len(finite):
        return np.nan, "free in all directions"
    J = np.eye(6)
    J[:3, :3] = turn_jacobian(equilibrium.platform_screw[:3])
    if len(finite) < 6 and np.abs(J - np.eye(6)).max() > 1e-12:
        return np.nan, "turned, and free in some directions"
    D = J @ np.column_stack(columns)
    D = D @ J.T if len(finite) == 6 else D
    return relative(C[np.ix_(finite, finite)], D[finite]), "compared"


def by_least_energy(posture: Posture) -> float:
    """The classical matrix against (22) of the robot without play and errors."""
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


def cases(robot: Robot, rng: np.random.Generator) -> list[Posture]:
    """Three postures of a robot, or one at three sizes of its errors."""
    home = home_posture(robot)
    driven = np.array([frame.actuated for frame in robot.frames])
    steps = rng.uniform(-_FAR, _FAR, (8, len(driven)))
    goals = np.where(driven, robot.positions + steps, np.nan)
    moved = [
        posture
        for posture in place_many_joints(robot, goals)[0]
        if posture and np.abs(posture.platform - home.platform).max() > _MOVED
    ]
    if len(moved) >= 2:
        return [home, *moved[:2]]
    return [
        replace(home, robot=robot.with_errors(size * robot.errors)) for size in SIZES
    ]


def robots() -> Iterator[tuple[Robot, np.random.Generator]]:
    """The built-in ones with errors of up to a mrad and 0.1 mm, then random ones."""
    for seed, name in enumerate(BUILT_IN):
        rng, robot = np.random.default_rng(seed), load_robot(name)
        errors = rng.uniform(-1, 1, (len(robot.frames), 6)) * ERRORS
        yield robot.with_errors(errors), rng
    for seed in range(ROBOTS):
        rng = np.random.default_rng(seed)
        yield random_robot(rng, legs=int(rng.integers(1, 4))), rng


def main() -> None:
    """Print the three comparisons."""
    reasons: Counter[str] = Counter()
    exact, linear, compiled = [], [], []
    moving = 0
    for robot, rng in robots():
        load = rng.normal(size=6) * _SIZE
        postures = cases(robot, rng)
        moving += postures[0].robot is postures[1].robot
        for posture in postures:
            linear.append(by_least_energy(posture))
            T = posture.transforms[None]
            many = platform_stiffnesses(robot, T, posture.mismatch)
            one = without_clearance(posture)
            if not one.free.size:
                compiled.append(relative(one.compliance, many.compliance[0]))
            off, reason = by_differences(posture, load)
            reasons[reason] += 1
            exact.append(off)
    print(f"{moving} robots at three poses, the others at three sizes of their errors")
    for name, values in (
        ("exact tangent, differences", exact), ("classical, (22)", linear),
        ("compiled, one by one", compiled),
    ):  # fmt: skip
        known = np.array([v for v in values if np.isfinite(v)])
        print(
            f"{name:28s} {len(known):4d} compared: median {np.median(known):.1e}, "
            f"90 % {np.quantile(known, 0.9):.1e}, largest {known.max():.1e}"
        )
    print(", ".join(f"{reason}: {count}" for reason, count in reasons.most_common()))


if __name__ == "__main__":
    main()
