"""A link's stiffness from its surface, by finite elements, with its error.

The surface becomes tetrahedra, the tetrahedra a stiffness and an estimate of its error
(:mod:`stiffness.estimate`); elements that contribute most are refined until the asked
accuracy is reached or the budget is used.  What the elements indicate is scaled by what
the last refinement did to the stiffness, compared with what it did to the indication.
"""

import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stiffness.beam import check_material
from stiffness.body import PointMass, mass_properties
from stiffness.condense import KINDS, Condensed, condense
from stiffness.curved import without_folds
from stiffness.elements import ORDER, Elements, isoparametric, lame
from stiffness.estimate import error_matrices, shape_errors
from stiffness.interface import Interface
from stiffness.layers import layered, singular_edges, without_chords
from stiffness.link import LinkStiffness, inverted, scaled
from stiffness.mesh import MeshFailed, Solid, mesh_solid
from stiffness.patches import triangles_on
from stiffness.quality import mesh_report
from stiffness.reading import BadInput, describe, nearest
from stiffness.refine import refine
from stiffness.solver import expected_cost, solver_name
from stiffness.surface import Surface, read_surface

_LOG = logging.getLogger(__name__)
_BLIND = 2.3  # on a first mesh; measured 0.5 to 2.2 (one thin plate) on thirteen parts
_SAFETY = 1.3
_ENDS = (0, 1)  # patches of base and tip; where loads are spread, tractions end there


@dataclass(frozen=True, eq=False)
class Material:
    """An isotropic solid, and where in the link it is.

    Attributes:
        E: [Pa] Young's modulus.
        nu: [-] Poisson's ratio.
        density: [kg/m^3], 0 for a link without mass.
        where: tells of points (n, 3) [m], in the mesh's axes, which are of it; the
            last material that claims an element's centre has it.
    """

    E: float
    nu: float
    density: float = 0.0
    where: Callable[[NDArray], NDArray] | None = None

    def __post_init__(self) -> None:
        check_material("material", self.E, self.nu)
        if not (math.isfinite(self.density) and self.density >= 0):
            raise BadInput(f"material: density = {self.density:g} must be >= 0")


@dataclass(frozen=True)
class Budget:
    """What a solution may cost.

    Attributes:
        seconds: [s] after which no finer mesh is begun.
        unknowns: [1] of the largest system; memory grows with it.
        levels: [1] meshes at most, the first included.
    """

    seconds: float = 300.0
    unknowns: int = 1_000_000
    levels: int = 12


@dataclass(frozen=True, eq=False)
class Level:
    """One mesh's answer.

    Attributes:
        solid: straight tetrahedra.
        mesh: cubic elements, parts of the tetrahedra along singular edges.
        material: (t, 3) lambda [Pa], mu [Pa], density [kg/m^3] of each element.
        solution: condensed stiffness and fields.
        errors: (s, 6, 6) each of the solid's tetrahedra's estimated share of K_h - K,
            before it is compared with another mesh's.
        shape_errors: (s, 6, 6) the same for what the elements leave of the shapes.
    """

    solid: Solid
    mesh: Elements
    material: NDArray
    solution: Condensed
    errors: NDArray
    shape_errors: NDArray

    def totals(self) -> tuple[NDArray, NDArray, NDArray]:
        """(6, 6) the stiffness, its indicated error and that of the shapes."""
        return (
            self.solution.stiffness,
            self.errors.sum(axis=0),
            self.shape_errors.sum(axis=0),
        )


@dataclass(frozen=True, eq=False)
class MeshedLink:
    """A link solved on its finest mesh, ready to be asked for more than its stiffness.

    Attributes:
        link: the stiffness, with error, mesh report, mass.
        level: the finest mesh, its fields and materials.
        centers: (2, 3) [m] of the base and the tip interface.
    """

    link: LinkStiffness
    level: Level
    centers: NDArray


