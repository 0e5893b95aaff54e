"""Stress that a tip wrench causes in a link.

Six fields, one for each component of the wrench, hold every answer: stresses superpose.
At the edge of a rigid interface the elastic solution is singular: the peak there grows
without bound as the mesh is refined and means nothing.  Stresses are therefore reported
only at some distance from the interfaces, one interface radius unless told otherwise,
and the report says so.  What happens inside that distance, and how a real joint holds
the link, is left out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffness.elements import Quadratic, node_gradients
from stiffness.estimate import PAIRS
from stiffness.fea import Level, MeshedLink
from stiffness.reading import BadInput


@dataclass(frozen=True, eq=False)
class StressInfluence:
    """Stresses of unit tip wrenches at the nodes of a mesh, away from interfaces.

    Attributes:
        places: (p, 3) [m] nodes, in the link's axes.
        influence: (p, 6, 6) [Pa/(N m), Pa/N] stress xx yy zz yz xz xy of each component
            of the tip's wrench.
        away: [m] nothing nearer than this to an interface is here.
    """

    places: NDArray
    influence: NDArray
    away: float

    @property
    def region(self) -> str:
        """Where the stresses are from, in words."""
        return (
            f"{len(self.places)} nodes at least {self.away:.4g} m away from both "
            "interfaces, whose clamped edges are singular"
        )

    def stresses(self, wrench: ArrayLike) -> NDArray:
        """Stresses of a tip wrench.

        Args:
            wrench: (6,) [N m, N] at the tip, in the link's axes.

        Returns:
            (p, 6) [Pa] xx yy zz yz xz xy.
        """
        return np.einsum("pws,w->ps", self.influence, np.asarray(wrench, dtype=float))

    def peak(self, wrench: ArrayLike) -> tuple[float, NDArray]:
        """Largest von Mises stress of a tip wrench, and where.

        Args:
            wrench: (6,) [N m, N] at the tip, in the link's axes.

        Returns:
            [Pa] and (3,) [m].
        """
        values = von_mises(self.stresses(wrench))
        worst = int(np.argmax(values))
        return float(values[worst]), self.places[worst]


def von_mises(stress: ArrayLike) -> NDArray:
    """Equivalent stress.

    Args:
        stress: (..., 6) [Pa] xx yy zz yz xz xy.

    Returns:
        (...) [Pa].
    """
    s = np.asarray(stress, dtype=float)
    x, y, z, yz, xz, xy = np.moveaxis(s, -1, 0)
    normal = (x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2
    return np.sqrt(normal / 2 + 3 * (yz**2 + xz**2 + xy**2))


def stress_influence(solved: MeshedLink, away: float | None = None) -> StressInfluence:
    """Stresses of the six unit tip wrenches of a solved link.

    Args:
        solved: from :func:`stiffness.fea.solve_link`; of one material, or read the
            stresses at the seams of several with care: they are averaged there.
        away: [m] from the interfaces; one interface radius if absent.

    Returns:
        The influence.

    Raises:
        BadInput: nothing of the link is so far away.
    """
    from scipy.spatial import cKDTree

    level = solved.level
    mesh = level.mesh
    sizes = [_interface_radius(mesh, k) for k in (0, 1)]
    distance = max(sizes) if away is None else away
    held = np.unique(mesh.faces[mesh.patch <= 1])
    gap = cKDTree(mesh.nodes[held]).query(mesh.nodes)[0]
    far = gap >= distance
    if not far.any():
        raise BadInput(
            f"stress: nothing of the link is {distance:.4g} m away from its "
            f"interfaces; the furthest node is {gap.max():.4g} m"
        )
    per_screw = _nodal_stresses(level)[far]
    influence = np.einsum("pks,kw->pws", per_screw, solved.link.compliance)
    return StressInfluence(mesh.nodes[far], influence, float(distance))


def _interface_radius(mesh: Quadratic, patch: int) -> float:
    """[m] largest distance of an interface's nodes from their middle."""
    points = mesh.nodes[np.unique(mesh.faces[mesh.patch == patch])]
    return float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())


def _nodal_stresses(level: Level) -> NDArray:
    """(n, 6, 6) stress of each unit screw at each node, averaged over elements."""
    mesh, fields = level.mesh, level.solution.fields
    total = np.zeros((len(mesh.nodes), 6, 6))
    count = np.bincount(mesh.cells.ravel(), minlength=len(mesh.nodes))
    for part, G in node_gradients(mesh):
        nodes = mesh.cells[part]
        slope = np.einsum("cqax,caik->cqkix", G, fields[nodes], optimize=True)
        lam, mu, _ = level.material[part].T[:, :, None, None]
        pressure = lam * np.trace(slope, axis1=-2, axis2=-1)
        stress = np.stack(
            [
                mu * (slope[..., i, j] + slope[..., j, i]) + (i == j) * pressure
                for i, j in PAIRS
            ],
            axis=-1,
        )
        np.add.at(total, nodes, stress)
    return total / np.maximum(count, 1)[:, None, None]
