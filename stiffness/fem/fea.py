"""Stiffness of a link by finite elements, with an error estimate.

The link is given by its surface and meshed into tetrahedra. The elements that
contribute most to the error are refined until the required accuracy is reached or the
budget is exhausted (:mod:`forcefit.stiffness.fem.adaptive_step`).
"""

import logging
import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.renamed import warn_renamed
from forcefit.inputs.table import BadInput, describe, nearest
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.fem.adaptive_step import (
    Level,
    estimated_error,
    middle_stiffness,
    refine_level,
    solve_level,
)
from forcefit.stiffness.fem.condensation import KINDS
from forcefit.stiffness.fem.mass_properties import PointMass, mass_properties
from forcefit.stiffness.fem.material import Material, check_materials, regions_of
from forcefit.stiffness.fem.material_of_solids import placed_materials
from forcefit.stiffness.fem.quality import mesh_report
from forcefit.stiffness.fem.sparse_solver import expected_cost, solver_name
from forcefit.stiffness.link import LinkStiffness, inverted, scaled
from forcefit.stiffness.mesh.fit_to_patches import MeshFailed
from forcefit.stiffness.mesh.mesh import mesh_solid
from forcefit.stiffness.mesh.regions import cut_by_regions
from forcefit.stiffness.mesh.slender_bar import slender_bar
from forcefit.stiffness.mesh.solid import Solid
from forcefit.stiffness.mesh.straight_bar import straight_bar
from forcefit.stiffness.surface.interface import Interface, parse_interface
from forcefit.stiffness.surface.patches import (
    find_patches,
    refuse_common_edges,
    triangles_on,
)
from forcefit.stiffness.surface.surface import Surface, read_surface

P = ParamSpec("P")
R = TypeVar("R")
_LOG = logging.getLogger("forcefit.finite_elements")
_SETUP = 2.0  # [s] solution time that does not depend on the mesh
# fraction of the time limit that is available for the mesher
_MESHER = 0.6


@dataclass(frozen=True)
class Budget:
    """Limits on the time and memory of a computation.

    Attributes:
        seconds: [s] time after which no finer mesh is started.
        unknowns: [-] largest number of unknowns.
        levels: [-] largest number of meshes, including the first mesh.
    """

    seconds: float = 300.0
    unknowns: int = 1_000_000
    levels: int = 12


@dataclass(frozen=True)
class FemOptions:
    """Options of the finite element solution.

    Attributes:
        accuracy: [-] largest accepted error of an entry K_ij, divided by sqrt(K_ii
            K_jj).
        interface: kind of the interfaces: ``"rigid"``, ``"distributing"`` or
            ``"distributing-both"``, see :mod:`forcefit.stiffness.fem.condensation`.
        budget: limits on time and memory.
        cache: folder in which meshes are stored. The default is the user's cache
            folder.
    """

    accuracy: float = 0.005
    interface: str = "rigid"
    budget: Budget = field(default_factory=Budget)
    cache: Path | str | None = None

    def __post_init__(self) -> None:
        if self.interface not in KINDS:
            given = describe(self.interface)
            hint = nearest(str(self.interface), KINDS)
            raise BadInput(f"interface: found {given}{hint}")
        if not 1e-5 <= self.accuracy <= 0.5:
            raise BadInput(
                f"accuracy = {self.accuracy:g} must lie between 1e-05 and 0.5"
            )


_STANDARD = FemOptions()


@dataclass(frozen=True, eq=False)
class MeshedLink:
    """A link and its solution on the finest mesh.

    Attributes:
        link: stiffness of the link, with its error and the mass properties.
        level: finest mesh with its solution and materials.
        centers: (2, 3) [m] centres of the base and the tip interface.
    """

    link: LinkStiffness
    level: Level
    centers: NDArray

    __repr__, _repr_html_ = short_repr, html_table