def mesh_link(
    surface: Path,
    base: Interface,
    tip: Interface,
    E: float,
    nu: float,
    *,
    unit: str = "m",
    accuracy: float = 0.005,
    interface: str = "rigid",
    density: float = 0.0,
    budget: Budget | None = None,
    cache: Path | None = None,
) -> LinkStiffness:
    """Stiffness of a link of one material, from a surface file.

    Args:
        surface: file of the closed surface (STL, OBJ, PLY, VTK, MSH, STEP).
        base: the held interface, in metres, in the surface's axes.
        tip: the interface that moves.
        E: [Pa] Young's modulus, > 0.
        nu: [-] Poisson's ratio, in (-1, 0.5).
        unit: of the surface file's coordinates.
        accuracy: [1] wanted largest error, entries scaled by sqrt(K_ii K_jj).
        interface: ``"rigid"``, ``"distributing"`` (the tip) or ``"distributing-both"``,
            see :mod:`stiffness.condense`.
        density: [kg/m^3] for mass and inertia; 0 leaves them out.
        budget: what it may cost.
        cache: folder of meshes; the user's cache if absent.

    Returns:
        The stiffness at the tip's centre, in the surface's axes; its ``mesh`` says
        whether the asked accuracy was ``reached``.

    Raises:
        BadInput: the file, an interface, the material or an option is not proper.

    Sources:
        Rivara (1984) for the bisection; :mod:`stiffness.estimate` for the error.
    """
    shape = read_surface(Path(surface), unit)
    material = (Material(E, nu, density),)
    return solve_link(
        shape,
        base,
        tip,
        material,
        accuracy=accuracy,
        interface=interface,
        budget=budget,
        cache=cache,
    ).link


def solve_link(
    surface: Surface,
    base: Interface,
    tip: Interface,
    materials: Sequence[Material],
    *,
    accuracy: float = 0.005,
    interface: str = "rigid",
    point_masses: Sequence[PointMass] = (),
    budget: Budget | None = None,
    cache: Path | None = None,
) -> MeshedLink:
    """Solve a link to an asked accuracy.

    Args:
        surface: of the link.
        base: the held interface.
        tip: the interface that moves.
        materials: the first fills the link, later ones where they say.
        accuracy: [1] wanted largest error, entries scaled by sqrt(K_ii K_jj).
        interface: ``"rigid"``, ``"distributing"`` or ``"distributing-both"``.
        point_masses: added to mass, centre and inertia.
        budget: what it may cost.
        cache: folder of meshes; the user's cache if absent.

    Returns:
        The link and its finest mesh.

    Raises:
        BadInput: an interface or an option is not proper.
    """
    if interface not in KINDS:
        raise BadInput(
            f"interface: found {describe(interface)}{nearest(str(interface), KINDS)}"
        )
    if not 1e-5 <= accuracy <= 0.5:
        raise BadInput(f"accuracy = {accuracy:g} must lie between 1e-05 and 0.5")
    budget = budget or Budget()
    start = time.monotonic()
    centers = np.array([
        interface_center(surface, f, n) for f, n in ((base, "base"), (tip, "tip"))
    ])
    level = solve_level(
        first_mesh(surface, base, tip, budget, cache), materials, centers, interface
    )
    history, sizes = [level.totals()], [len(level.solid.cells)]
    while True:
        error, factor = estimated_error(history)
        worst = float(np.abs(scaled(error, level.solution.stiffness)).max())
        _LOG.info("%d unknowns, error %.2g", level.solution.unknowns, worst)
        if worst <= accuracy or len(history) == budget.levels:
            break
        finer = _affordable_mesh(
            level, _wanted_growth(history, sizes, worst / accuracy), budget, start
        )
        if finer is None:
            break
        level = solve_level(finer, materials, centers, interface)
        history.append(level.totals())
        sizes.append(len(level.solid.cells))
    report = _report(level, surface, len(history), start) | {
        "accuracy": accuracy,
        "reached": worst <= accuracy,
        "estimate_over_indicator": factor,
    }
    method = f"finite elements, {interface} interfaces"
    stiffness = _link(method, level, centers, error, report, point_masses)
    return MeshedLink(stiffness, level, centers)


def interface_center(surface: Surface, interface: Interface, name: str) -> NDArray:
    """Where an interface's screws are read.

    Args:
        surface: of the link.
        interface: on it.
        name: base or tip, for messages.

    Returns:
        (3,) [m] the given point of a disc or a bore, the area's centroid of a plane.

    Raises:
        BadInput: no part of the surface lies on the interface.
    """
    members = triangles_on(surface, interface, name)
    if interface.kind != "plane":
        return np.array(interface.point)
    areas = np.linalg.norm(surface.normals()[members], axis=1)
    corners = surface.points[surface.triangles[members]]
    center = np.average(corners.mean(axis=1), axis=0, weights=areas)
    # single precision of STL: exactly onto the plane that was asked for
    height = (center - interface.point) @ interface.direction
    center = center - height * interface.direction
    return np.where(np.abs(center) < 1e-12 * surface.diagonal, 0.0, center)


