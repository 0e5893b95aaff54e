"""What a link is made of, and where."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from stiffness.beam.sections import check_material
from stiffness.fem.elements import Elements, lame
from stiffness.mesh.regions import Region
from stiffness.surface.primitives import Plane


@dataclass(frozen=True, eq=False)
class Material:
    """An isotropic solid, and where in the link it is.

    Attributes:
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.
        density: [kg/m^3], 0 for a link without mass.
        where: which of the points (n, 3) [m], in the mesh's axes, are of this material;
            the last material that contains an element's centre applies.
        planes: of the faces of where it is; the mesh is cut along them.
    """

    E: float
    nu: float
    density: float = 0.0
    where: Callable[[NDArray], NDArray] | None = None
    planes: tuple[Plane, ...] = ()

    def __post_init__(self) -> None:
        check_material("material", self.E, self.nu)
        if not (math.isfinite(self.density) and self.density >= 0):
            raise BadInput(f"material: density = {self.density:g} must be >= 0")


def material_of_elements(mesh: Elements, materials: Sequence[Material]) -> NDArray:
    """Material of each element, taken at its centre.

    Args:
        mesh: the tetrahedra.
        materials: the first fills the link, later ones where they say.

    Returns:
        (t, 3) lambda [Pa], mu [Pa] and density [kg/m^3].

    Raises:
        BadInput: there is none, or the first does not fill the link.
    """
    check_materials(materials)
    table = material_at(mesh.nodes[mesh.cells[:, :4]].mean(axis=1), materials)
    if not (table[:, 1] > 0).all():
        raise BadInput("materials: the first must fill the whole link")
    return table


def material_at(points: NDArray, materials: Sequence[Material]) -> NDArray:
    """Material at points of a link.

    Args:
        points: (n, 3) [m].
        materials: the first fills the link, later ones where they say.

    Returns:
        (n, 3) lambda [Pa], mu [Pa] and density [kg/m^3].
    """
    table = np.zeros((len(points), 3))
    for material in materials:
        lam, mu = lame(material.E, material.nu)
        where = material.where or (lambda points: np.ones(len(points), dtype=bool))
        table[where(points)] = lam, mu, material.density
    return table


def regions_of(materials: Sequence[Material]) -> tuple[Region, ...]:
    """Where the materials after the first are.

    Args:
        materials: the first fills the link, later ones where they say.

    Returns:
        The regions, later ones count more.
    """
    return tuple(
        Region(material.where, material.planes)
        for material in materials[1:]
        if material.where is not None
    )


def check_materials(materials: Sequence[Material]) -> None:
    """Refuse a link without a material.

    Args:
        materials: of a link.

    Raises:
        BadInput: there is none.
    """
    if not materials:
        raise BadInput("materials: at least one is needed")
