"""Solve problem (22) by the reference method."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.closure import (
    Linearisation,
    VirtualJoints,
    linearise,
    virtual_joints,
)
from forcefit.assembly.linear.load import FrameLoads
from forcefit.assembly.linear.reference.reduction import (
    FreeMotion,
    Reduction,
    reduce_problem,
)
from forcefit.assembly.linear.rounding import differs_from_zero, stiffness_spread
from forcefit.assembly.model.clearance import has_bounded_motion
from forcefit.assembly.solvers.conic import ConicSolution, minimise_energy

# stiffness relative to the softest spring, above which springs are nearly rigid
_RIGID_BESIDE = 1e19


class CannotAssemble(Exception):
    """Raised if neither clearances nor elasticity can close the loops of a robot.

    A closure remains open in a direction in which all bodies and joints are rigid.
    """


def least_energy(
    posture: Posture, load: NDArray, frame_loads: FrameLoads,
    own_axes_free: bool = False,
) -> Assembly:  # fmt: skip
    """Close a manipulator with minimum energy, as ``solve_assembly`` does.

    Motion limits of passive joints are imposed only if they are active.

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        frame_loads: all loads on every small screw, including ``load``.
        own_axes_free: see :func:`forcefit.assembly.linear.closure.virtual_joints`.

    Returns:
        The assembled manipulator.

    Raises:
        CannotAssemble: clearances and springs cannot close the loops.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the cone solver did not converge.
    """
    lin, robot = linearise(posture), posture.robot
    try:
        joints = virtual_joints(robot, True, own_axes_free)
        assembly = solve_with(lin, joints, load, frame_loads)
    except FreeMotion:
        if not has_bounded_motion(robot):
            raise
    else:
        if assembly.clearance_excess(own_axes_free) <= 1e-9:
            return assembly
    # An omitted motion limit of a passive joint is active. Solve again with all limits.
    joints = virtual_joints(robot, True, own_axes_free, bounded_motion=True)
    return solve_with(lin, joints, load, frame_loads)


def solve_with(
    lin: Linearisation, joints: VirtualJoints, load: NDArray, frame_loads: FrameLoads
) -> Assembly:
    """Return the minimum-energy assembly for given virtual joints.

    Args:
        lin: the assembly constraints.
        joints: virtual joints that can move.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        frame_loads: all loads on every small screw, including ``load``.

    Returns:
        The assembled manipulator.

    Raises:
        CannotAssemble: clearances and springs cannot close the loops.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the cone solver did not converge.
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
        method="reference",
    )
    residual = assembly.closure_residual() + assembly.rounding
    if frame_loads or differs_from_zero(assembly.stored, 0.0, multipliers, residual):
        return assembly
    # The robot closes without energy, so deformations and wrenches are round-off.
    return replace(
        assembly, elastic=np.zeros_like(y), multipliers=np.zeros_like(multipliers)
    )


def _minimise(reduced: Reduction) -> ConicSolution:
    """Solve a reduced problem; raise CannotAssemble if it is infeasible."""
    joints = reduced.joints
    spread = stiffness_spread(joints, reduced.linearisation.size)
    beyond = ""
    if spread > _RIGID_BESIDE:
        beyond = (
            f"; the stiffest spring is {spread:.0e} times as stiff as the "
            "softest, which exceeds double precision, so the stiffest springs "
            "are treated as rigid"
        )
    if reduced.inconsistent:
        raise CannotAssemble(
            f"a rigid loop stays open by {reduced.inconsistent:.3g} rad or reference "
            f"lengths, because no clearance or spring can close it{beyond}"
        )
    least = minimise_energy(
        reduced.G, reduced.h, reduced.d, reduced.H, reduced.k, joints.group,
        "reference",
    )  # fmt: skip
    if not least.feasible:
        raise CannotAssemble(
            "the loops stay open, because springs and clearances within their "
            f"bounds cannot close them{beyond}"
        )
    return least
