"""Measure the speed of problem (27) on one core, compared with global solvers.

Run ``python benchmarks/pose_error_speed.py``, which takes some minutes. The robot and
the grid are the same as in ``benchmarks/assembly_speed.py``. Rotation and translation
errors are computed

- without geometric errors, with the assumption ``frozen``;
- with geometric errors and the assumption ``free``, at the points inside the assembly
  zone and at all points.

The program prints the processor time [ms] per point until both bounds differ by 1e-6
rad or 1e-6 m, and its ratio to the time of ``bound_pose_error`` for all points
together.  The other methods are SCIP, Gurobi, a simple branch and bound in this module,
and ``bound_pose_error`` for single points.  The program also prints the time [s] of a
complete study with four quantities, two assumptions and 1113 points.

The times of other solvers include only the solution of the reduced problem.  The times
of forcefit include problem (22), the reduction and the search.  ``pip install
forcefit[benchmarks]`` installs the other solvers.
"""

# ruff: noqa: E402  one thread must be asked for before numpy is imported
import os

for name in ("OMP", "OPENBLAS", "MKL"):
    os.environ[f"{name}_NUM_THREADS"] = "1"

import heapq
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, vstack

from benchmarks.assembly_speed import paper_robot, workspace
from forcefit.assembly.kinematics.posture import Posture, place_many, together
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.pose_error import ReachableSet, reachable_screws
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.solvers import conic
from forcefit.assembly.solvers.cones import cone_sizes

SAMPLE = 6  # number of points for all solvers except forcefit
UNIT = 1e-3  # [rad, m] unit of poses for other solvers
TOLERANCE = 1e-6  # [rad or m] accepted difference between the lower and upper bound
LIMIT = 30.0  # [s] time limit for each point
PARTS = {"rotation": slice(0, 3), "translation": slice(3, 6)}


@dataclass(frozen=True)
class Answer:
    """Bounds [rad or m] of a pose error, and the processor time [s] to compute them."""

    lower: float
    upper: float
    taken: float


