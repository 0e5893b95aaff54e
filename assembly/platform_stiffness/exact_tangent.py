r"""The tangent of the exact equilibrium on SE(3), geometric stiffness included.

Near an equilibrium the unknowns move by Z t along closures and along pressed bounds.
The total potential (energy minus the work of loads) changes by t.Z'HZt / 2, with H the
true second derivative of the Lagrangian: springs, and the forces of assembly and load
on parts that rotate.  A small additional wrench w does the work w.(V Z t), where V is
the platform's small motion in base axes from its present pose.  The response is C = V Z
(Z'HZ)^-1 Z'V'.

The potential is stationary there, so its second derivative depends on no chart of
SE(3): C and K are symmetric in any coordinates of the platform.  They depend on the way
in which the existing load follows the motion.  Here its force is dead, and the work of
its moment m is m . theta, with theta the rotation vector from the nominal posture.  A
moment constant in base axes has no potential: near theta = 0 it adds skew(m) / 2,
antisymmetric, to the rotational block of K.

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

FLAT = 1e-12  # relative to the largest curvature: smaller ones count as zero


def exact_tangent(
    equilibrium: ExactAssembly, side: Side = "holding"
) -> PlatformStiffness:
    """Return the stiffness of the platform at an exact equilibrium.

    Args:
        equilibrium: the manipulator assembled with finite motions, under its loads.
        side: state of clearances at their bound without a force.

    Returns:
        The stiffness at the platform's displaced origin, base axes; modes of negative
        curvature have the sign -1.
    """
    local = equilibrium.expansion
    model, at = local.placement.model, local.placement
    D, H = tangent_space(local, hold_touching=side == "holding")
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
    """Return the owner of each spring; pieces belong to their beam."""
    cut, robot = equilibrium.cut, equilibrium.posture.robot
    parts = owners(equilibrium.expansion.placement.model.joints)
    rows = [cut.owner[row_of(cut.robot, part.frame)] for part in parts]
    return tuple(
        Part(shown_name(robot, row), part.kind)
        for row, part in zip(rows, parts, strict=True)
    )


def platform_moves(local: Expansion) -> NDArray:
    """Return (6, N) small motion of the platform at its present origin, base axes."""
    rows = local.placement.platform_rows.copy()
    rows[:3] = turn_jacobian(local.placement.platform_screw[:3]) @ rows[:3]
    return rows
