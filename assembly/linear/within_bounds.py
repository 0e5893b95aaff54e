"""Problem (22) within the bounds of passive joints' own motion, where these matter.

Most are ranges that no solution comes near, so they are left out first.  Points that
leave one, or in which a load drives a motion that nothing else resists, are solved once
more, compiled, with all bounds as cones.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from assembly.linear.assemblies import COMPILED, OUTCOMES
from assembly.linear.robot_structure import Structure
from assembly.linear.solutions import Solutions

# frames, errors, closure errors of the frames, and loads
Points = tuple[NDArray, NDArray, NDArray, NDArray | None]

_LEFT = [OUTCOMES.index(name) for name in ("bounded joint", "free motion")]


def bounds_matter(structure: Structure, outcome: NDArray) -> NDArray:
    """Which points a bound that was left out may hold.

    Args:
        structure: without these bounds.
        outcome: (k,) as of :class:`~assembly.linear.solutions.Solutions`.

    Returns:
        (k,) bool.
    """
    return np.isin(outcome, _LEFT) & bool(np.isfinite(structure.free_bound).any())


def solve_within_bounds(
    structure: Structure, points: Points, out: Solutions,
    solve: Callable[..., Solutions],
) -> NDArray:  # fmt: skip
    """Solve again, in place, the points to which bounds matter.

    Args:
        structure: without these bounds.
        points: all k of them; one row serves all where it is the only one.
        out: their solutions without bounds.  Of points solved here, clearances and
            motions become NaN; points that are not are left as they are.
        solve: with all bounds, from frames, errors, closure errors and loads.

    Returns:
        (k, nu) clearances with all bounds as cones, in units of these; NaN at points
        that are not solved here.  No columns where all points were solved before.
    """
    limited = int(np.isfinite(structure.free_bound).sum())
    count, nu = out.clearances.shape
    if not limited or np.all(out.outcome < COMPILED):
        return np.zeros((count, 0))
    bounded = np.full((count, nu + limited), np.nan)
    rows = np.flatnonzero(bounds_matter(structure, out.outcome))
    if not len(rows):
        return bounded
    again = solve(*(_taken(part, rows) for part in points))
    proved = again.outcome < COMPILED
    rows = rows[proved]
    bounded[rows] = again.clearances[proved]
    out.clearances[rows] = out.motions[rows] = np.nan
    for name in Solutions._fields:
        if name not in {"clearances", "motions", "elastic"}:
            getattr(out, name)[rows] = getattr(again, name)[proved]
    return bounded


def _taken(part: NDArray | None, rows: NDArray) -> NDArray | None:
    """Some rows, or the one that serves all."""
    return part if part is None or len(part) == 1 else part[rows]
