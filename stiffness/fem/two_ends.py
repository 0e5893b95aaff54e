"""Stiffness and mass matrix of a meshed link with two moving ends.

Both ends are rigid, and the solid between them deforms statically (Guyan reduction).
The mass matrix is exact for rigid motions. In bending, it is as accurate as the mass
matrix of a cubic beam element. Because a rigid motion causes no deformation, the
displacements due to a motion of the base follow from those due to a motion of the tip.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.fem.condensation import condense, rigid_motions
from forcefit.stiffness.fem.elements import integration
from forcefit.stiffness.fem.fea import MeshedLink
from forcefit.stiffness.screws import screw_map


@dataclass(frozen=True, eq=False)
class TwoEnds:
    """Stiffness and mass matrix of a link with two rigid ends, base before tip.

    Attributes:
        stiffness: (12, 12) [N m/rad .. N/m] stiffness matrix.
        mass: (12, 12) [kg m^2 .. kg] mass matrix; zero if the density is zero.
    """

    stiffness: NDArray
    mass: NDArray


def two_ends(solved: MeshedLink) -> TwoEnds:
    """Condense a meshed link onto its two ends.

    Args:
        solved: link solved on its finest mesh.

    Returns:
        Stiffness and mass matrix, in the axes of the mesh.

    Sources:
        Guyan (1965), Reduction of stiffness and mass matrices.
    """
    mesh, constants = solved.level.mesh, solved.level.material
    held = solved.level.solution
    if held.kind != "rigid":
        held = condense(mesh, constants[:, 0], constants[:, 1], solved.centers)
    base, tip = solved.centers
    # motion of the tip relative to the rigid motion of the link with the base
    against = np.hstack([-screw_map(base - tip), np.eye(6)])
    K = against.T @ held.stiffness @ against
    fields = np.einsum("nik,kj->nij", held.fields, against)
    fields[:, :, :6] += rigid_motions(mesh.nodes, base)
    M = np.zeros((12, 12))
    for chunk in integration(mesh):
        at = np.einsum("qm,cmxk->cqxk", chunk.N, fields[mesh.cells[chunk.part]])
        heavy = (chunk.w * constants[chunk.part, 2, None])[..., None, None] * at
        M += np.tensordot(at, heavy, axes=([0, 1, 2], [0, 1, 2]))
    return TwoEnds((K + K.T) / 2, (M + M.T) / 2)