def first_mesh(
    surface: Surface,
    base: Interface,
    tip: Interface,
    budget: Budget,
    cache: Path | None = None,
) -> Solid:
    """A coarse mesh to refine from, fine enough for the part's walls.

    Args:
        surface: of the link.
        base: the held interface.
        tip: the interface that moves.
        budget: its seconds limit the mesher.
        cache: folder of meshes; the user's cache if absent.

    Returns:
        The solid.

    Raises:
        MeshFailed: three tries gave nothing usable.
    """
    wall = 2 * surface.volume / surface.area / surface.diagonal
    envelope, edge = min(2e-3, wall / 8), 0.1 * surface.diagonal

    def mesh(share: float) -> Solid:
        return mesh_solid(
            surface,
            base,
            tip,
            edge=share * edge,
            envelope=share * envelope,
            time_limit=budget.seconds,
            cache=cache,
        )

    start = time.monotonic()
    for share in (1.0, 0.5):
        try:
            return mesh(share)
        except MeshFailed as error:
            if time.monotonic() - start > budget.seconds:
                raise
            _LOG.info("a finer mesh is tried: %s", error)
    return mesh(0.2)


def solve_level(
    solid: Solid, materials: Sequence[Material], centers: NDArray, interface: str
) -> Level:
    """Stiffness, fields and error shares of one mesh.

    Args:
        solid: straight tetrahedra; those that would fold when bent, or that touch two
            singular edges, are halved first.
        materials: the first fills the link, later ones where they say.
        centers: (2, 3) [m] of base and tip.
        interface: one of ``KINDS``.

    Returns:
        The answer, on cubic elements with a layer along the singular edges.

    Raises:
        BadInput: no material fills the link.
    """
    solid = without_chords(without_folds(solid, ORDER), _ENDS)
    parts = layered(solid, _ENDS)
    mesh = isoparametric(solid, ORDER, parts)
    material = _material_of_elements(mesh, materials)
    lam, mu = material[:, 0], material[:, 1]
    solution = condense(mesh, lam, mu, centers, interface)
    on_edge = np.zeros(len(mesh.nodes), dtype=bool)
    on_edge[singular_edges(solid, _ENDS)] = True
    singular = on_edge[mesh.cells[:, :4]].any(axis=1)
    each = error_matrices(mesh, solution.fields, lam, mu, singular, solution.stiffness)
    errors, shape = np.zeros((2, len(solid.cells), 6, 6))
    np.add.at(errors, parts.parent, each)
    off = shape_errors(mesh, solid.shapes, solution.fields, lam, mu)
    np.add.at(shape, parts.parent[mesh.owner], off)
    return Level(solid, mesh, material, solution, errors, shape)


def _material_of_elements(mesh: Elements, materials: Sequence[Material]) -> NDArray:
    """(t, 3) lambda, mu and density at the elements' centres."""
    if not materials:
        raise BadInput("materials: at least one is needed")
    centers = mesh.nodes[mesh.cells[:, :4]].mean(axis=1)
    table = np.zeros((len(centers), 3))
    for material in materials:
        lam, mu = lame(material.E, material.nu)
        where = material.where or (lambda points: np.ones(len(points), dtype=bool))
        table[where(centers)] = lam, mu, material.density
    if not (table[:, 1] > 0).all():
        raise BadInput("materials: the first must fill the whole link")
    return table


def estimated_error(
    history: Sequence[tuple[NDArray, NDArray, NDArray]],
) -> tuple[NDArray, float]:
    """Error of the last stiffness: what the elements indicate, scaled.

    Args:
        history: of each mesh, finest last, the totals of its :class:`Level`.

    Returns:
        (6, 6) estimate of the exact stiffness minus the last one, and the factor on
        the indicated error that it uses: what the last refinement did to the stiffness
        over what it did to the indicated error, and some more.
    """
    K, indicated, shape = history[-1]
    factor = _BLIND
    if len(history) > 1:
        coarse, indicated_then, _ = history[-2]
        # the entry that matters: the one with the largest error
        worst = int(np.argmax(np.diag(indicated) / np.diag(K)))
        fell = (indicated_then - indicated)[worst, worst]
        proved = (coarse - K)[worst, worst] / fell if fell > 0 else _BLIND
        factor = float(_SAFETY * np.clip(proved, 1.0, 2 * _BLIND))
    # what leaves the shapes outward and inward may cancel in K, not in the estimate
    return -factor * indicated - np.abs(shape), factor


