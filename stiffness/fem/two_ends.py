"""A meshed link against motions of both its ends: stiffness and consistent mass.

Held at neither end, rigid at both: between them the solid follows without inertia of
its own (Guyan), so that the mass is exact for motions as a whole and as good as a
beam's cubic for bending.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stiffness.fem.condensation import rigid_motions
from stiffness.fem.elements import assemble, integration
from stiffness.fem.fea import MeshedLink
from stiffness.fem.sparse_solver import solve


@dataclass(frozen=True, eq=False)
class TwoEnds:
    """A link between two rigid ends; rows base then tip, each read at its centre.

    Attributes:
        stiffness: (12, 12) [N m/rad .. N/m]; moving as a whole costs nothing.
        mass: (12, 12) [kg m^2 .. kg], zero without a density.
    """

    stiffness: NDArray
    mass: NDArray


def two_ends(solved: MeshedLink) -> TwoEnds:
    """Condense a meshed link onto both its ends.

    Args:
        solved: on its finest mesh.

    Returns:
        Its stiffness and mass, in the mesh's axes.

    Sources:
        Guyan (1965), Reduction of stiffness and mass matrices.
    """
    mesh, constants = solved.level.mesh, solved.level.material
    upper = assemble(mesh, constants[:, 0], constants[:, 1])
    fields = np.zeros((len(mesh.nodes), 3, 12))
    free = np.ones(len(mesh.nodes), dtype=bool)
    for side, center in enumerate(solved.centers):
        nodes = np.unique(mesh.faces[mesh.patch == side])
        columns = slice(6 * side, 6 * side + 6)
        fields[nodes, :, columns] = rigid_motions(mesh.nodes[nodes], center)
        free[nodes] = False
    free = np.repeat(free, 3)
    flat = fields.reshape(-1, 12)
    full = upper + upper.T
    full.setdiag(upper.diagonal())
    flat[free] = solve(upper[free][:, free], -(full @ flat)[free])
    K = flat.T @ (full @ flat)
    M = np.zeros((12, 12))
    for chunk in integration(mesh):
        at = np.einsum("qm,cmxk->cqxk", chunk.N, fields[mesh.cells[chunk.part]])
        heavy = (chunk.w * constants[chunk.part, 2, None])[..., None, None] * at
        M += np.tensordot(at, heavy, axes=([0, 1, 2], [0, 1, 2]))
    return TwoEnds((K + K.T) / 2, (M + M.T) / 2)
