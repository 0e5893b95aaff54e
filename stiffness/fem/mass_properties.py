"""Mass properties of a meshed link."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.fem.elements import Elements, integration


@dataclass(frozen=True, eq=False)
class PointMass:
    """A point mass on a link.

    Attributes:
        mass: [kg] mass.
        place: (3,) [m] position, in the axes of the mesh.
    """

    mass: float
    place: NDArray


def mass_properties(
    mesh: Elements, density: NDArray, point_masses: Sequence[PointMass] = ()
) -> tuple[float, NDArray, NDArray]:
    """Compute mass, centre of mass and inertia of the elements and point masses.

    Args:
        mesh: the elements.
        density: (t,) [kg/m^3] density of each element.
        point_masses: point masses to add to the elements.

    Returns:
        Mass [kg]; centre of mass, (3,) [m]; and inertia about the centre of mass,
        (3, 3) [kg m^2]. All are zero if the mass is zero.
    """
    origin = mesh.nodes.mean(axis=0)
    mass, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for part, _, _, N, _, w in integration(mesh, density > 0):
        x = np.einsum("qa,tax->tqx", N, mesh.nodes[mesh.cells[part]])
        x, dm = x - origin, w * density[part, None]
        mass += float(dm.sum())
        first += np.einsum("tq,tqx->x", dm, x)
        second += np.einsum("tq,tqx,tqy->xy", dm, x, x)
    for point in point_masses:
        x = np.asarray(point.place) - origin
        mass, first = mass + point.mass, first + point.mass * x
        second = second + point.mass * np.outer(x, x)
    if mass == 0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    center = first / mass
    about_center = second - mass * np.outer(center, center)
    inertia = np.trace(about_center) * np.eye(3) - about_center
    return mass, center + origin, inertia
