"""Displacements of a meshed link under its own weight."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.stiffness.fem.elements import Elements, assemble, integration
from forcefit.stiffness.fem.fea import MeshedLink
from forcefit.stiffness.fem.sparse_solver import solve
from forcefit.stiffness.link import inverted


def with_own_weight(solved: MeshedLink) -> MeshedLink:
    """Add the displacements under unit gravity to the solution of a link.

    Args:
        solved: link solved on its finest mesh, with a density.

    Returns:
        The link with nine displacement fields, (n, 3, 9). The first six [m] are for
        unit screws of the tip. The last three [m per m/s^2] are for unit gravity along
        x, y and z with a clamped base and a free tip.

    Raises:
        BadInput: the link has no density, or both interfaces are distributing.
    """
    level = solved.level
    mesh, held = level.mesh, level.solution
    lam, mu, density = level.material.T
    if not density.any():
        raise BadInput("gravity: the link has no density; expected a density [kg/m^3]")
    if held.kind == "distributing-both":
        raise BadInput(
            "gravity: found the interface kind distributing-both, for which the base "
            "is not clamped; expected rigid or distributing"
        )
    masses = _nodal_masses(mesh, density)
    loads = masses[:, None, None] * np.eye(3)
    fixed = mesh.patch <= 1 if held.kind == "rigid" else mesh.patch == 0
    free = np.ones(len(mesh.nodes), dtype=bool)
    free[np.unique(mesh.faces[fixed])] = False
    free = np.repeat(free, 3)
    flat = np.zeros((3 * len(mesh.nodes), 3))
    upper = assemble(mesh, lam, mu)
    flat[free] = solve(upper[free][:, free], loads.reshape(-1, 3)[free])
    fields = flat.reshape(-1, 3, 3)
    # add the motion of the free tip due to the weight
    if held.kind == "rigid":
        at_tip = np.einsum("nxk,nxg->kg", held.fields, loads)
        fields = fields + held.fields @ (inverted(held.stiffness) @ at_tip)
    both = np.concatenate([held.fields, fields], axis=2)
    solution = replace(held, fields=both)
    return replace(solved, level=replace(level, solution=solution))


def _nodal_masses(mesh: Elements, density: NDArray) -> NDArray:
    """Integrate the density times each shape function, (n,) [kg]."""
    masses = np.zeros(len(mesh.nodes))
    for part, _, _, N, _, w in integration(mesh, density > 0):
        share = (w * density[part, None]) @ N
        np.add.at(masses, mesh.cells[part], share)
    return masses