def _wanted_growth(
    history: Sequence[tuple[NDArray, ...]], sizes: Sequence[int], excess: float
) -> float:
    """How many times the elements would bring the error down by an excess."""
    rate = 1.3  # of the error over the count of elements; 2 were it smooth
    if len(history) > 1:
        then, now = (np.max(np.diag(e) / np.diag(K)) for K, e, _ in history[-2:])
        fell = math.log(max(then / now, 1.0)) / math.log(sizes[-1] / sizes[-2])
        rate = min(max(fell, 1.0), 2.0)  # what was gained on coarse meshes ends
    return float(np.clip((1.12 * excess) ** (1 / rate), 1.2, 6.0))


def _affordable_mesh(
    level: Level, growth: float, budget: Budget, start: float
) -> Solid | None:
    """A finer mesh that the budget allows, of as many times the elements as wanted."""
    part = growth**0.55 - 1  # what neighbours add is about as much again
    solid = _finer(level, 1 + part)
    added = len(solid.cells) / len(level.solid.cells) - 1
    if not 0.85 < added / (growth - 1) < 1.08:
        part *= (growth - 1) / added
        solid = _finer(level, 1 + part)
    for share in (1.0, 0.4, 0.1):
        solid = solid if share == 1 else _finer(level, 1 + share * part)
        each = level.solution.unknowns / len(level.solid.cells)
        unknowns = int(each * len(solid.cells))
        memory, seconds = expected_cost(unknowns)
        spent = time.monotonic() - start
        _LOG.info(
            "next: about %d unknowns, %.1f GB, %.0f s", unknowns, memory / 1e9, seconds
        )
        if unknowns <= budget.unknowns and spent + seconds <= budget.seconds:
            return solid
    return None


def _finer(level: Level, growth: float) -> Solid:
    """Halve the elements with the largest shares of the error.

    Args:
        level: the mesh to refine.
        growth: of the count of elements, before neighbours are halved too (with them
            it is about its square).

    Returns:
        The finer mesh.
    """
    shares = np.einsum(
        "tii,i->t",
        level.errors + np.abs(level.shape_errors),
        1 / np.diag(level.solution.stiffness),
    )
    shares = np.maximum(shares, 1e-12 * shares.max())

    def halvings(limit: float) -> NDArray:
        # an element's share falls with h^4 to h^7: 1.5 halvings for each factor e^..
        return np.clip(np.round(np.log2(shares) / 1.5 - limit), 0, 6).astype(int)

    low, high = -200.0, 200.0
    for _ in range(50):
        middle = (low + high) / 2
        grown = (2.0 ** halvings(middle)).sum()
        low, high = (middle, high) if grown > growth * len(shares) else (low, middle)
    return refine(level.solid, halvings(high)).solid


def _report(
    level: Level, surface: Surface, meshes: int, start: float
) -> dict[str, Any]:
    """The finest mesh, the surface it stands for, and what it took."""
    return mesh_report(level.solid, level.mesh) | {
        "unknowns": level.solution.unknowns,
        "meshes": meshes,
        "surface_volume": surface.volume,
        "surface_area": surface.area,
        "repairs": list(surface.repairs),
        "solver": solver_name(),
        "seconds": time.monotonic() - start,
    }


def _link(
    method: str,
    level: Level,
    centers: NDArray,
    error: NDArray,
    report: dict[str, Any],
    point_masses: Sequence[PointMass],
) -> LinkStiffness:
    """Everything known of the link, as a table."""
    density = level.material[:, 2]
    mass, center, inertia = mass_properties(level.mesh, density, point_masses)
    return LinkStiffness(
        method=method,
        compliance=inverted(level.solution.stiffness),
        tip=centers[1],
        base=centers[0],
        stiffness_error=error,
        mesh=report,
        mass=mass,
        center_of_mass=center,
        inertia=inertia,
    )
