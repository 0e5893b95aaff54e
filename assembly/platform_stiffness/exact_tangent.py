r"""Tangent stiffness of the exact equilibrium on SE(3), including geometric stiffness.

Small motions Z t of the unknowns satisfy the linearised constraints: loops remain
closed, and contacts in clearances remain in contact.  The potential (energy minus the
work of the loads) changes by t.Z'HZt / 2, where H is the exact Hessian of the
Lagrangian.  H includes the geometric stiffness due to internal forces and loads.  The
small motion of the platform is V Z t, in base axes, and its compliance is

    C = V Z (Z'HZ)^-1 Z'V'.

C is symmetric because the potential is stationary at an equilibrium.  The force on the
platform is a dead load.  The work of the moment m on the platform is m . theta, where
theta is the rotation vector from the nominal posture.  A moment that is constant in
base axes is not conservative.  Near theta = 0, it would add the antisymmetric matrix
skew(m) / 2 to the rotational block of K.

Sources:
    Zefran, Kumar (2002), A geometrical approach to the study of the Cartesian stiffness
    matrix (symmetry of the stiffness at an equilibrium).
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.descent import Expansion
from forcefit.assembly.exact.equilibrium import curvature_modes, tangent_space
from forcefit.assembly.exact.exact import ExactAssembly
from forcefit.assembly.kinematics.se3 import turn_jacobian
from forcefit.assembly.model.joint_names import row_of, shown_name
from forcefit.assembly.platform_stiffness.linear_tangent import Side, owners
from forcefit.assembly.platform_stiffness.matrices import (
    Part,
    PlatformStiffness,
    unit_screws,
)

FLAT = 1e-12  # [-] tolerance for zero curvatures, relative to the largest


def exact_tangent(
    equilibrium: ExactAssembly, side: Side = "loading"
) -> PlatformStiffness:
    """Return the stiffness of the platform at an exact equilibrium.

    Args:
        equilibrium: equilibrium of the robot with finite motions.
        side: ``"loading"`` if contacts without a force remain closed, ``"unloading"``
            if they open.

    Returns:
        The stiffness at the displaced origin of the platform, base axes.  Modes with
        negative curvature have the sign -1.
    """
    local = equilibrium.expansion
    model, at = local.placement.model, local.placement
    D, H = tangent_space(local, hold_touching=side == "loading")
    curvature, modes = curvature_modes(D, H, model.units)
    flat = np.abs(curvature) <= FLAT * np.abs(curvature).max(initial=0.0)
    bent = modes[:, ~flat] / np.sqrt(np.abs(curvature[~flat]))
    moves, length = platform_moves(local), model.size
    return PlatformStiffness(
        posture=equilibrium.posture,
        state="exact",
        point=at.platform[:3, 3].copy(),
        length=length,
        root=moves @ bent,
        signs=np.sign(curvature[~flat]),
        springs=bent[model.springs],
        parts=part_owners(equilibrium),
        free=unit_screws(moves @ modes[:, flat], length),
        method=equilibrium.method,
    )


def part_owners(equilibrium: ExactAssembly) -> tuple[Part, ...]:
    """Return the link or joint to which each spring belongs."""
    cut, robot = equilibrium.cut, equilibrium.posture.robot
    parts = owners(equilibrium.expansion.placement.model.joints)
    rows = [cut.owner[row_of(cut.robot, part.frame)] for part in parts]
    return tuple(
        Part(shown_name(robot, row), part.kind)
        for row, part in zip(rows, parts, strict=True)
    )


def platform_moves(local: Expansion) -> NDArray:
    """Return the platform's small motion per unit of each unknown, (6, N).

    The reference point is the displaced origin of the platform; base axes.
    """
    rows = local.placement.platform_rows.copy()
    rows[:3] = turn_jacobian(local.placement.platform_screw[:3]) @ rows[:3]
    return rows
