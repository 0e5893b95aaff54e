r"""Modes of the linear virtual-joint model: motions that keep all loops closed.

Without loads, small motions y of the springs and q of the free joints satisfy the
loop-closure equations,

    A_q q + A_y y = 0,      platform screw  P_q q + P_y y.

Multiplication by Z', whose rows are orthogonal to the columns of A_q, eliminates q.
The solutions y = W t of Z'A_y y = 0, with W orthonormal, are the modes.  Their energy
is t.t / 2, and C = L L', where the columns of L are the platform screws of the modes.

In the classical model, clearances are fixed at zero.  In problem (22), a clearance is
either free or closed.  A closed clearance is rigid in the direction normal to its
bound.  If the joint slides along a round bound, the contact force f [J, per unit of the
bound] rotates and acts like a spring of stiffness f.

Sources:
    Pashkevich, Chablat, Wenger (2009), Stiffness analysis of overconstrained parallel
    manipulators (virtual joints; passive joints without springs).
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.closure import (
    Linearisation,
    VirtualJoints,
    in_reference_lengths,
    linearise,
    virtual_joints,
)
from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.model.joint_names import shown_name
from forcefit.assembly.platform_stiffness.active_set import (
    bound_forces,
    contacts,
    settle,
)
from forcefit.assembly.platform_stiffness.matrices import (
    Part,
    PlatformStiffness,
    unit_screws,
)
from forcefit.assembly.solvers.method import Method

Side = Literal["loading", "unloading"]
_RANK = 1e-10  # [-] tolerance for zero singular values, relative to the largest
_NOISE = 1e-12  # [-] relative round-off of a projection


def without_clearance(posture: Posture) -> PlatformStiffness:
    """Return the stiffness of the classical model, with clearances fixed at zero.

    Args:
        posture: the robot's configuration.

    Returns:
        The stiffness at the platform's origin.
    """
    lin, joints = linearise(posture), virtual_joints(posture.robot)
    return _stiffness(lin, "nominal", joints.elastic, owners(joints),
                      joints.free, "reference")  # fmt: skip


def in_contact(assembly: Assembly, side: Side = "loading") -> PlatformStiffness:
    """Return the tangent stiffness of problem (22) at an equilibrium.

    Args:
        assembly: minimum-energy assembly under its loads.
        side: ``"loading"`` if contacts without a force remain closed, ``"unloading"``
            if they open.

    Returns:
        The stiffness at the platform's origin.
    """
    return active_tangent(settle(assembly), side)


def active_tangent(assembly: Assembly, side: Side = "loading") -> PlatformStiffness:
    """Return the tangent stiffness of an assembly that is nearly in equilibrium.

    Args:
        assembly: assembly whose clearances are accurate to machine precision.
        side: behaviour of contacts without a force, see :func:`in_contact`.

    Returns:
        The stiffness at the platform's origin.
    """
    joints, u = assembly.joints, assembly.clearances
    pressed, touching = contacts(assembly)
    held = pressed | (touching & (side == "loading"))
    force = bound_forces(assembly)
    springs, names, free = [joints.elastic], owners(joints), [joints.free]
    for k, is_held in enumerate(held):
        rows = np.flatnonzero(joints.group == k)
        columns = joints.cones[:, rows]
        if not is_held:
            free.append(columns / np.linalg.norm(columns, axis=0))
            continue
        for tangent in _tangents(u[rows]):
            along = columns @ tangent
            if pressed[k]:
                springs.append(along[:, None] / np.sqrt(force[k]))
                names.append(Part(_frame(joints, rows[0]), "clearance"))
            else:
                free.append(along[:, None] / np.linalg.norm(along))
    return _stiffness(assembly.linearisation, "contact", np.hstack(springs), names,
                      np.hstack(free), assembly.method)  # fmt: skip


def _tangents(u: NDArray) -> NDArray:
    """Return tangents to the boundary of a cone at a point u, as rows (d - 1, d)."""
    if len(u) == 2:
        return np.array([[-u[1], u[0]]])
    return np.asarray(np.linalg.svd(u[None])[2][1:])


def _frame(joints: VirtualJoints, column: int) -> str:
    """Return the name of the frame or joint that has a clearance."""
    row = int(np.abs(joints.cones[:, column]).argmax()) // 6
    return shown_name(joints.robot, row)


def owners(joints: VirtualJoints) -> list[Part]:
    """Return the link or joint of each column of ``joints.elastic``."""
    rows = np.abs(joints.elastic).argmax(axis=0) // 6 if joints.elastic.size else ()
    return [
        Part(shown_name(joints.robot, row), "link" if link else "joint")
        for row, link in zip(rows, joints.links, strict=True)
    ]


def _stiffness(
    lin: Linearisation, state: str, springs: NDArray, parts: list[Part], free: NDArray,
    method: Method,
) -> PlatformStiffness:  # fmt: skip
    """Return the stiffness computed from the modes, see the module docstring."""
    free = free / _sizes(free, lin.size)
    A_q, A_y = lin.rows @ free, lin.rows @ springs
    tolerance = _RANK + 30.0 * lin.posture.mismatch
    U, S, Vt = _svd(A_q)
    rank = int(np.sum(S > tolerance * S.max(initial=0.0)))
    closing = Vt[:rank].T / S[:rank] @ U[:, :rank].T
    loose = Vt[rank:].T
    _, S, Vt = _svd(U[:, rank:].T @ A_y)
    noise = _NOISE * np.abs(A_y).max(initial=0.0)
    rank = int(np.sum(S > max(noise, tolerance * S.max(initial=0.0))))
    modes = Vt[rank:].T
    joined = springs @ modes - free @ (closing @ (A_y @ modes))
    return PlatformStiffness(
        posture=lin.posture,
        state=state,
        point=lin.posture.platform[:3, 3],
        length=lin.size,
        root=lin.platform @ joined,
        signs=np.ones(modes.shape[1]),
        springs=modes,
        parts=tuple(parts),
        free=unit_screws(lin.platform @ free @ loose, lin.size),
        method=method,
    )


def _sizes(columns: NDArray, length: float) -> NDArray:
    """Return the norms of screws, in rad and reference lengths."""
    weights = np.tile(in_reference_lengths(length), len(columns) // 6)
    return np.linalg.norm(columns * weights[:, None], axis=0)


def _svd(A: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return all singular vectors of a matrix, which may have no rows or columns."""
    if A.size:
        return np.linalg.svd(A)
    return np.eye(A.shape[0]), np.zeros(0), np.eye(A.shape[1])
