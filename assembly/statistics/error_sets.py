"""Convex sets (zones) of all errors and clearances at a posture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from forcefit.assembly.callouts.largest_product import product_by_bounds
from forcefit.assembly.callouts.zone import Zone
from forcefit.assembly.kinematics.placed_callout import PlacedCallout
from forcefit.assembly.kinematics.ranks import RANK
from forcefit.assembly.linear.reference.reduction import complement
from forcefit.assembly.model.contact_closures import contact_closures
from forcefit.assembly.model.error_distributions import KINDS, ErrorSources
from forcefit.assembly.model.joint_names import clearance_name
from forcefit.assembly.statistics.callout_sources import CalloutSources, Sources
from forcefit.assembly.statistics.linear_response import LinearResponse
from forcefit.inputs.table import BadInput

_ROUNDING = 1e-9  # relative threshold for singular values


@dataclass(frozen=True, eq=False)
class ErrorSets:
    """Zones of errors and clearances, whose coordinates form one vector z.

    Attributes:
        names: names of the zones.
        zones: the zones, each in unit coordinates.
        columns: for each zone, the indices of its coordinates in z.
        screws: (6, total) [rad, m] derivative of the platform screw with respect to z.
        rigid_rows: (p, total) matrix whose product with z must be zero if the bodies
            are rigid.
        spring_rows: (r, total) matrix whose product with z is the deformation of
            springs.
        clearances: number of coordinates of z that are clearances.
        contact_rows: (q, total) matrix whose product with z must be zero because a
            joint has several contacts.
    """

    names: tuple[str, ...]
    zones: tuple[Zone, ...]
    columns: tuple[NDArray, ...]
    screws: NDArray
    rigid_rows: NDArray
    spring_rows: NDArray
    clearances: int
    contact_rows: NDArray

    def weights_on_zones(self, along: NDArray) -> NDArray:
        """Return weights that account for joints with several contacts.

        Args:
            along: (total,) weights of the coordinates.

        Returns:
            Equivalent weights, (total,). The sum of the zones' support functions for
            them is the maximum of ``along.z`` over all contact positions.
        """
        rows = self.contact_rows
        own = rows.any(axis=0)
        size = np.abs(along[own]).max(initial=0.0)
        if size == 0.0:
            return along
        D, w, count = rows[:, own].T, along[own] / size, int(own.sum())
        slack = -np.eye(count)
        least = linprog(
            np.concatenate([np.zeros(len(rows)), np.ones(count)]),
            np.block([[-D, slack], [D, slack]]), np.concatenate([-w, w]),
            bounds=[(None, None)] * len(rows) + [(0.0, None)] * count,
        )  # fmt: skip
        balanced = along.copy()
        balanced[own] -= size * D @ least.x[: len(rows)]
        return balanced


def error_sets(prepared: LinearResponse, sources: Sources) -> ErrorSets:
    """Collect the zones of all errors and clearances.

    Args:
        prepared: a posture without loads.
        sources: the errors, with their distributions.

    Returns:
        The zones.

    Raises:
        BadInput: an independent error is unbounded or not symmetric about zero.
    """
    own = zones_of_errors(sources)
    names, zones = [name for name, _, _ in own], [zone for _, zone, _ in own]
    n, nu = len(prepared.posture.robot.frames), int(prepared.starts[-1])
    maps = np.eye(6 * n)[:, :0]
    if len(sources):
        maps = _maps(sources).reshape(6 * n, -1) * np.concatenate([
            unit for _, _, unit in own
        ])
    cones = prepared.joints.cones
    for first, last in zip(prepared.starts[:-1], prepared.starts[1:], strict=True):
        names.append(_cone_name(prepared, cones[:, first]))
        zones.append(Zone((np.eye(6)[: last - first],)))
    sizes = [sum(zone.dimensions) for zone in zones]
    both = np.hstack([maps, cones])
    to_platform = np.hstack([prepared.screws[:, nu:] @ maps, prepared.screws[:, :nu]])
    return ErrorSets(
        tuple(names), tuple(zones),
        tuple(np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])),
        to_platform, _real_rows(prepared.infeasible, both),
        _real_rows(prepared.misfit, both), nu, _contact_rows(prepared, both),
    )  # fmt: skip


def parts_of(sets: ErrorSets, along: NDArray) -> list[float]:
    """Return each zone's contribution to the maximum of ``along.z`` with open loops.

    Args:
        sets: zones of errors and clearances.
        along: (total,) weights of the coordinates.

    Returns:
        One contribution per zone. Their sum is the maximum.
    """
    weights = sets.weights_on_zones(along)
    pairs = zip(sets.zones, sets.columns, strict=True)
    return [zone.farthest_u(weights[columns])[1] for zone, columns in pairs]


def rigid_parts(sets: ErrorSets, along: NDArray) -> list[float]:
    """Return each zone's contribution to the maximum of ``along.z`` with closed loops.

    Args:
        sets: zones of errors and clearances.
        along: (total,) weights of the coordinates.

    Returns:
        One contribution per zone: the derivative of the maximum with respect to the
        logarithm of the zone's size. By Euler's theorem, their sum is the maximum.
    """
    N, bounds, cones = bounds_where_closed(sets, sets.rigid_rows)
    _, _, sizes = product_by_bounds(along @ N, bounds, cones)
    counts = [len(zone.bounds_on_u) for zone in sets.zones]
    cone_counts = [len(zone.cones_on_u) for zone in sets.zones]
    by_zone = np.repeat(np.arange(len(counts)), counts).tolist()
    by_zone += np.repeat(np.arange(len(counts)), cone_counts).tolist()
    found = np.bincount(by_zone, weights=sizes, minlength=len(counts))
    return [float(part) for part in found]


def bounds_where_closed(
    sets: ErrorSets, rows: NDArray
) -> tuple[NDArray, list[NDArray], list[NDArray]]:
    """Return the bounds of all zones in the null space of a matrix.

    Args:
        sets: zones of errors and clearances.
        rows: (k, total) matrix whose product with z must be zero.

    Returns:
        Orthonormal basis of the null space, (total, m), and the bounds as one matrix
        (., m) for each ball and each double cone.
    """
    N = np.linalg.svd(rows)[2][len(rows) :].T
    own = list(zip(sets.zones, sets.columns, strict=True))
    bounds = [b @ N[columns] for zone, columns in own for b in zone.bounds_on_u]
    cones = [c @ N[columns] for zone, columns in own for c in zone.cones_on_u]
    return N, bounds, cones


def _contact_rows(prepared: LinearResponse, columns: NDArray) -> NDArray:
    """Return the closure equations between the contacts of the same joint."""
    found = [np.zeros((0, columns.shape[1]))]
    for k in np.flatnonzero(contact_closures(prepared.posture.robot)).tolist():
        closure = prepared.closures[6 * k : 6 * k + 6]
        held = complement(closure @ prepared.joints.free, RANK)
        found.append(_real_rows(held.T @ closure, columns))
    return np.vstack(found)


def _real_rows(rows: NDArray, columns: NDArray) -> NDArray:
    """Return an orthonormal basis of the row space of a matrix product."""
    product = rows @ columns
    scale = np.abs(rows).max(initial=0.0) * np.linalg.norm(columns)
    _, sizes, vt = np.linalg.svd(product, full_matrices=False)
    return np.asarray(vt[: len(sizes)][sizes > _ROUNDING * max(scale, 1e-300)])


def _maps(sources: Sources) -> NDArray:
    """Return the geometric errors of all frames per unit of each source, (n, 6, m)."""
    if isinstance(sources, CalloutSources):
        return sources.maps
    return np.moveaxis(sources.errors(np.eye(len(sources))), 0, -1)


def zones_of_errors(sources: Sources) -> list[tuple[str, Zone, NDArray]]:
    """Return the name, the zone and the scale [rad, m or 1] of every error."""
    placed: tuple[PlacedCallout, ...] = ()
    if isinstance(sources, CalloutSources):
        independent, placed = sources.independent, sources.placed
        fixed = sources.fixed
    else:
        independent, fixed = sources, sources.fixed
    if fixed is not None and fixed.any():
        raise BadInput(
            "worst case: found constant errors, due to effects or loops that do not "
            "close in the home pose; expected random errors only"
        )
    found = [] if independent is None else _intervals(independent)
    return found + [(p.name, p.zone, np.ones(sum(p.zone.dimensions))) for p in placed]


def _intervals(sources: ErrorSources) -> list[tuple[str, Zone, NDArray]]:
    """Return the intervals of independent errors, relative to their half widths."""
    pairs = zip(sources.labels, _half_widths(sources), strict=True)
    return [(name, Zone((np.eye(6)[:1],)), np.array([width])) for name, width in pairs]


def _half_widths(sources: ErrorSources) -> NDArray:
    """Return the half widths of independent errors, (m,) [rad or m]."""
    uniform = sources.kind == KINDS.index("uniform")
    bounded = uniform | (sources.kind == KINDS.index("truncated"))
    centred = (sources.centre == 0) & sources.signed
    if not (bounded & centred).all():
        name = sources.labels[int(np.argmin(bounded & centred))]
        raise BadInput(
            f"worst case: found {name}, which is unbounded or not symmetric about "
            "zero; expected a uniform or truncated distribution"
        )
    return np.asarray(sources.scale * np.where(uniform, 1.0, sources.limit))


def _cone_name(prepared: LinearResponse, column: NDArray) -> str:
    """Return the name of a clearance, such as "tilt clearance of hinge"."""
    row = int(np.flatnonzero(column)[0])
    kind = ("tilt", "tilt", "spin", "radial", "radial", "axial")[row % 6]
    name = clearance_name(prepared.posture.robot, row // 6, kind)
    joint, _, bound = name.rpartition(".")
    return f"{'' if bound == 'clearance' else f'{bound} '}clearance of {joint}"
