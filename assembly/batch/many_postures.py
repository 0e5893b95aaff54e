"""Problem (22) at many postures, or for many errors, at once.

Compiled from the frames' poses to the certificate
(:mod:`assembly.batch.compiled_energy`): tens of microseconds a point.  A point that
this does not cover, or whose certificate falls short, falls back to
:mod:`assembly.linear.energy`, and is counted.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.batch.robot_structure import structure_of
from assembly.kinematics.posture import Posture
from assembly.linear.certificate import unproved
from assembly.linear.closure import VirtualJoints
from assembly.linear.energy import (
    CannotAssemble,
    solve_assembly,
    without_own_springs,
)
from assembly.linear.rounding import (
    SPREAD,
    closure_rounding,
    drop_zeros,
    stiffness_spread,
)
from assembly.model.clearance import Compliant
from assembly.model.largest import LARGEST_LENGTH
from assembly.model.robot import Robot
from assembly.solvers.conic import GAP, GAP_WITHOUT_CLEARANCE, SolverFailed
from forcefit.inputs.display import html_table, short_repr

if TYPE_CHECKING:
    import pandas
    import xarray

# by the codes of assembly.batch.compiled_energy: the solver that solved, or, after the
# second, why the point went to the fallback
OUTCOMES = (
    "dual Newton", "interior point", "rigid rows", "rank in doubt", "uncertified",
    "bounded joint",
)  # fmt: skip
_COMPILED = 2


@dataclass(frozen=True, eq=False)
class Energies:
    """Least energies of k points, each with its certificate.

    Attributes:
        energy: (k,) [J] stored; NaN where there is no solution, see ``status``.
        bound: (k,) [J] certified lower bound.
        energy_without_clearance: (k,) [J] least energy with all clearances at zero.
        platform_screw: (k, 6) [rad, m] pose error at the platform's origin, base axes.
        closure_residual: (k,) [rad, reference lengths] largest gap left in a closure.
        clearance_excess: (k,) [-] by how much the worst clearance leaves its cone.
        clearances: (k, nu) in units of the cones of :attr:`joints`; NaN where the
            bound of a passive joint's own motion is active.
        motions: (k, nq) [rad, m] free motions of :attr:`joints`; NaN likewise.
        multipliers: (k, 6 closures) of the scaled closure rows.
        outcome: (k,) index into :data:`OUTCOMES`.
        status: (k,) ``"ok"``, ``"cannot assemble"``, or ``"solver failed"`` where
            there is no solution or its certificate falls short.
        reason: (k,) message where the status is not ok.
        joints: what may move.
    """

    energy: NDArray
    bound: NDArray
    energy_without_clearance: NDArray
    platform_screw: NDArray
    closure_residual: NDArray
    clearance_excess: NDArray
    clearances: NDArray
    motions: NDArray
    multipliers: NDArray
    outcome: NDArray
    status: NDArray
    reason: NDArray
    joints: VirtualJoints

    __repr__, _repr_html_ = short_repr, html_table

    def to_xarray(self) -> "xarray.Dataset":
        """Over ``point``; see :mod:`assembly.model.tables`."""
        from assembly.model.tables import points_dataset

        return points_dataset({
            "energy": self.energy,
            "duality_gap": self.gap,
            "energy_without_play": self.energy_without_clearance,
            "platform_screw": self.platform_screw,
            "closure_residual": self.closure_residual,
            "clearance_excess": self.clearance_excess,
            "status": self.status,
            "reason": self.reason,
        })

    def to_pandas(self) -> "pandas.DataFrame":
        """A row for each point, columns (variable, component)."""
        from assembly.model.tables import frame_table

        return frame_table(self.to_xarray(), "point")

    @cached_property
    def gap(self) -> NDArray:
        """(k,) [J] certified: no energy is more than this above the least possible."""
        return np.maximum(0.0, self.energy - self.bound)

    @cached_property
    def certified(self) -> NDArray:
        """(k,) bool: gap <= 1e-8 of the energy + 1e-12 of that without clearance."""
        allowed = GAP * self.energy
        allowed = allowed + GAP_WITHOUT_CLEARANCE * self.energy_without_clearance
        return (self.gap <= allowed) & (self.status == "ok")

    def fallbacks(self) -> dict[str, int]:
        """How many points the fallback solved, by reason."""
        return {
            name: int(np.sum(self.outcome == code))
            for code, name in enumerate(OUTCOMES)
            if code >= _COMPILED and np.any(self.outcome == code)
        }


def minimise_energies(
    robot: Robot,
    transforms: ArrayLike,
    errors: ArrayLike | None = None,
    mismatch: ArrayLike = 0.0,
    compliant: Compliant = "elastic",
) -> Energies:
    """Close a manipulator at least energy, problem (22), at many points.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base, as of
            :attr:`~assembly.kinematics.posture.Posture.transforms`.
        errors: (n, 6) or (k, n, 6) [rad, m] geometric errors; the robot's if absent.
        mismatch: (k,) or one number [rad, m], nominal closure error of the frames.
        compliant: ``"elastic"``, or ``"hinged"``: compliant joints turn freely about
            their own axis, see :func:`assembly.linear.closure.virtual_joints`.

    Returns:
        Energies, screws and certificates, in the order given.

    Raises:
        ValueError: a shape does not fit the robot, or a value is not finite.
    """
    from assembly.batch.compiled_energy import Solutions, assemble_all

    # writable and in C order, whatever comes: the kernels are compiled for one kind
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    count, n = len(T), len(robot.frames)
    errors = robot.errors if errors is None else np.asarray(errors, dtype=float)
    if T.shape != (count, n, 4, 4) or errors.shape not in {(n, 6), (count, n, 6)}:
        raise ValueError(
            f"minimise_energies: transforms have shape {T.shape} and errors "
            f"{errors.shape}, expected (k, {n}, 4, 4) and ({n}, 6) or (k, {n}, 6)"
        )
    if not (np.isfinite(T).all() and np.all(np.abs(errors) <= LARGEST_LENGTH)):
        raise ValueError(
            "minimise_energies: transforms or errors are not all finite, or an error "
            f"is larger than {LARGEST_LENGTH:g} [rad, m]"
        )
    all_errors = np.require(errors.reshape(-1, n, 6), requirements=["C", "W"])
    off = np.broadcast_to(np.asarray(mismatch, dtype=float), (count,)).copy()
    joints, structure = structure_of(robot, compliant)
    nu, nq = joints.cones.shape[1], joints.free.shape[1]
    out = Solutions(
        outcome=np.zeros(count, dtype=np.int64),
        energy=np.zeros(count),
        bound=np.zeros(count),
        without_clearance=np.zeros(count),
        platform_screw=np.zeros((count, 6)),
        clearances=np.zeros((count, nu)),
        motions=np.zeros((count, nq)),
        multipliers=np.zeros((count, 6 * len(robot.closures))),
        residual=np.zeros(count),
    )
    if stiffness_spread(joints, structure.size) > SPREAD:
        out.outcome[:] = OUTCOMES.index("uncertified")  # left to the fallback
    else:
        assemble_all(structure, T, all_errors, off, out)
    energies = Energies(
        energy=out.energy,
        bound=out.bound,
        energy_without_clearance=out.without_clearance,
        platform_screw=out.platform_screw,
        closure_residual=out.residual,
        clearance_excess=_excess(out.clearances, structure.starts),
        clearances=out.clearances,
        motions=out.motions,
        multipliers=out.multipliers,
        outcome=out.outcome,
        status=np.full(count, "ok", dtype=object),
        reason=np.full(count, "", dtype=object),
        joints=joints,
    )
    for i in np.flatnonzero(out.outcome >= _COMPILED).tolist():
        # one robot for all where the errors are its own: its columns are cached
        own = all_errors[i if len(all_errors) > 1 else 0]
        erring = robot if np.array_equal(own, robot.errors) else robot.with_errors(own)
        posture = Posture(erring, np.full(n, np.nan), T[i], float(off[i]))
        _solve_fallback(posture, compliant, energies, i)
    residual = energies.closure_residual
    residual = residual + closure_rounding(all_errors, joints, structure.size)
    drop_zeros(energies.energy, energies.bound, energies.multipliers, residual)
    return energies


def _excess(clearances: NDArray, starts: NDArray) -> NDArray:
    """(k,) [-] by how much the worst clearance leaves its cone."""
    if not clearances.shape[1]:
        return np.zeros(len(clearances))
    sizes = np.sqrt(np.add.reduceat(clearances**2, starts[:-1], axis=1))
    return np.maximum(0.0, sizes.max(axis=1) - 1.0)


def _solve_fallback(
    posture: Posture, compliant: Compliant, energies: Energies, i: int
) -> None:
    """Row i of the energies by the fallback."""
    a = energies
    for values in (a.energy, a.bound, a.energy_without_clearance, a.platform_screw,
                   a.closure_residual, a.clearance_excess, a.clearances, a.motions,
                   a.multipliers):  # fmt: skip
        values[i] = np.nan
    try:
        assembly = solve_assembly(posture)
        if compliant == "hinged":
            assembly = without_own_springs(assembly)
    except CannotAssemble as error:
        a.status[i], a.reason[i] = "cannot assemble", str(error)
        return
    except SolverFailed as error:
        a.status[i], a.reason[i] = "solver failed", str(error)
        return
    a.energy[i] = assembly.energy
    a.energy_without_clearance[i] = assembly.energy_without_clearance
    a.platform_screw[i] = assembly.platform_screw
    a.closure_residual[i] = assembly.closure_residual()
    a.clearance_excess[i] = assembly.clearance_excess()
    if assembly.clearances.shape == a.clearances[i].shape:
        a.clearances[i], a.motions[i] = assembly.clearances, assembly.motions
    a.bound[i], a.multipliers[i] = assembly.bound, assembly.multipliers
    open_ = unproved(assembly)
    if open_:
        a.status[i], a.reason[i] = "solver failed", open_
