"""Many least energies, problem (22), each with its certificate."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from assembly.linear.assembled import Assembly
from assembly.linear.certificate import unproved
from assembly.linear.closure import VirtualJoints, virtual_joints
from assembly.linear.reduction import FreeMotion
from assembly.linear.reference import CannotAssemble
from assembly.model.point_results import PointResults
from assembly.model.robot import Robot
from assembly.solvers.conic import GAP, GAP_WITHOUT_CLEARANCE, SolverFailed

# by the codes of assembly/kernels/linear/energies.h: the solver that solved, or, after
# the second, why the point was left to the reference
OUTCOMES = (
    "dual Newton", "interior point", "rigid rows", "rank in doubt", "uncertified",
    "bounded joint", "free motion", "one by one", "asked",
)  # fmt: skip
COMPILED = 2

_STATUS: dict[type[Exception], str] = {
    CannotAssemble: "cannot assemble",
    FreeMotion: "no equilibrium",
    SolverFailed: "solver failed",
}


@dataclass(frozen=True, eq=False, repr=False)
class Assemblies(PointResults[Assembly]):
    """Least energies of k points, each with its certificate; ``[i]`` is one of them.

    Attributes:
        energy: (k,) [J] stored; NaN where there is no solution, see ``status``.
        bound: (k,) [J] certified lower bound.
        energy_without_clearance: (k,) [J] energy stored with all clearances at zero.
        work: (k,) [J] of the loads on all but the errors.
        platform_screw: (k, 6) [rad, m] pose error at the platform's origin, base axes.
        closure_residual: (k,) [rad, reference lengths] largest gap left in a closure.
        clearance_excess: (k,) [-] by how much the worst clearance leaves its cone.
        clearances: (k, nu) in units of the cones of :attr:`joints`; NaN where the
            bound of a passive joint's own motion is active.
        bounded: (k, nu) likewise with the bounds of all passive joints' own motion as
            cones too, where one of them is active or holds the platform; else NaN. No
            columns where no point asks for it.
        motions: (k, nq) [rad, m] free motions of :attr:`joints`; NaN likewise.
        multipliers: (k, 6 closures) of the scaled closure rows.
        outcome: (k,) index into :data:`OUTCOMES`.
        method: (k,) which gave it: ``"compiled"`` or ``"reference"``.
        loaded: (k,) bool, points under loads.
        status: (k,) ``"ok"``, ``"cannot assemble"``, or ``"solver failed"`` where
            there is no solution or its certificate falls short.
        reason: (k,) message where the status is not ok.
        joints: what may move.
        one: the :class:`~assembly.linear.assembled.Assembly` of a point.
    """

    energy: NDArray
    bound: NDArray
    energy_without_clearance: NDArray
    work: NDArray
    platform_screw: NDArray
    closure_residual: NDArray
    clearance_excess: NDArray
    clearances: NDArray
    bounded: NDArray
    motions: NDArray
    multipliers: NDArray
    outcome: NDArray
    method: NDArray
    loaded: NDArray
    status: NDArray
    reason: NDArray
    joints: VirtualJoints
    one: Callable[[int], Assembly]

    VARIABLES: ClassVar = {
        "energy": "energy",
        "duality_gap": "gap",
        "energy_without_play": "energy_without_clearance",
        "platform_screw": "platform_screw",
        "closure_residual": "closure_residual",
        "clearance_excess": "clearance_excess",
        "method": "method",
        "status": "status",
        "reason": "reason",
    }

    def __getitem__(self, i: int) -> Assembly:
        """Point i with its wrenches; raises where there is no solution."""
        return self.one(range(len(self))[i])

    @cached_property
    def gap(self) -> NDArray:
        """(k,) [J] certified: no energy is more than this above the least possible."""
        return np.maximum(0.0, self.energy - self.bound)

    @cached_property
    def certified(self) -> NDArray:
        """(k,) bool: gap <= 1e-8 of the energy + 1e-12 of that without clearance.

        Under loads also + 1e-12 of their work.
        """
        largest = self.energy_without_clearance + np.abs(self.work)
        allowed = GAP * self.energy + GAP_WITHOUT_CLEARANCE * largest
        return (self.gap <= allowed) & (self.status == "ok")

    def fallbacks(self) -> dict[str, int]:
        """How many points the compiled method left to be solved one by one, by why."""
        return {
            name: int(np.sum(self.outcome == code))
            for code, name in enumerate(OUTCOMES)
            if code >= COMPILED and np.any(self.outcome == code)
        }


def assemblies_of(assembly: Assembly) -> Assemblies:
    """One as many, without what would have to be computed: NaN there.

    Args:
        assembly: any.

    Returns:
        One row.
    """
    unknown = np.full(1, np.nan)
    return Assemblies(
        energy=np.array([assembly.energy]),
        bound=unknown,
        energy_without_clearance=np.array([assembly.energy_without_clearance]),
        work=np.array([assembly.work]),
        platform_screw=assembly.platform_screw[None],
        closure_residual=unknown,
        clearance_excess=unknown,
        clearances=assembly.clearances[None],
        bounded=np.zeros((1, 0)),
        motions=assembly.motions[None],
        multipliers=assembly.multipliers[None],
        outcome=np.zeros(1, dtype=int),
        method=np.full(1, assembly.method, dtype=object),
        loaded=np.array([bool(assembly.frame_loads)]),
        status=np.full(1, "ok", dtype=object),
        reason=np.full(1, "", dtype=object),
        joints=assembly.joints,
        one=lambda i: assembly,
    )


def solve_each(robot: Robot, count: int, one: Callable[[int], Assembly]) -> Assemblies:
    """Least energies of points under loads that are solved one by one.

    Args:
        robot: of all points.
        count: k.
        one: solves a point.

    Returns:
        Energies, screws and certificates in their order.
    """
    joints = virtual_joints(robot)

    def unknown(*shape: int) -> NDArray:
        return np.full((count, *shape), np.nan)

    energies = Assemblies(
        energy=unknown(),
        bound=unknown(),
        energy_without_clearance=unknown(),
        work=unknown(),
        platform_screw=unknown(6),
        closure_residual=unknown(),
        clearance_excess=unknown(),
        clearances=unknown(joints.cones.shape[1]),
        bounded=unknown(0),
        motions=unknown(joints.free.shape[1]),
        multipliers=unknown(6 * len(robot.closures)),
        outcome=np.full(count, OUTCOMES.index("one by one")),
        method=np.full(count, "reference", dtype=object),
        loaded=np.ones(count, dtype=bool),
        status=np.full(count, "ok", dtype=object),
        reason=np.full(count, "", dtype=object),
        joints=joints,
        one=one,
    )
    for i in range(count):
        solve_again(energies, i)
    return energies


def excess_of(clearances: NDArray, starts: NDArray) -> NDArray:
    """(k,) [-] by how much the worst of clearances (k, nu) leaves its cone."""
    if not clearances.shape[1]:
        return np.zeros(len(clearances))
    squares = np.add.reduceat(clearances.T**2, starts[:-1], axis=0)
    return np.maximum(0.0, np.sqrt(squares.max(axis=0)) - 1.0)


def solve_again(energies: Assemblies, i: int) -> None:
    """Row i solved by itself, in place; why there is no solution where there is none.

    Args:
        energies: of k points.
        i: which.
    """
    a = energies
    for values in (a.energy, a.bound, a.energy_without_clearance, a.work,
                   a.platform_screw, a.closure_residual, a.clearance_excess,
                   a.clearances, a.motions, a.multipliers):  # fmt: skip
        values[i] = np.nan
    try:
        assembly = a.one(i)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        a.status[i], a.reason[i] = failure_status(error), str(error)
        return
    a.method[i] = assembly.method
    a.energy[i] = assembly.energy
    a.energy_without_clearance[i] = assembly.energy_without_clearance
    a.work[i] = assembly.work
    a.platform_screw[i] = assembly.platform_screw
    a.closure_residual[i] = assembly.closure_residual()
    a.clearance_excess[i] = assembly.clearance_excess()
    if assembly.clearances.shape == a.clearances[i].shape:
        a.clearances[i], a.motions[i] = assembly.clearances, assembly.motions
    elif assembly.clearances.shape == a.bounded[i].shape:
        a.bounded[i] = assembly.clearances
    a.bound[i] = assembly.energy - assembly.duality_gap()
    a.multipliers[i] = assembly.multipliers
    open_ = unproved(assembly)
    if open_:
        a.status[i], a.reason[i] = "solver failed", open_


def failure_status(error: Exception) -> str:
    """The status of a posture without a solution.

    Args:
        error: :class:`CannotAssemble`, :class:`FreeMotion` or :class:`SolverFailed`.

    Returns:
        The status of the public format.
    """
    return next(status for kind, status in _STATUS.items() if isinstance(error, kind))
