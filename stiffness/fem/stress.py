"""Stresses in a meshed link under a tip wrench.

The stresses are linear combinations of those due to six unit wrenches. At the edge of a
rigid interface, the elastic stress is infinite, so the largest stress on a mesh has no
physical meaning. Stresses are therefore evaluated only beyond a certain distance from
the interfaces. The default distance is the radius of the interface.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.table import BadInput
from forcefit.results.display import html_table, short_repr
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.beam.beam_stress import peak_beam_stress
from forcefit.stiffness.fem.adaptive_step import Level
from forcefit.stiffness.fem.elements import Elements, triangle_areas
from forcefit.stiffness.fem.fea import MeshedLink
from forcefit.stiffness.fem.own_weight import with_own_weight
from forcefit.stiffness.fem.stress_error import (
    ZONE,
    element_stresses,
    estimated_error,
    nodes_by_material,
    off_shapes,
    on_facets,
    on_inner_edges,
    von_mises,
)
from forcefit.stiffness.link import inverted

_CHUNK = 4096  # number of elements in a batch, whose stresses occupy 24 MB


@dataclass(frozen=True, eq=False)
class StressSource:
    """Solved mesh from which stresses were computed.

    Attributes:
        level: solved mesh. Its nodes are numbered by
            :func:`forcefit.stiffness.fem.stress_error.nodes_by_material`.
        far: (n,) bool, True for nodes beyond the excluded distance from the interfaces.
        singular: (n,) bool, True for nodes on re-entrant edges without a fillet.
        faceted: (n,) bool, True for nodes on surfaces whose shape was not recognised.
        left_out: (n,) bool, True for nodes that are excluded because the mesh deviates
            from the surface there.
    """

    level: Level
    far: NDArray
    singular: NDArray
    faceted: NDArray
    left_out: NDArray


@dataclass(frozen=True, eq=False)
class StressInfluence:
    """Nodal stresses due to unit tip wrenches, at a distance from the interfaces.

    Attributes:
        places: (p, 3) [m] positions of the nodes, in the link's axes.
        influence: (p, 6, 6) [Pa/(N m), Pa/N] stresses xx yy zz yz xz xy due to unit
            wrenches at the tip. With own weight, the shape is (p, 9, 6), and the last
            three rows are the stresses due to unit gravity along x, y and z
            [Pa per m/s^2].
        away: [m] smallest distance of the nodes from an interface.
        reentrant_edges: True if some nodes are on re-entrant edges without a fillet,
            where the elastic stress is infinite.
        source: solved mesh, from which errors are estimated; None if it is unknown.
    """

    places: NDArray
    influence: NDArray
    away: float
    reentrant_edges: bool = False
    source: StressSource | None = None

    __repr__, _repr_html_ = short_repr, html_table

    @property
    def region(self) -> str:
        """Description of the region in which stresses were evaluated."""
        words = (
            f"{len(self.places)} nodes at least {self.away:.4g} m away from both "
            "interfaces, whose clamped edges are singular"
        )
        if self.reentrant_edges:
            words += (
                "; some of these nodes are on inner edges without a fillet or between "
                "two materials, where the elastic stress is infinite"
            )
        if self.source is not None and self.source.left_out.any():
            words += (
                f"; {self.source.left_out.sum()} nodes are omitted because the mesh "
                "does not follow the part's surface there"
            )
        return words

    def stresses(self, wrench: ArrayLike) -> NDArray:
        """Compute the stresses due to a tip wrench.

        Args:
            wrench: (6,) [N m, N] wrench at the tip, in the axes of the link.

        Returns:
            (p, 6) [Pa] stresses xx yy zz yz xz xy at the nodes.
        """
        return np.einsum("pws,w->ps", self.influence, np.asarray(wrench, dtype=float))

    def peak(self, wrench: ArrayLike) -> tuple[float, NDArray]:
        """Find the largest von Mises stress due to a tip wrench and its position.

        Args:
            wrench: (6,) [N m, N] wrench at the tip, in the axes of the link.

        Returns:
            Largest stress [Pa], and its position, (3,) [m].
        """
        values = von_mises(self.stresses(wrench))
        worst = int(np.argmax(values))
        return float(values[worst]), self.places[worst]

    def peak_error(self, wrench: ArrayLike) -> float:
        """Estimate the error of the peak stress due to a tip wrench.

        Args:
            wrench: (6,) [N m, N] wrench at the tip, in the axes of the link.

        Returns:
            [Pa] error, which is infinite at a singularity, and NaN if the mesh is
            unknown.
        """
        if self.source is None:
            return float("nan")
        values, far = von_mises(self.stresses(wrench)), self.source.far
        worst = int(np.argmax(values))
        node = int(np.flatnonzero(far)[worst])
        if self.source.singular[node]:
            return float("inf")
        zone = np.zeros(len(far), dtype=bool)
        zone[far] = values >= ZONE * values[worst]
        level = self.source.level
        motion = _motions(level) @ np.asarray(wrench)
        return estimated_error(level, motion, node, zone, self.source.left_out)

    def relative_error(self) -> float:
        """Return the largest relative error of the peaks under unit wrenches."""
        unit = np.eye(6, self.influence.shape[1])
        return max(self.peak_error(w) / self.peak(w)[0] for w in unit)


@dataclass(frozen=True, eq=False)
class PeakStress:
    """Peak von Mises stress in a meshed link under a tip wrench.

    Attributes:
        wrench: (6,) [N m, N] wrench at the tip, in the axes of the link.
        von_mises: [Pa] peak stress.
        error: [Pa] estimated error of the peak stress; infinite at a singularity.
        place: (3,) [m] position of the peak.
        region: description of the region in which the stress was evaluated.
        away: [m] distance of this region from the interfaces.
        beam: peak stress [Pa] and its position, (3,) [m], by beam theory in the same
            region; None without a section.
        beam_whole: [Pa] peak stress by beam theory in the whole beam; NaN without a
            section.
    """

    wrench: NDArray
    von_mises: float
    error: float
    place: NDArray
    region: str
    away: float
    beam: tuple[float, NDArray] | None = None
    beam_whole: float = float("nan")


def peak_stress(
    solved: MeshedLink,
    wrench: ArrayLike,
    *,
    section: Mapping[str, float] | None = None,
    up: ArrayLike | None = None,
    away: float | None = None,
    gravity: ArrayLike | None = None,
) -> PeakStress:
    """Compute the peak stress by finite elements and by beam theory.

    Args:
        solved: result of :func:`forcefit.stiffness.fem.fea.solve_link`.
        wrench: (6,) [N m, N] wrench at the tip, in the axes of the link.
        section: section of a straight beam from base to tip, see
            :func:`forcefit.stiffness.beam.beam_stress.peak_beam_stress`.
        up: (3,) vector in the direction of the section's z axis.
        away: [m] excluded distance from the interfaces. The default is the radius of
            the interface.
        gravity: (3,) [m/s^2] gravity, in the axes of the link, to include its own
            weight.

    Returns:
        The peak stress.

    Raises:
        BadInput: all nodes are within the excluded distance, the section is invalid, or
            gravity is given for a link without a density.
    """
    w = np.asarray(wrench, dtype=float)
    if section is not None:
        # reject an invalid section before the long computation
        peak_beam_stress(section, 0.0, np.zeros(6))
    field, acting = stress_influence(solved, away), w
    if gravity is not None:
        field = stress_influence(with_own_weight(solved), away)
        acting = np.r_[w, np.asarray(gravity, dtype=float)]
    value, place = field.peak(acting)
    error, region = field.peak_error(acting), field.region
    if _peaks_on_facets(field, acting):
        region += (
            "; the peak is on facets of unrecognised shape, which are treated as a "
            "smooth surface"
        )
    if section is None:
        return PeakStress(w, value, error, place, region, field.away)
    base, tip = solved.link.base, solved.link.tip
    R = section_axes(tip - base, up)
    length = float(np.linalg.norm(tip - base))
    in_beam = np.r_[w[:3] @ R, w[3:] @ R]
    weight = np.zeros(3)
    if gravity is not None:
        weight = solved.link.mass * np.asarray(gravity, dtype=float) @ R
    whole, _ = peak_beam_stress(section, length, in_beam, weight)
    near_tip = in_beam.copy()
    near_tip[:3] += np.cross([field.away, 0, 0], in_beam[3:])
    # add the weight of the beam between the tip and the evaluated region
    beyond = weight * field.away / length
    near_tip[:3] += np.cross([field.away / 2, 0, 0], beyond)
    near_tip[3:] += beyond
    rest = length - 2 * field.away
    stress, where = peak_beam_stress(section, rest, near_tip, weight * rest / length)
    where = base + R @ (where + [field.away, 0, 0])
    beam = (float(stress), where)
    return PeakStress(
        wrench=w,
        von_mises=value,
        error=error,
        place=place,
        region=region,
        away=field.away,
        beam=beam,
        beam_whole=float(whole),
    )


def stress_influence(solved: MeshedLink, away: float | None = None) -> StressInfluence:
    """Compute the nodal stresses due to unit tip wrenches.

    Args:
        solved: result of :func:`forcefit.stiffness.fem.fea.solve_link`.
        away: [m] excluded distance from the interfaces. The default is the radius of
            the interface.

    Returns:
        The stresses. A node between two materials has a stress in each material.

    Raises:
        BadInput: all nodes are within the excluded distance.
    """
    from scipy.spatial import cKDTree

    level = solved.level
    mesh, (_, node) = level.mesh, nodes_by_material(level)
    radii = [_interface_radius(mesh, k) for k in (0, 1)]
    distance = max(radii) if away is None else away
    clamped = np.unique(mesh.faces[mesh.patch <= 1])
    gap = cKDTree(mesh.nodes[clamped]).query(mesh.nodes[node])[0]
    far = gap >= distance * (1 - 1e-9)  # a node at this distance is included
    if not far.any():
        raise BadInput(
            f"stress: found no node at a distance of {distance:.4g} m from the "
            f"interfaces; the largest distance is {gap.max():.4g} m; use a smaller "
            "--away"
        )
    off = off_shapes(level)[node]
    left_out = far & off if (far & ~off).any() else np.zeros_like(far)
    far &= ~left_out
    per_screw = _nodal_stresses(level)[far]
    influence = np.einsum("pks,kw->pws", per_screw, _motions(level))
    singular, faceted = on_inner_edges(level)[node], on_facets(level)[node]
    source = StressSource(level, far, singular, faceted, left_out)
    reentrant = bool(source.singular[far].any())
    return StressInfluence(
        mesh.nodes[node[far]], influence, float(distance), reentrant, source
    )


def _peaks_on_facets(field: StressInfluence, wrench: NDArray) -> bool:
    """Return whether the peak is on a surface whose shape was not recognised."""
    if field.source is None:
        return False
    worst = int(np.argmax(von_mises(field.stresses(wrench))))
    return bool(field.source.faceted[field.source.far][worst])


def _motions(level: Level) -> NDArray:
    """Return the coefficients of the displacement fields for unit loads, (k, k)."""
    # the stiffness on this mesh is used, so that the stresses balance the wrench
    motions = np.eye(level.solution.fields.shape[2])
    motions[:6, :6] = inverted(level.solution.stiffness)
    return motions


def _interface_radius(mesh: Elements, patch: int) -> float:
    """Return the largest distance of interface nodes from their centroid [m]."""
    faces = mesh.faces[mesh.patch == patch]
    N, area = triangle_areas(mesh, faces)
    first = np.einsum("tq,qa,tax->x", area, N, mesh.nodes[faces])
    points = mesh.nodes[np.unique(faces)]
    return float(np.linalg.norm(points - first / area.sum(), axis=1).max())


def _nodal_stresses(level: Level) -> NDArray:
    """Average the stresses in elements at each node, (n, k, 6)."""
    cells, nodes = nodes_by_material(level)
    screws = np.eye(level.solution.fields.shape[2])
    total = np.zeros((len(nodes), len(screws), 6))
    count = np.bincount(cells.ravel(), minlength=len(nodes))
    for first in range(0, len(cells), _CHUNK):
        some = np.arange(first, min(first + _CHUNK, len(cells)))
        stress = element_stresses(level, some, screws)
        np.add.at(total, cells[some], stress)
    return total / np.maximum(count, 1)[:, None, None]