def _accepting_material(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function accept the material arguments of the last release."""

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        material = args[3] if len(args) > 3 else kwargs.pop("material", None)
        if isinstance(material, Material):
            warn_renamed("mesh_link(material)", "mesh_link(E, nu, density)")
            for name in ("E", "nu", "density"):
                kwargs[name] = getattr(material, name)
            args = args[:3]  # type: ignore[assignment]
        return function(*args, **kwargs)

    return call


@_accepting_material
def mesh_link(
    surface: Path | str,
    base: Interface | str,
    tip: Interface | str,
    *,
    E: float,
    nu: float,
    density: float = 0.0,
    unit: str = "m",
    options: FemOptions = _STANDARD,
) -> LinkStiffness:
    """Compute the stiffness of a link of one material from a surface file.

    Args:
        surface: file with the closed surface of the link (STL, OBJ, PLY, VTK, MSH,
            STEP).
        base: clamped interface, or a text such as ``"z=0"`` [m], see
            :func:`forcefit.stiffness.surface.interface.parse_interface`.
        tip: loaded interface, given like ``base``.
        E: [Pa] Young's modulus, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5).
        density: [kg/m^3] density; 0 for a link without mass.
        unit: unit of length in the surface file.
        options: options of the solution.

    Returns:
        The stiffness at the centre of the tip, in the axes of the surface. The entry
        ``reached`` of its ``mesh`` is True if the required accuracy was reached.

    Raises:
        BadInput: the file, an interface or a material constant is invalid.

    Sources:
        Rivara (1984) for the bisection of elements.
    """
    material = Material(E, nu, density)
    shape = read_surface(Path(surface), unit)
    held, moved = (
        parse_interface(side, name) if isinstance(side, str) else side
        for side, name in ((base, "base"), (tip, "tip"))
    )
    return solve_link(shape, held, moved, (material,), options=options).link


def solve_link(
    surface: Surface,
    base: Interface,
    tip: Interface,
    materials: Sequence[Material],
    *,
    options: FemOptions = _STANDARD,
    point_masses: Sequence[PointMass] = (),
) -> MeshedLink:
    """Compute the stiffness of a link with a required accuracy.

    Args:
        surface: surface of the link.
        base: clamped interface.
        tip: loaded interface.
        materials: materials of the link. The first material is used outside the regions
            of the other materials. In a STEP file, each solid may instead have its own
            material.
        options: options of the solution.
        point_masses: point masses, which affect the mass properties but not the
            stiffness.

    Returns:
        The link and its solution on the finest mesh.

    Raises:
        BadInput: an interface is invalid, the interfaces share an edge, no material is
            given, or a solid does not exist.
    """
    start, busy = time.monotonic(), _processor_seconds()
    check_materials(materials)
    materials = placed_materials(surface, materials)
    if options.interface == "rigid":
        refuse_common_edges(surface, base, tip)
    centers = np.array([
        interface_center(surface, side, name)
        for side, name in ((base, "base"), (tip, "tip"))
    ])
    first = first_mesh(surface, base, tip, options.budget, options.cache)
    first = cut_by_regions(first, regions_of(materials))
    pace = _pace_so_far(time.monotonic() - start, _processor_seconds() - busy)
    level, K, error, report = _refined(first, materials, centers, options, start, pace)
    report |= {
        "surface_volume": surface.volume,
        "surface_area": surface.area,
        "repairs": list(surface.repairs),
    }
    return _meshed(level, centers, K, error, report, options, point_masses)


def solve_bar(
    section: Mapping[str, float], material: Material, options: FemOptions = _STANDARD
) -> MeshedLink:
    """Compute the stiffness of a bar of unit length along z.

    Args:
        section: dimensions of the section divided by the length of the bar, see
            :func:`forcefit.stiffness.mesh.straight_bar.straight_bar`.
        material: material of the bar.
        options: options of the solution.

    Returns:
        The bar and its solution on the finest mesh. The base is at z = 0, and the tip
        at z = 1. The section's y and z axes are along x and y.
    """
    centers = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    first, start = straight_bar(section), time.monotonic()
    level, K, error, report = _refined(first, (material,), centers, options, start)
    return _meshed(level, centers, K, error, report, options, ())


def _refined(
    first: Solid,
    materials: Sequence[Material],
    centers: NDArray,
    options: FemOptions,
    start: float,
    pace: float = 1.0,
) -> tuple[Level, NDArray, NDArray, dict[str, Any]]:
    """Refine the mesh until the accuracy or a limit of the budget is reached.

    Args:
        first: first mesh.
        materials: materials of the link. The first material is used outside the regions
            of the other materials.
        centers: (2, 3) [m] centres of the base and the tip interface.
        options: options of the solution.
        start: [s] time at which the computation started.
        pace: [-] ratio of the current solution time to that on an idle machine.

    Returns:
        Solution on the finest mesh; stiffness, (6, 6); magnitude of its error, (6, 6);
        and data on the computing time.
    """
    accuracy, interface, budget = options.accuracy, options.interface, options.budget
    begun = time.monotonic()

    def affordable(unknowns: int) -> None:
        _refuse_cost(unknowns, budget, begun - start, pace)

    level = solve_level(first, materials, centers, interface, affordable)
    history, sizes = [level.totals()], [len(level.solid.cells)]
    while True:
        E, factor = estimated_error(history)
        K, error = middle_stiffness(history[-1][0], E, history[-1][2])
        # a relative error of the volume can cause the same relative error of K
        error = error + level.volume_error * np.diag(np.diag(K))
        worst = float(np.abs(scaled(error, K)).max())
        _LOG.info("%d unknowns, error %.2g", level.solution.unknowns, worst)
        if worst <= accuracy or len(history) == budget.levels:
            break
        if level.volume_error > max(accuracy, 0.7 * worst):
            break  # the facets of the surface limit the accuracy
        growth = _wanted_growth(history, sizes, worst / accuracy)
        pace = _pace(level.solution.unknowns, time.monotonic() - begun)
        solid = _affordable_mesh(level, growth, budget, start, pace)
        if solid is None:
            break
        begun = time.monotonic()
        level = solve_level(solid, materials, centers, interface)
        history.append(level.totals())
        sizes.append(len(level.solid.cells))
    report = mesh_report(level.solid, level.mesh) | {
        "unknowns": level.solution.unknowns,
        "meshes": len(history),
        "solver": solver_name(),
        "seconds": time.monotonic() - start,
        "accuracy": accuracy,
        "reached": worst <= accuracy,
        "estimate_over_indicator": factor,
    }
    return level, K, error, report


def interface_center(surface: Surface, interface: Interface, name: str) -> NDArray:
    """Return the reference point of an interface.

    Args:
        surface: surface of the link.
        interface: the interface.
        name: ``"base"`` or ``"tip"``, for error messages.

    Returns:
        (3,) [m] given point of a disc or a bore, or centroid of a planar interface.

    Raises:
        BadInput: no part of the surface is on the interface.
    """
    members = triangles_on(surface, interface, name)
    if interface.kind != "plane":
        return np.array(interface.point)
    areas = np.linalg.norm(surface.normals()[members], axis=1)
    corners = surface.points[surface.triangles[members]]
    center = np.average(corners.mean(axis=1), axis=0, weights=areas)
    # coordinates in STL files are rounded, so the centre is moved onto the plane
    height = (center - interface.point) @ interface.direction
    center = center - height * interface.direction
    return np.where(np.abs(center) < 1e-12 * surface.diagonal, 0.0, center)


def first_mesh(
    surface: Surface,
    base: Interface,
    tip: Interface,
    budget: Budget,
    cache: Path | str | None = None,
) -> Solid:
    """Create a coarse mesh that follows the surface of the part.

    Args:
        surface: surface of the link.
        base: clamped interface.
        tip: loaded interface.
        budget: limits on time and memory.
        cache: folder in which meshes are stored. The default is the user's cache
            folder.

    Returns:
        The mesh.

    Raises:
        BadInput: no part of the surface is on an interface.
        MeshFailed: three attempts did not result in a usable mesh, or the time limit
            was exceeded.
    """
    wall = 2 * surface.volume / surface.area / surface.diagonal
    envelope, edge = min(2e-3, wall / 8), 0.1 * surface.diagonal

    start = time.monotonic()
    if (bar := slender_bar(surface, base, tip)) is not None:
        return bar
    patches = find_patches(surface, base, tip)  # takes 3 s for a part with 70 patches

    def mesh(share: float) -> Solid:
        left = budget.seconds - (time.monotonic() - start)
        return mesh_solid(
            surface,
            base,
            tip,
            edge=share * edge,
            envelope=share * envelope,
            time_limit=max(_MESHER * left, 1e-3),
            cache=cache,
            patches=patches,
        )

    for share in (1.0, 0.5):
        try:
            return mesh(share)
        except MeshFailed as error:
            if time.monotonic() - start > _MESHER * budget.seconds:
                raise
            _LOG.info("a finer mesh is tried: %s", error)
    return mesh(0.2)


def _pace(unknowns: int, seconds: float) -> float:
    """Return the ratio of actual to expected solution time, at least 1."""
    return max(1.0, (seconds - _SETUP) / expected_cost(unknowns)[1])


def _processor_seconds() -> float:
    """Return the processor time of this process and its finished children [s]."""
    return sum(os.times()[:4])


def _pace_so_far(elapsed: float, busy: float) -> float:
    """Return the ratio of elapsed time to processor time, at least 1."""
    # short times are unreliable, and the time of the mesher is unknown on Windows
    if elapsed < _SETUP or os.name == "nt":
        return 1.0
    return max(1.0, elapsed / max(busy, 0.1 * elapsed))


def _refuse_cost(
    unknowns: int, budget: Budget, spent: float, pace: float = 1.0
) -> None:
    """Reject a first mesh whose solution would exceed the budget."""
    memory, seconds = expected_cost(unknowns)
    seconds *= pace
    if unknowns > budget.unknowns or spent + seconds > budget.seconds:
        raise MeshFailed(
            f"the coarsest mesh of the part has {unknowns} unknowns. The solution "
            f"needs about {seconds:.0f} s and {memory / 1e9:.1f} GB after {spent:.0f} "
            f"s of meshing, expected at most {budget.unknowns} unknowns and "
            f"{budget.seconds:g} s; increase the time limit, or remove small details "
            "of the part"
        )


def _wanted_growth(
    history: Sequence[tuple[NDArray, ...]], sizes: Sequence[int], excess: float
) -> float:
    """Return the factor on the element number that divides the error by ``excess``."""
    rate = 1.3  # convergence rate with respect to the number of elements
    if len(history) > 1:
        before, now = (np.max(np.diag(e) / np.diag(K)) for K, e, _ in history[-2:])
        measured = math.log(max(before / now, 1.0)) / math.log(sizes[-1] / sizes[-2])
        rate = min(max(measured, 1.0), 2.0)  # the rate is higher for coarse meshes
    return float(np.clip((1.12 * excess) ** (1 / rate), 1.2, 6.0))


def _affordable_mesh(
    level: Level, growth: float, budget: Budget, start: float, pace: float = 1.0
) -> Solid | None:
    """Refine the mesh as far as the accuracy requires and the budget permits."""
    part = growth**0.55 - 1  # fraction of elements to bisect, without neighbours
    solid = refine_level(level, 1 + part)
    added = len(solid.cells) / len(level.solid.cells) - 1
    if not 0.85 < added / (growth - 1) < 1.08:
        part *= (growth - 1) / added
        solid = refine_level(level, 1 + part)
    for share in (1.0, 0.7, 0.4, 0.1):
        solid = solid if share == 1 else refine_level(level, 1 + share * part)
        each = level.solution.unknowns / len(level.solid.cells)
        unknowns = int(each * len(solid.cells))
        memory, seconds = expected_cost(unknowns)
        seconds, spent = pace * seconds, time.monotonic() - start
        _LOG.info(
            "next: about %d unknowns, %.1f GB, %.0f s", unknowns, memory / 1e9, seconds
        )
        if unknowns <= budget.unknowns and spent + seconds <= budget.seconds:
            return solid
    return None


def _meshed(
    level: Level,
    centers: NDArray,
    K: NDArray,
    error: NDArray,
    report: Mapping[str, Any],
    options: FemOptions,
    point_masses: Sequence[PointMass],
) -> MeshedLink:
    """Create the link from the results on its finest mesh."""
    density = level.material[:, 2]
    mass, center, inertia = mass_properties(level.mesh, density, point_masses)
    link = LinkStiffness(
        method=f"finite elements, {options.interface} interfaces",
        compliance=inverted(K),
        tip=centers[1],
        base=centers[0],
        stiffness_error=error,
        mesh=report,
        mass=mass,
        center_of_mass=center,
        inertia=inertia,
    )
    return MeshedLink(link, level, centers)
