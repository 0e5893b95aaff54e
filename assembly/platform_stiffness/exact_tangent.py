r"""Tangent stiffness of the exact equilibrium on SE(3), including geometric stiffness.

Near an equilibrium the unknowns move by Z t, which satisfies the closures and keeps
closed clearances at their bounds.  The total potential (energy minus the work of the
loads) changes by t.Z'HZt / 2, where H is the exact Hessian of the Lagrangian.  It
includes the springs and the effect of assembly forces and loads on rotating parts.  A
small additional wrench w does the work w.(V Z t), where V Z t is the platform's small
motion from its current pose, in base axes.  The compliance is C = V Z (Z'HZ)^-1 Z'V'.

The potential is stationary at the equilibrium, so its second derivative does not depend
on the chart of SE(3), and C and K are symmetric in any coordinates of the platform.
Both depend on how the existing load follows the motion.  Here the force is a dead load,
and the work of the moment m is m . theta, where theta is the rotation vector from the
nominal posture.  A moment that is constant in base axes has no potential: near theta =
0 it adds the antisymmetric skew(m) / 2 to the rotational block of K.

Sources:
    Zefran, Kumar (2002), A geometrical approach to the study of the Cartesian stiffness
    matrix (charts, connections; symmetry where the potential is stationary).
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

# relative to the largest curvature of the potential: smaller ones count as zero
FLAT = 1e-12


def exact_tangent(
    equilibrium: ExactAssembly, side: Side = "loading"
) -> PlatformStiffness:
    """Return the stiffness of the platform at an exact equilibrium.

    Args:
        equilibrium: the manipulator assembled with finite motions, under its loads.
        side: behaviour of clearances at their bound without a force: ``"loading"`` if
            they stay at the bound, ``"unloading"`` if they leave it.

    Returns:
        The stiffness at the platform's displaced origin, base axes; modes of negative
        curvature have the sign -1.
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
    """Return the owner of each spring; the pieces of a beam belong to the beam."""
    cut, robot = equilibrium.cut, equilibrium.posture.robot
    parts = owners(equilibrium.expansion.placement.model.joints)
    rows = [cut.owner[row_of(cut.robot, part.frame)] for part in parts]
    return tuple(
        Part(shown_name(robot, row), part.kind)
        for row, part in zip(rows, parts, strict=True)
    )


def platform_moves(local: Expansion) -> NDArray:
    """Return (6, N) small motions of the platform at its current origin, base axes."""
    rows = local.placement.platform_rows.copy()
    rows[:3] = turn_jacobian(local.placement.platform_screw[:3]) @ rows[:3]
    return rows
