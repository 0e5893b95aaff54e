"""The least energy that closes a manipulator, problem (22)."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.assembled import Assembly, all_loads
from assembly.linear.closure import (
    Linearisation,
    VirtualJoints,
    linearise,
    virtual_joints,
)
from assembly.linear.load import FrameLoads
from assembly.linear.reduction import FreeMotion, Reduction, reduce_problem
from assembly.linear.rounding import differs_from_zero, stiffness_spread
from assembly.model.clearance import Compliant, has_bounded_motion
from assembly.solvers.conic import LeastEnergy, minimise_energy

__all__ = [
    "Assembly", "CannotAssemble", "solve_assembly", "solve_with", "without_own_springs",
]  # fmt: skip
_RIGID_BESIDE = 1e19  # springs so much stiffer than the softest count as rigid


class CannotAssemble(Exception):
    """No clearance and no elasticity of the model lets the closures hold.

    A result, not a mistake of the caller: some closure is rigid in every direction.
    """


def solve_assembly(
    posture: Posture,
    load: ArrayLike | None = None,
    bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> Assembly:
    """Close a manipulator at least energy, problem (22), under optional loads.

    Args:
        posture: where the robot stands; its errors, clearances, links and joint
            springs are the robot's.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes; energy
            minus its work is then what is minimised.
        bodies: (n, 6) [N m, N] wrenches on the bodies of all frames, each at its
            frame's origin, base axes.
        gravity: (3,) [m/s^2] base axes; links with a density and bodies with a mass
            then have weight.

    Returns:
        The assembled manipulator; :func:`assembly.linear.certificate.unproved` says
        where its certificate falls short after all fallbacks.

    Raises:
        CannotAssemble: a closure is open that no clearance and no spring can close.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the cone solver gave up.
    """
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    frame_loads = all_loads(posture, wrench, bodies, gravity)
    return _solve_within(linearise(posture), "elastic", wrench, frame_loads)


def _solve_within(
    lin: Linearisation, compliant: Compliant, load: NDArray, frame_loads: FrameLoads
) -> Assembly:
    """Close a manipulator; bounds of passive joints' motion count where they matter."""
    robot = lin.posture.robot
    try:
        joints = virtual_joints(robot, compliant)
        assembly = solve_with(lin, joints, load, frame_loads)
    except FreeMotion:
        if not has_bounded_motion(robot):
            raise
    else:
        if assembly.clearance_excess(compliant) <= 1e-9:
            return assembly
    # the bound of a passive joint's own motion was left out, but it is active
    joints = virtual_joints(robot, compliant, bounded_motion=True)
    return solve_with(lin, joints, load, frame_loads)


def solve_with(
    lin: Linearisation, joints: VirtualJoints, load: NDArray, frame_loads: FrameLoads
) -> Assembly:
    """Close a manipulator at least energy with a given choice of what may move.

    Args:
        lin: the assembly constraints.
        joints: what may move.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        frame_loads: all loads, this one among them.

    Returns:
        The assembled manipulator.

    Raises:
        CannotAssemble: a closure is open that nothing can close.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the cone solver gave up.
    """
    reduced = reduce_problem(lin, joints, frame_loads)
    least = _minimise(reduced)
    u = least.clearances
    y = reduced.springs(u)
    multipliers = reduced.multipliers(least.springs, least.rigid_multipliers)
    assembly = Assembly(
        linearisation=lin,
        joints=joints,
        load=load,
        frame_loads=frame_loads,
        elastic=y,
        clearances=u,
        motions=reduced.motions(u, y),
        multipliers=multipliers,
        energy_without_clearance=reduced.energy_without_clearance,
        ranks=reduced.ranks,
    )
    residual = assembly.closure_residual() + assembly.rounding
    if frame_loads or differs_from_zero(assembly.stored, 0.0, multipliers, residual):
        return assembly
    # no energy is needed: springs and wrenches are rounding of zero
    return replace(
        assembly, elastic=np.zeros_like(y), multipliers=np.zeros_like(multipliers)
    )


def without_own_springs(assembly: Assembly) -> Assembly:
    """The least energy when compliant joints turn freely about their own axis."""
    return _solve_within(
        assembly.linearisation, "hinged", assembly.load, assembly.frame_loads
    )


def _minimise(reduced: Reduction) -> LeastEnergy:
    """Least energy of a reduced problem; infeasible ones are named."""
    joints = reduced.joints
    spread = stiffness_spread(joints, reduced.linearisation.size)
    beyond = ""
    if spread > _RIGID_BESIDE:
        beyond = (
            f"; stiffnesses differ {spread:.0e} times, more than a double carries: the "
            "stiffest count as rigid"
        )
    if reduced.inconsistent:
        raise CannotAssemble(
            f"a rigid part stays open by {reduced.inconsistent:.3g} (rad, or m per "
            f"reference length): no clearance or spring acts there{beyond}"
        )
    least = minimise_energy(
        reduced.G, reduced.h, reduced.d, reduced.H, reduced.k, joints.group
    )
    if not least.feasible:
        raise CannotAssemble(
            f"no clearance within its bounds closes what no spring can{beyond}"
        )
    return least