def scaled(
    reach: ReachableSet, part: slice
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return (c, X, H, k) of the problem x = c + X v with H v = k, in mrad or mm."""
    X = reach.map[part] / UNIT
    c = reach.centre[part] / UNIT - X @ reach.start
    return c, X, reach.rows, reach.rows @ reach.start


def box(c: NDArray, X: NDArray, group: NDArray) -> tuple[NDArray, NDArray]:
    """Return the bounds of x if the loop-closure equations are omitted."""
    reach = np.array([cone_sizes(row, group).sum() for row in X])
    return c - reach, c + reach


def by_scip(reach: ReachableSet, part: slice, near: float) -> Answer:
    """Maximise x.x with SCIP."""
    import pyscipopt

    c, X, H, k = scaled(reach, part)
    low, high = box(c, X, reach.group)
    begin = time.process_time()
    model = pyscipopt.Model()
    model.hideOutput()
    model.setParam("limits/time", LIMIT)
    v = [model.addVar(lb=-1, ub=1) for _ in range(X.shape[1])]
    x = [model.addVar(lb=a, ub=b) for a, b in zip(low, high, strict=True)]
    t = model.addVar(lb=0, ub=float((np.maximum(-low, high) ** 2).sum()))
    for row, right in zip(H, k, strict=True):
        terms = (w * u for w, u in zip(row.tolist(), v, strict=True))
        model.addCons(pyscipopt.quicksum(terms) == right)
    for a in range(3):
        terms = (w * u for w, u in zip(X[a].tolist(), v, strict=True))
        model.addCons(x[a] == c[a] + pyscipopt.quicksum(terms))
    for cone in np.unique(reach.group):
        own = np.flatnonzero(reach.group == cone)
        model.addCons(pyscipopt.quicksum(v[j] * v[j] for j in own) <= 1)
    model.addCons(t <= pyscipopt.quicksum(one * one for one in x))
    model.setObjective(t, "maximize")
    model.setParam("limits/absgap", 2 * near * TOLERANCE / UNIT**2)
    model.setParam("limits/gap", 0.0)
    model.setParam("numerics/feastol", 1e-9)
    model.optimize()
    lower, upper = model.getPrimalbound(), model.getDualbound()
    return Answer(
        np.sqrt(max(lower, 0.0)) * UNIT, np.sqrt(max(upper, 0.0)) * UNIT,
        time.process_time() - begin,
    )  # fmt: skip


def by_gurobi(reach: ReachableSet, part: slice, near: float) -> Answer:
    """Maximise x.x with Gurobi."""
    import gurobipy

    c, X, H, k = scaled(reach, part)
    low, high = box(c, X, reach.group)
    begin = time.process_time()
    with (
        gurobipy.Env(params={"OutputFlag": 0}) as env,
        gurobipy.Model(env=env) as model,
    ):
        for key, value in {
            "Threads": 1, "NonConvex": 2, "TimeLimit": LIMIT, "MIPGap": 0.0,
            "MIPGapAbs": 2 * near * TOLERANCE / UNIT**2, "FeasibilityTol": 1e-9,
        }.items():  # fmt: skip
            model.setParam(key, value)
        v = model.addMVar(X.shape[1], lb=-1.0, ub=1.0)
        x = model.addMVar(3, lb=low, ub=high)
        t = model.addMVar(1, lb=0.0)
        if len(k):
            model.addConstr(H @ v == k)
        model.addConstr(x == c + X @ v)
        for cone in np.unique(reach.group):
            own = v[np.flatnonzero(reach.group == cone)]
            model.addConstr(own @ own <= 1.0)
        model.addConstr(t <= x @ x)
        model.setObjective(t.sum(), gurobipy.GRB.MAXIMIZE)
        model.optimize()
        lower, upper = model.ObjVal, model.ObjBound
    return Answer(
        np.sqrt(lower) * UNIT, np.sqrt(upper) * UNIT, time.process_time() - begin
    )


def by_branching(reach: ReachableSet, part: slice, near: float) -> Answer:
    """Maximise x.x by branch and bound with secants as upper bounds of squares."""
    c, X, H, k = scaled(reach, part)
    begin = time.process_time()
    low, high = box(c, X, reach.group)
    lower, count = 0.0, 0
    size = float(np.linalg.norm(np.maximum(-low, high)))
    nodes = [(-size * size, count, low, high, (low + high) / 2)]
    while nodes and time.process_time() - begin < LIMIT:
        upper = np.sqrt(-nodes[0][0])
        if upper - lower <= TOLERANCE / UNIT:
            break
        _, _, low, high, x = heapq.heappop(nodes)
        axis = int(np.argmax((high - x) * (x - low)))
        for side in (0, 1):
            below, above = low.copy(), high.copy()
            (above if side == 0 else below)[axis] = x[axis]
            farthest = _secant_node(c, X, H, k, reach.group, below, above)
            if farthest is None:
                continue
            value, where = farthest
            lower = max(lower, float(np.linalg.norm(where)))
            count += 1
            if value > lower**2:
                heapq.heappush(nodes, (-value, count, below, above, where))
    upper = np.sqrt(-nodes[0][0]) if nodes else lower
    return Answer(lower * UNIT, max(lower, upper) * UNIT, time.process_time() - begin)


def _secant_node(
    c: NDArray, X: NDArray, H: NDArray, k: NDArray, group: NDArray, low: NDArray,
    high: NDArray,
) -> tuple[float, NDArray] | None:  # fmt: skip
    """Return the maximum of the secants in a box and its position, or None."""
    nu = len(group)
    slope = low + high
    limits, radii = conic._unit_cones(group, np.ones(nu))
    sides = csc_matrix(np.vstack([X, -X]))
    A = vstack([csc_matrix(H), sides, limits], format="csc")
    b = np.concatenate([k, high - c, c - low, radii])
    v, z, status = conic._clarabel(
        csc_matrix((nu, nu)), -X.T @ slope, A, b, conic._Cones(len(k), group, 6), 1e-8
    )
    if v is None:
        return None
    x = c + X @ v
    # the dual value is an upper bound even if the solver fails
    dual = X.T @ slope - H.T @ z[: len(k)] - sides.T @ z[len(k) : len(k) + 6]
    value = b[: len(k) + 6] @ z[: len(k) + 6] + cone_sizes(dual, group).sum()
    return float(value + slope @ c - low @ high), x


def sampled(
    solve: Callable[[ReachableSet, slice, float], Answer],
    reaches: list[ReachableSet], part: slice, near: NDArray,
) -> tuple[float, list[Answer], str]:  # fmt: skip
    """Return the mean time [ms], the results, and a remark for the table."""
    try:
        answers = [
            solve(reach, part, size)
            for reach, size in zip(reaches, near.tolist(), strict=True)
        ]
    except ImportError as error:
        return np.nan, [], f"not installed ({error.name})"
    except Exception as error:
        if type(error).__module__.partition(".")[0] not in {"gurobipy", "pyscipopt"}:
            raise
        return np.nan, [], f"refused: {error}"
    late = sum(a.upper - a.lower > 1.01 * TOLERANCE for a in answers)
    note = f"{late} of {len(answers)} wider than requested" if late else ""
    return float(np.mean([a.taken for a in answers])) * 1e3, answers, note


def print_case(title: str, robot: Robot, postures: list[Posture], reading: str) -> None:
    """Print the table for given errors and a given assumption."""
    own = [replace(p, robot=robot) for p in postures]
    at = together(own)
    few = np.arange(0, len(own), len(own) // SAMPLE)[:SAMPLE]
    reaches = [reachable_screws(solve_assembly(own[i]), reading) for i in few]
    for half, (name, part) in enumerate(PARTS.items()):
        tolerance = dict(zip(
            ("tolerance_rotation", "tolerance_translation"),
            np.where(np.arange(2) == half, TOLERANCE, np.inf), strict=True,
        ))  # fmt: skip
        bound_pose_error(solve_assembly(at[:2]), reading, **tolerance)
        begin = time.process_time()
        batch = bound_pose_error(solve_assembly(at), reading, **tolerance)
        batched = (time.process_time() - begin) / len(own) * 1e3
        bound_pose_error(solve_assembly(own[few[0]]), reading, **tolerance)
        begin = time.process_time()
        for i in few:
            bound_pose_error(solve_assembly(own[i]), reading, **tolerance)
        single = (time.process_time() - begin) / len(few) * 1e3
        print(f"\n{title}, {name}\n{'':28}{'ms/point':>10}{'ratio':>11}")
        ours = getattr(batch, f"{name}_error")[few]
        for solver, solve in (
            ("SCIP, scaled", by_scip), ("Gurobi, scaled", by_gurobi),
            ("plain branch and bound", by_branching),
        ):  # fmt: skip
            taken, answers, note = sampled(solve, reaches, part, ours[:, 0])
            apart = [
                max(a.lower - high, low - a.upper)
                for a, (low, high) in zip(answers, ours, strict=False)
            ]
            if answers and max(apart) > 1e-7:
                note += f"; bounds differ by up to {max(apart):.1e}"
            print(f"{solver:28}{taken:10.1f}{taken / batched:11.0f}  {note}")
        print(f"{'forcefit, single points':28}{single:10.2f}{single / batched:11.1f}")
        print(
            f"{'forcefit, all points':28}{batched:10.3f}{1:11d}  "
            f"{batch.supports.mean():.1f} support points, "
            f"{batch.one_by_one.sum()} points one by one"
        )


def print_study(robot: Robot, poses: NDArray) -> None:
    """Print the times of the study: margin, energy and two pose errors."""
    begin = time.process_time()
    postures = [p for p in place_many(robot, poses)[0] if p is not None]
    at = together(postures)
    placed = time.process_time()
    energies = solve_assembly(at)
    zones = [zone_margin(at, name) for name in ("rigid", "free")]
    solved = time.process_time()
    errors = [bound_pose_error(energies, name) for name in ("frozen", "free")]
    done = time.process_time()
    widest = max(
        float(np.diff(getattr(one, f"{part}_error")).max())
        for one in errors for part in PARTS
    )  # fmt: skip
    slow = sum(int(one.one_by_one.sum()) for one in errors)
    slow += sum(int(np.sum(one.method == "reference")) for one in zones)
    print(
        f"\nthe study, {len(at.transforms)} points: {done - begin:.2f} s (placing "
        f"{placed - begin:.2f}, margins and energy {solved - placed:.2f}, pose errors "
        f"{done - solved:.2f}); largest difference of bounds {widest:.1e}, "
        f"{energies.certified.mean():.0%} of energies certified, {slow} in numpy"
    )


def main() -> None:
    """Print all tables."""
    robot = paper_robot()
    postures = workspace(robot)
    perfect = robot.with_errors(0 * robot.errors)
    print(f"{robot.name}, {len(postures)} points, one core")
    print_case("clearances only", perfect, postures, "frozen")
    inside = zone_margin(postures, "free").margin <= 1.0
    zone = [p for p, assembles in zip(postures, inside, strict=True) if assembles]
    print_case(
        f"with errors, free, {len(zone)} points in the zone", robot, zone, "free"
    )
    print_case("with errors, free, all points", robot, postures, "free")
    x, z = np.meshgrid(np.arange(-0.65, 0.651, 0.025), np.arange(-0.75, 0.001, 0.025))
    poses = np.full((x.size, 6), np.nan)
    poses[:, 0], poses[:, 2] = x.ravel(), z.ravel()
    place_many(robot, poses[:1])
    print_study(robot, poses)


if __name__ == "__main__":
    main()
