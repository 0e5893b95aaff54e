"""The reference, in numpy and Clarabel: problems (21), (22) and (27) at one posture.

Slow, and for everything: rigid closures and ranks in doubt too.  The method
``"reference"`` is this, and so is the answer where the compiled method does not cover a
problem or falls short of its proof.

=========  ==========================================  ===============================
paper      what                                        where
=========  ==========================================  ===============================
(16)-(20)  A (dl + dc + de + db) = 0, dx_p from them   ``closure.linearise``
(1)-(7)    dc = cones u + free q, de and db = springs  ``closure.virtual_joints``
           y, so that E = |y|^2 / 2
--         q and y eliminated: E = |G u + h|^2 / 2,    ``reduction.reduce_problem``
           H u = k where no spring acts
(21)       the least t with every |u_c| <= t           :func:`least_margin`, here
(22)       the least E - work, every |u_c| <= 1        :func:`least_energy`, here
(23)-(26)  wrenches, from multipliers of the closures  ``assembled.Assembly``
(27)       the set of dx_p that (22) leaves; its       ``reach.reachable_screws``,
           farthest                                    ``ReachableSet.farthest``
=========  ==========================================  ===============================

Cone programmes are :mod:`assembly.solvers.conic`'s.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import svd

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
from assembly.model.clearance import (
    Compliant,
    clearance_bounds,
    clearance_excess,
    has_bounded_motion,
    scales_with_margin,
)
from assembly.solvers.cones import cone_sizes, cone_starts
from assembly.solvers.conic import LeastEnergy, least_factor, minimise_energy

_RIGID_BESIDE = 1e19  # springs so much stiffer than the softest count as rigid


class CannotAssemble(Exception):
    """No clearance and no elasticity of the model lets the closures hold.

    A result, not a mistake of the caller: some closure is rigid in every direction.
    """


def least_energy(
    posture: Posture,
    load: ArrayLike | None = None,
    bodies: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> Assembly:
    """Close a manipulator at least energy, as ``solve_assembly`` does.

    Args:
        posture: where the robot stands.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes.
        bodies: (n, 6) [N m, N] wrenches on the bodies of all frames, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        The assembled manipulator.

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
        method="reference",
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
        reduced.G, reduced.h, reduced.d, reduced.H, reduced.k, joints.group,
        "reference",
    )  # fmt: skip
    if not least.feasible:
        raise CannotAssemble(
            f"no clearance within its bounds closes what no spring can{beyond}"
        )
    return least


def least_margin(
    posture: Posture, compliant: Compliant
) -> tuple[float | None, float | None]:
    """Factor on all clearances at which a rigid manipulator just assembles, (21).

    Args:
        posture: where the robot stands.
        compliant: ``"rigid"`` or ``"free"``, see :mod:`assembly.linear.zone`.

    Returns:
        The margin and its certified lower bound; None for both if no factor does.

    Raises:
        SolverFailed: the cone solver gave up.
    """
    lin = linearise(posture)
    margin, bound, screws = margin_with(lin, virtual_joints(posture.robot, compliant))
    bounds = clearance_bounds(posture.robot, compliant)
    ranges = np.where(scales_with_margin(posture.robot), np.inf, bounds)
    if margin is not None and clearance_excess(screws, ranges) > 1e-9:
        # the range of a passive joint's motion was left out, but it is active
        joints = virtual_joints(posture.robot, compliant, bounded_motion=True)
        margin, bound, _ = margin_with(lin, joints)
    return margin, bound


def margin_with(
    lin: Linearisation, joints: VirtualJoints
) -> tuple[float | None, float | None, NDArray]:
    """Margin with a given choice of what may move.

    Args:
        lin: the assembly constraints.
        joints: what may move, without springs.

    Returns:
        The margin and its certified lower bound, None if no factor does; the (n, 6)
        [rad, m] clearance screws that attain it.

    Raises:
        SolverFailed: the cone solver gave up.
    """
    reduced = reduce_problem(lin, joints)
    margin, bound, u = _margin_of(reduced)
    if margin is None:
        return None, None, np.zeros((len(joints.robot.frames), 6))
    motions = reduced.motions(u, np.zeros(joints.elastic.shape[1]))
    screws = joints.cones @ u + joints.free @ motions
    return margin, bound, screws.reshape(-1, 6)


def _margin_of(
    reduced: Reduction,
) -> tuple[float | None, float | None, NDArray]:
    """Margin of a reduced problem, its bound, and the clearances that attain it."""
    joints = reduced.joints
    u = np.zeros(joints.cones.shape[1])
    if reduced.inconsistent:
        return None, None, u
    if not np.any(reduced.k):
        return 0.0, 0.0, u
    # orthonormal rows, whatever the units of the closures
    U, S, B = svd(reduced.H, full_matrices=False)
    right = U.T @ reduced.k / S
    t, u, y = least_factor(B, right, joints.group, joints.scaled)
    bound = None if t is None else _margin_bound(B, right, joints, y)
    return t, bound, u


def _margin_bound(
    B: NDArray, right: NDArray, joints: VirtualJoints, y: NDArray
) -> float:
    """Certified lower bound: t sum_k |B_k^T y| >= y.right for every y."""
    sizes = cone_sizes(B.T @ y, joints.group)
    scaled = joints.scaled[cone_starts(joints.group)[:-1]]
    work = float(y @ right) - float(sizes[~scaled].sum())
    return max(0.0, work / max(float(sizes[scaled].sum()), 1e-300))
