"""Materials of a link and the regions in which they apply."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.sections import check_material
from forcefit.stiffness.fem.elements import Elements, lame
from forcefit.stiffness.mesh.cut_face import CutFace
from forcefit.stiffness.mesh.regions import Region, region_of_places


@dataclass(frozen=True, eq=False)
class Material:
    """An isotropic material and its region in the link.

    Attributes:
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.
        density: [kg/m^3] density; 0 for a link without mass.
        where: function that returns which points (n, 3) [m], in the mesh's axes, are in
            the region of this material. Where regions overlap, the last material
            applies. An element takes the material at its centre.
        faces: faces of the region, along which the mesh is cut.
        solid: name of the solid in a STEP file that consists of this material, or
            ``one+other`` for two solids, in place of ``where`` and ``faces``.
    """

    E: float
    nu: float
    density: float = 0.0
    where: Callable[[NDArray], NDArray] | None = None
    faces: tuple[CutFace, ...] = ()
    solid: str = ""

    def __post_init__(self) -> None:
        check_material("material", self.E, self.nu)
        if not (math.isfinite(self.density) and self.density >= 0):
            raise BadInput(f"material: density = {self.density:g} must be >= 0")


def material_of_elements(
    mesh: Elements, materials: Sequence[Material], cut_region: NDArray | None = None
) -> NDArray:
    """Evaluate the material of each element at its centre.

    Args:
        mesh: the tetrahedra.
        materials: materials; the first fills the link, later ones fill their regions.
        cut_region: (t,) region of each element, counting only regions along whose
            faces the mesh was cut; None if it was not cut.

    Returns:
        (t, 3) lambda [Pa], mu [Pa] and density [kg/m^3].

    Raises:
        BadInput: no material is given, or the first one does not fill the link.
    """
    check_materials(materials)
    centers = mesh.nodes[mesh.cells[:, :4]].mean(axis=1)
    first = materials[0].where
    number = region_of_places(centers, regions_of(materials), cut_region)
    if first is not None and not first(centers[number == 0]).all():
        raise BadInput("materials: the first must fill the whole link")
    return _constants(materials)[number]


def material_at(points: NDArray, materials: Sequence[Material]) -> NDArray:
    """Evaluate the material at points of a link.

    Args:
        points: (n, 3) [m] points.
        materials: materials; the first fills the link, later ones fill their regions.

    Returns:
        (n, 3) lambda [Pa], mu [Pa] and density [kg/m^3].
    """
    return _constants(materials)[region_of_places(points, regions_of(materials), None)]


def _constants(materials: Sequence[Material]) -> NDArray:
    """Return the (m, 3) lambda [Pa], mu [Pa] and density [kg/m^3] of materials."""
    return np.array([(*lame(m.E, m.nu), m.density) for m in materials])


def regions_of(materials: Sequence[Material]) -> tuple[Region, ...]:
    """Return the regions of all materials except the first.

    Args:
        materials: materials; the first fills the link, later ones fill their regions.

    Returns:
        The regions, of which later ones apply where they overlap.
    """
    return tuple(
        Region(material.where or _everywhere, material.faces)
        for material in materials[1:]
    )


def _everywhere(points: NDArray) -> NDArray:
    return np.ones(len(points), dtype=bool)


def check_materials(materials: Sequence[Material]) -> None:
    """Check that a link has a material.

    Args:
        materials: materials of the link.

    Raises:
        BadInput: the list is empty.
    """
    if not materials:
        raise BadInput("materials: found none, expected at least one")
