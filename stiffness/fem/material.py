"""Materials of a link and their regions."""

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
    """An isotropic material and its region in a link.

    Attributes:
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.
        density: [kg/m^3] density; 0 for a link without mass.
        where: function of points, (n, 3) [m], that returns True for points in the
            region of this material. In an overlap of regions, the last material is
            used.
        faces: faces of the region, at which elements are split.
        solid: name of the solid in a STEP file that consists of this material, or
            ``one+other`` for two solids. It is used in place of ``where`` and
            ``faces``.
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
        mesh: the elements.
        materials: materials of the link. The first material is used outside the regions
            of the other materials.
        cut_region: (t,) number of the region of each element, for regions at whose
            faces elements were split; None if no elements were split.

    Returns:
        (t, 3) lambda [Pa], mu [Pa] and density [kg/m^3] of each element.

    Raises:
        BadInput: no material is given, or the first material is limited to a region.
    """
    check_materials(materials)
    centers = mesh.nodes[mesh.cells[:, :4]].mean(axis=1)
    first = materials[0].where
    number = region_of_places(centers, regions_of(materials), cut_region)
    if first is not None and not first(centers[number == 0]).all():
        raise BadInput(
            "materials: the first material has a region, expected a material of the "
            "whole link"
        )
    return _constants(materials)[number]


def material_at(points: NDArray, materials: Sequence[Material]) -> NDArray:
    """Evaluate the material at points in a link.

    Args:
        points: (n, 3) [m] points.
        materials: materials of the link. The first material is used outside the regions
            of the other materials.

    Returns:
        (n, 3) lambda [Pa], mu [Pa] and density [kg/m^3] at each point.
    """
    return _constants(materials)[region_of_places(points, regions_of(materials), None)]


def _constants(materials: Sequence[Material]) -> NDArray:
    """Return lambda [Pa], mu [Pa] and density [kg/m^3] of each material, (m, 3)."""
    return np.array([(*lame(m.E, m.nu), m.density) for m in materials])


def regions_of(materials: Sequence[Material]) -> tuple[Region, ...]:
    """Return the regions of all materials after the first.

    Args:
        materials: materials of the link. The first material is used outside the regions
            of the other materials.

    Returns:
        The regions. In an overlap, the last region is used.
    """
    return tuple(
        Region(material.where or _everywhere, material.faces)
        for material in materials[1:]
    )


def _everywhere(points: NDArray) -> NDArray:
    return np.ones(len(points), dtype=bool)


def check_materials(materials: Sequence[Material]) -> None:
    """Check that there is at least one material.

    Args:
        materials: materials of the link.

    Raises:
        BadInput: the list is empty.
    """
    if not materials:
        raise BadInput("materials: found none, expected at least one")
