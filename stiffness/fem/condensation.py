"""Static condensation of a meshed link onto its two interfaces.

The kind of the interfaces determines how the joints are coupled to the surface:

- ``rigid`` (RBE2): all nodes of an interface move as a rigid body, as if the interface
  were bolted to a much stiffer part.
- ``distributing`` (RBE3): the base is rigid, and the tip interface can deform. The tip
  wrench is distributed over the interface as linearly varying tractions. The tip screw
  is the rigid motion that fits the displacements of the interface in the least-squares
  sense.
- ``distributing-both``: both interfaces can deform.

The stiffness decreases from the first kind to the last.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from forcefit.stiffness.fem.elements import Elements, assemble, triangle_areas
from forcefit.stiffness.fem.sparse_solver import solve
from forcefit.stiffness.link import inverted
from forcefit.stiffness.screws import screw_map, skew

KINDS = ("rigid", "distributing", "distributing-both")


@dataclass(frozen=True, eq=False)
class Condensed:
    """Stiffness of a link on a mesh, and its displacement fields.

    Attributes:
        stiffness: (6, 6) stiffness at the centre of the tip, with the base clamped.
        fields: (n, 3, 6) [m] displacements for unit screws of the tip.
        unknowns: number of unknowns in the solved system.
        kind: kind of the interfaces, one of ``KINDS``.
    """

    stiffness: NDArray
    fields: NDArray
    unknowns: int
    kind: str = "rigid"


def condense(
    mesh: Elements,
    lam: NDArray,
    mu: NDArray,
    centers: NDArray,
    kind: str = "rigid",
) -> Condensed:
    """Condense a meshed link onto its interfaces.

    Args:
        mesh: elements. Patch 0 is the base, and patch 1 is the tip.
        lam: (t,) [Pa] Lame's first constant of each element.
        mu: (t,) [Pa] shear modulus of each element.
        centers: (2, 3) [m] centres of base and tip.
        kind: kind of the interfaces, one of ``KINDS``.

    Returns:
        The stiffness and the displacement fields.
    """
    upper = assemble(mesh, lam, mu)
    if kind == "rigid":
        return _rigid(mesh, upper, centers[1])
    if kind == "distributing":
        return replace(_distributing_tip(mesh, upper, centers[1]), kind=kind)
    return replace(_distributing_both(mesh, upper, centers), kind=kind)


def rigid_motions(points: NDArray, center: NDArray) -> NDArray:
    """Return the displacements of points for unit screws.

    Args:
        points: (n, 3) [m] points.
        center: (3,) [m] reference point of the screws.

    Returns:
        (n, 3, 6) displacements.
    """
    shift = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return np.concatenate([-skew(points - center), shift], axis=2)


def _product(upper: csr_array, fields: NDArray) -> NDArray:
    """Multiply a symmetric matrix, given by its upper triangle, by fields."""
    return upper @ fields + upper.T @ fields - upper.diagonal()[:, None] * fields


def _rigid(mesh: Elements, upper: csr_array, tip_center: NDArray) -> Condensed:
    """Compute the stiffness of a link with two rigid interfaces."""
    fields = np.zeros((len(mesh.nodes), 3, 6))
    base = np.unique(mesh.faces[mesh.patch == 0])
    tip = np.unique(mesh.faces[mesh.patch == 1])
    fields[tip] = rigid_motions(mesh.nodes[tip], tip_center)
    free = np.ones(len(mesh.nodes), dtype=bool)
    free[base] = free[tip] = False
    free = np.repeat(free, 3)
    flat = fields.reshape(-1, 6)
    loads = -_product(upper, flat)[free]
    flat[free] = solve(upper[free][:, free], loads)
    # K is computed from the strain energy, because the error of the energy is quadratic
    # in the error of the displacements
    K = flat.T @ _product(upper, flat)
    return Condensed((K + K.T) / 2, fields, int(free.sum()))


def _distributing_tip(
    mesh: Elements, upper: csr_array, tip_center: NDArray
) -> Condensed:
    """Compute the stiffness of a link with a rigid base and a distributing tip."""
    flat = _distributed_loads(mesh, 1, tip_center).reshape(-1, 6)
    free = np.ones(len(mesh.nodes), dtype=bool)
    free[np.unique(mesh.faces[mesh.patch == 0])] = False
    free = np.repeat(free, 3)
    return _from_loads(upper, flat, free)


def _distributing_both(mesh: Elements, upper: csr_array, centers: NDArray) -> Condensed:
    """Compute the stiffness of a link with two distributing interfaces."""
    base, tip = (_distributed_loads(mesh, k, centers[k]) for k in (0, 1))
    # unit wrenches at the tip and their reactions at the base
    to_base = screw_map(centers[0] - centers[1])
    loads = tip - np.einsum("nij,jk->nik", base, to_base.T)
    flat = loads.reshape(-1, 6)
    supports = _isostatic_supports(mesh)
    free = np.ones(len(flat), dtype=bool)
    free[supports] = False
    # the supports are unloaded, and the motion of the tip is relative to the base
    return _from_loads(upper, flat, free)


def _from_loads(upper: csr_array, loads: NDArray, free: NDArray) -> Condensed:
    """Compute the stiffness from the displacements under unit wrenches."""
    u = np.zeros_like(loads)
    u[free] = solve(upper[free][:, free], loads[free])
    C = loads.T @ u
    K = inverted((C + C.T) / 2)
    fields = u.reshape(-1, 3, 6) @ K
    return Condensed(K, fields, int(free.sum()))


def _distributed_loads(mesh: Elements, patch: int, center: NDArray) -> NDArray:
    """Return the nodal loads of unit wrenches on an interface, (n, 3, 6)."""
    faces = mesh.faces[mesh.patch == patch]
    nodes, index = np.unique(faces, return_inverse=True)
    index = index.reshape(faces.shape)
    mass = np.zeros((len(nodes), len(nodes)))
    N, area = triangle_areas(mesh, faces)
    blocks = np.einsum("tq,qa,qb->tab", area, N, N)
    np.add.at(mass, (index[:, :, None], index[:, None, :]), blocks)
    motions = rigid_motions(mesh.nodes[nodes], center)
    weighted = np.einsum("ab,bij->aij", mass, motions)
    gram = np.einsum("aij,aik->jk", motions, weighted)
    loads = np.zeros((len(mesh.nodes), 3, 6))
    loads[nodes] = weighted @ inverted(gram)
    return loads


def _isostatic_supports(mesh: Elements) -> NDArray:
    """Return the six unknowns that are fixed by a statically determinate support."""
    points = mesh.nodes
    first = int(np.argmin(points @ [1.0, 0.3, 0.1]))
    apart = np.linalg.norm(points - points[first], axis=1)
    second = int(np.argmax(apart))
    line = (points[second] - points[first]) / apart[second]
    off = np.linalg.norm(np.cross(points - points[first], line), axis=1)
    third = int(np.argmax(off))
    normal = np.abs(np.cross(points[third] - points[first], line))
    # The second node can move along the line to the first node. The third node is fixed
    # only normal to the plane of the three nodes.
    second_fixed = [3 * second + d for d in range(3) if d != np.argmax(np.abs(line))]
    third_fixed = 3 * third + int(np.argmax(normal))
    return np.array([*(3 * first + d for d in range(3)), *second_fixed, third_fixed])
