"""Worst pose error over all errors within tolerance and all clearance positions.

For over-constrained robots, there are four definitions of the worst case:

=========== ====================================================================
rigid       over all errors and clearances for which loops close without force
elastic     elastic bodies without clearances: the pose is linear in the errors
equilibrium over all errors and all solutions of problem (22) for these errors
bound       clearances treated as errors: an upper bound on ``equilibrium``
=========== ====================================================================

Without over-constrained loops, all definitions agree. The definitions ``rigid``,
``elastic`` and ``bound`` maximise a sum of support functions over all directions. For
``equilibrium``, a search over corners of the tolerance box gives a lower bound, and
``bound`` gives an upper bound.

Sources:
    Hoffman (1981), see :mod:`forcefit.assembly.solvers.outer_cuts`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.callouts.largest_product import largest_product
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.solvers.outer_cuts import farthest
from forcefit.assembly.statistics.callout_sources import (
    CalloutSources,
    Sources,
    sources_of,
)
from forcefit.assembly.statistics.error_sets import (
    ErrorSets,
    bounds_where_closed,
    error_sets,
    parts_of,
    rigid_parts,
    zones_of_errors,
)
from forcefit.assembly.statistics.linear_response import LinearResponse, linear_response
from forcefit.assembly.statistics.quantities import POSE_ERRORS
from forcefit.assembly.statistics.responses import respond
from forcefit.assembly.steps.bolted import refuse_bolted
from forcefit.inputs.renamed import renamed_keywords
from forcefit.inputs.table import BadInput, describe, nearest
from forcefit.results.display import Figures, html_table, short_repr
from forcefit.results.text import in_unit

# precision of the bounds, relative to the largest support function
_TOLERANCE = 3e-4
_STARTS = 24  # number of random starting corners of the tolerance box
_CLIMBS = 12  # largest number of steps of the search

MEANINGS = {
    "linear": "no loop is over-constrained: all definitions agree",
    "rigid": "rigid bodies: errors and clearances for which loops close without force",
    "elastic": "elastic bodies without clearances: the response is linear",
    "equilibrium": "elastic bodies with clearances: between the largest equilibrium "
    "found and an upper bound that treats clearances as errors",
}


@dataclass(frozen=True, eq=False)
class WorstPose:
    """Worst pose error over all errors within tolerance and all clearance positions.

    Attributes:
        quantity: ``"rotation"`` or ``"translation"``.
        reading: definition of the worst case, a key of :data:`MEANINGS`.
        attained: [rad or m] largest value found.
        bound: [rad or m] upper bound.
        direction: (3,) unit vector along the largest rotation or translation found, in
            base axes.
        shares: [rad or m] contribution of each callout, independent error and clearance
            along ``direction``, in descending order.
        rigid: [rad or m] largest value for the definition ``rigid``, if the definition
            is ``equilibrium``; otherwise NaN.
    """

    quantity: str
    reading: str
    attained: float
    bound: float
    direction: NDArray
    shares: tuple[tuple[str, float], ...]
    rigid: float = float("nan")

    __repr__, _repr_html_ = short_repr, html_table

    def _figures(self) -> Figures:
        """Format the bounds and the three largest contributions as text."""
        unit = "mrad" if self.quantity == "rotation" else "um"
        return {
            "quantity": self.quantity,
            "reading": self.reading,
            "attained": in_unit(self.attained, unit),
            "bound": in_unit(self.bound, unit),
            **{f"share of {name}": in_unit(x, unit) for name, x in self.shares[:3]},
        }


@renamed_keywords(prepared="posture", sources="errors")
def worst_pose(
    posture: Posture | LinearResponse,
    errors: Sources | Path | str | None = None,
    quantity: str = "translation",
    seed: int = 1,
) -> WorstPose:
    """Compute the worst pose error over all errors and clearance positions.

    Args:
        posture: a posture without loads, or its linear response.
        errors: path of a TOML file with independent errors, or error sources, in
            addition to the callouts and fits of the robot. The errors must be bounded
            and symmetric about zero. Fits have their largest clearance.
        quantity: ``"rotation"`` or ``"translation"``.
        seed: seed of the random starting corners of the search.

    Returns:
        The worst case and its definition.

    Raises:
        BadInput: the quantity is unknown, a joint is bolted, there is a load, or an
            independent error is unbounded or not symmetric about zero.
    """
    if quantity not in POSE_ERRORS:
        raise BadInput(
            f"quantity: found {describe(quantity)}{nearest(quantity, POSE_ERRORS)}"
        )
    one = posture.posture if isinstance(posture, LinearResponse) else posture
    prepared = linear_response(posture) if isinstance(posture, Posture) else posture
    prepared, sources = _at_largest_clearances(prepared, sources_of(one.robot, errors))
    sets, half = error_sets(prepared, sources), 3 * POSE_ERRORS.index(quantity)
    reading = _reading(sets)
    (low, high), screw = _farthest(sets, sets.rigid_rows, half)
    rigid = float("nan")
    if reading == "equilibrium":
        rows = np.vstack([sets.rigid_rows, sets.spring_rows])
        (rigid, _), inner = _farthest(sets, rows, half)
        toward = inner[half : half + 3] / max(rigid, 1e-300)
        start = _support(sets, rows, half)(toward)[2][: -sets.clearances]
        low, direction = _climb(prepared, sources, quantity, seed, start)
        if rigid > low:
            low, direction = rigid, inner[half : half + 3]
    else:
        direction = screw[half : half + 3]
    size = float(np.linalg.norm(direction))
    direction = direction / size if size else np.eye(3)[0]
    along = direction @ sets.screws[half : half + 3]
    parts = rigid_parts(sets, along) if reading == "rigid" else parts_of(sets, along)
    shares: dict[str, float] = {}  # contributions, summed over the contacts of a joint
    for name, part in zip(sets.names, parts, strict=True):
        shares[name] = shares.get(name, 0.0) + part
    ordered = tuple(sorted(shares.items(), key=lambda share: -share[1]))
    return WorstPose(quantity, reading, low, max(low, high), direction, ordered, rigid)


def bound_worst_pose(
    prepared: LinearResponse, sources: Sources, tolerance: float = _TOLERANCE
) -> tuple[str, dict[str, float]]:
    """Compute upper bounds on the worst pose errors.

    Args:
        prepared: as for :func:`worst_pose`.
        sources: as for :func:`worst_pose`.
        tolerance: [-] precision of the bounds, relative to the largest support function
            along x, y and z.

    Returns:
        The definition of the worst case, a key of :data:`MEANINGS`, and bounds on the
        ``rotation`` [rad] and the ``translation`` [m].

    Raises:
        BadInput: as for :func:`worst_pose`.
    """
    sets = error_sets(*_at_largest_clearances(prepared, sources))
    bounds = {
        quantity: _farthest(sets, sets.rigid_rows, 3 * half, tolerance)[0][1]
        for half, quantity in enumerate(POSE_ERRORS)
    }
    return _reading(sets), bounds


def _at_largest_clearances(
    prepared: LinearResponse, sources: Sources
) -> tuple[LinearResponse, Sources]:
    """Return the response for the largest fit clearances, and all other errors."""
    refuse_bolted(prepared.posture.robot, "worst case")
    if prepared.loads is not None:
        raise BadInput(
            "worst case: found a load, expected none, because the pose error of a "
            "loaded robot is not linear in the errors"
        )
    if isinstance(sources, CalloutSources) and sources.fits:
        robot = sources.with_largest_clearances()
        prepared = linear_response(replace(prepared.posture, robot=robot))
        sources = replace(sources, fits=())
    return prepared, sources


def _reading(sets: ErrorSets) -> str:
    """Return the definition of the worst case, a key of ``MEANINGS``."""
    # Several contacts of the same joint do not over-constrain a loop.
    held = len(sets.rigid_rows) > len(sets.contact_rows)
    sprung = len(sets.spring_rows) > 0
    if sprung and sets.clearances:
        return "equilibrium"
    return "elastic" if sprung else "rigid" if held else "linear"


def farthest_screw(sets: ErrorSets, half: int) -> tuple[tuple[float, float], NDArray]:
    """Bound the largest platform rotation or translation if loops need not close.

    Args:
        sets: zones of errors and clearances.
        half: 0 for the rotation, 3 for the translation.

    Returns:
        Largest value found and upper bound [rad or m], and the screw of the largest
        value, (6,).
    """
    return _farthest(sets, sets.contact_rows, half)


def _farthest(
    sets: ErrorSets, rows: NDArray, half: int, tolerance: float = _TOLERANCE
) -> tuple[tuple[float, float], NDArray]:
    """Bound the largest rotation or translation subject to ``rows @ z = 0``."""
    support = _support(sets, rows, half)
    sizes = [support(direction)[0] for direction in np.eye(3)]
    if not max(sizes) > 0:
        return (0.0, 0.0), np.zeros(6)
    bounds, screw, _ = farthest(np.zeros(6), half, tolerance * max(sizes), support)
    low = bounds[0]
    # Each iteration increases the rotation or translation of the screw.
    for _ in range(50):
        further = support(screw[half : half + 3] / low)[1]
        size = float(np.linalg.norm(further[half : half + 3]))
        if size <= low * (1 + 1e-12):
            break
        screw, low = further, size
    return (low, max(low, min(bounds[1], _sum_of_sizes(sets, half)))), screw


def _sum_of_sizes(sets: ErrorSets, half: int) -> float:
    """Return the sum of the largest pose errors due to each zone [rad or m]."""
    # Cutting planes converge slowly if the set of screws is a ball. For a ball, this
    # sum is exact.
    total = 0.0
    for zone, columns in zip(sets.zones, sets.columns, strict=True):
        ends = np.cumsum(zone.dimensions)[:-1]
        for part in np.split(sets.screws[half : half + 3, columns], ends, axis=1):
            total += (1.0 + zone.bonus) * float(np.linalg.norm(part, 2))
    return total


def _support(
    sets: ErrorSets, rows: NDArray, half: int
) -> Callable[[NDArray], tuple[float, NDArray, NDArray]]:
    """Return a function that computes the support function and the farthest screw."""
    P = sets.screws[half : half + 3]
    if not len(rows):

        def closed_form(direction: NDArray) -> tuple[float, NDArray, NDArray]:
            w, z, height = direction @ P, np.zeros(P.shape[1]), 0.0
            for zone, columns in zip(sets.zones, sets.columns, strict=True):
                z[columns], value = zone.farthest_u(w[columns])
                height += value
            return height, sets.screws @ z, z

        return closed_form
    N, bounds, cones = bounds_where_closed(sets, rows)

    def programme(direction: NDArray) -> tuple[float, NDArray, NDArray]:
        y, height = largest_product(direction @ P @ N, bounds, cones)
        return height, sets.screws @ (N @ y), N @ y

    return programme


def _climb(
    prepared: LinearResponse, sources: Sources, quantity: str, seed: int, start: NDArray
) -> tuple[float, NDArray]:
    """Return the largest pose error found at equilibrium, and its vector."""
    half = 3 * POSE_ERRORS.index(quantity)
    own = zones_of_errors(sources)
    sizes = [sum(zone.dimensions) for _, zone, _ in own]
    parts = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])
    scale = np.concatenate([unit for _, _, unit in own])

    def corners(slopes: NDArray) -> NDArray:
        """Return the errors within all zones that maximise errors . slopes, (k, m)."""
        u = np.zeros_like(slopes)
        for row, w in zip(u, slopes * scale, strict=True):
            for (_, zone, _), columns in zip(own, parts, strict=True):
                row[columns] = zone.farthest_u(w[columns])[0]
        return u * scale

    rng = np.random.default_rng(seed)
    along = prepared.screws[half : half + 3, int(prepared.starts[-1]) :]
    starts = rng.normal(size=(_STARTS, 3)) @ along
    n = len(prepared.posture.robot.frames)
    first = sources.of_numbers(starts.reshape(-1, n, 6))
    values = corners(np.vstack([first, rng.normal(size=first.shape) / scale]))
    values = np.vstack([values, start * scale])
    best, best_values = -np.inf, values[0]
    for _ in range(_CLIMBS):
        sizes_found, slopes = respond(prepared, sources, values, quantity)
        sizes_found = np.where(np.isnan(sizes_found), -np.inf, sizes_found)
        i = int(np.argmax(sizes_found))
        if sizes_found[i] <= best * (1 + 1e-12):
            break
        best, best_values = float(sizes_found[i]), values[i]
        values = corners(np.nan_to_num(slopes))
    draws = prepared.solve(sources.errors(best_values[None]))
    return best, draws.platform_screw[0, half : half + 3]
