"""Largest pose errors over all positions within the clearances, problem (27).

The set of positions is the set of all minimum-energy solutions (22), which is the
assumption ``frozen`` of problem (27). All solutions have the same spring deformations,
because the energy is strictly convex in them. Joints that transmit a force also have
the same positions in all solutions. The other joints may be anywhere within their
clearances.

Under a load, the energy minus the work of the load is minimised.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.energy import Assembly, CannotAssemble
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.solvers.one_problem import farthest_points
from forcefit.assembly.statistics.clearance_positions import (
    clearance_constraints,
    free_starts,
    loaded_clearances,
)
from forcefit.assembly.statistics.linear_response import LinearResponse
from forcefit.assembly.statistics.quantities import POSE_ERRORS

ASSUMPTION = "frozen"
PRECISION = (1e-6, 1e-6)  # [rad, m] default precision of the bounds
# [rad or m] precision of the support function for derivatives
_SUPPORT_PRECISION = 1e-12


def bound_worst_errors(
    draws: Assembly, precision: tuple[float, float] = PRECISION
) -> tuple[NDArray, NDArray]:
    """Bound the largest pose errors over all positions within the clearances.

    Args:
        draws: solutions for k draws at one posture.
        precision: [rad, m] required difference of upper and lower bounds; inf to omit
            an upper bound.

    Returns:
        Lower and upper bounds on rotation [rad] and translation [m], (k, 2, 2); NaN
        without a solution, and inf for an unknown upper bound. Screws that attain the
        lower bounds, (k, 2, 6) [rad, m].
    """
    bounds = np.full((len(draws), 2, 2), np.nan)
    screws = np.tile(draws.platform_screw[:, None], (1, 2, 1))
    solved = np.flatnonzero(np.isfinite(draws.energy))
    if not draws.frame_loads:
        bounds[solved], screws[solved] = _without_load(draws[solved], precision)
    else:
        for i in solved.tolist():
            bounds[i], screws[i] = _under_load(draws, i, precision)
    # The computed solution is one of the positions, so its error is a lower bound.
    least = np.stack([
        np.linalg.norm(draws.platform_screw[:, part], axis=1)
        for part in (slice(0, 3), slice(3, 6))
    ], axis=1)  # fmt: skip
    own = ~(bounds[..., 0] > least)
    screws[own] = np.tile(draws.platform_screw[:, None], (1, 2, 1))[own]
    bounds[..., 0] = np.where(own, least, bounds[..., 0])
    upper = np.where(np.isnan(bounds[..., 1]), np.inf, bounds[..., 1])
    bounds[..., 1] = np.maximum(upper, bounds[..., 0])
    bounds[~np.isfinite(draws.energy)] = np.nan
    return bounds, screws


def _without_load(
    draws: Assembly, precision: tuple[float, float]
) -> tuple[NDArray, NDArray]:
    """Return bounds and screws of draws without loads."""
    found = bound_pose_error(
        draws, ASSUMPTION,
        tolerance_rotation=precision[0], tolerance_translation=precision[1],
    )  # fmt: skip
    return (
        np.stack([found.rotation_error, found.translation_error], axis=1),
        np.stack([found.rotation_screw, found.translation_screw], axis=1),
    )


def _under_load(
    draws: Assembly, i: int, precision: tuple[float, float]
) -> tuple[NDArray, NDArray]:
    """Return bounds and screws of one draw with loads; NaN if the solver failed."""
    try:
        error_bound = bound_pose_error(
            draws[i], ASSUMPTION,
            tolerance_rotation=precision[0], tolerance_translation=precision[1],
        )  # fmt: skip
    except (CannotAssemble, SolverFailed, FreeMotion):
        return np.full((2, 2), np.nan), np.zeros((2, 6))
    bounds = np.array([error_bound.rotation_error, error_bound.translation_error])
    return bounds, np.array([error_bound.rotation_screw, error_bound.translation_screw])


def worst_error_slopes(
    prepared: LinearResponse, draws: Assembly, key: str, screws: NDArray
) -> tuple[NDArray, NDArray]:
    """Differentiate the largest pose error by platform screw and clearance bounds.

    By the envelope theorem, the derivatives are those of the support function in the
    direction of the pose error.

    Args:
        prepared: linear response of the posture.
        draws: solutions for k draws without loads.
        key: ``"rotation"`` or ``"translation"``.
        screws: (k, 6) [rad, m] screws of the largest error, from
            :func:`bound_worst_errors`.

    Returns:
        Derivatives with respect to the platform screw, (k, 6), and multipliers of the
        bounds of clearances that transmit no force, (k, nu).
    """
    part = 3 * POSE_ERRORS.index(key)
    size = np.linalg.norm(screws[:, part : part + 3], axis=1, keepdims=True)
    by_screw, by_clearance = np.zeros_like(screws), np.zeros_like(draws.clearances)
    by_screw[:, part : part + 3] = screws[:, part : part + 3] / np.maximum(size, 1e-300)
    loaded = loaded_clearances(prepared, draws)
    # derivative of the pose error with respect to the clearances
    along = by_screw @ prepared.screws[:, : draws.clearances.shape[1]]
    patterns, pattern_of = np.unique(loaded, axis=0, return_inverse=True)
    for k, pattern in enumerate(patterns):
        free, own = ~pattern, np.flatnonzero(pattern_of.ravel() == k)
        if free.any():
            by_clearance[np.ix_(own, free)] = _pressing(
                prepared, free, along[np.ix_(own, free)],
                draws.clearances[np.ix_(own, free)],
            )  # fmt: skip
    return by_screw, by_clearance


def _pressing(
    prepared: LinearResponse, free: NDArray, along: NDArray, clearances: NDArray
) -> NDArray:
    """Return the multipliers of the bounds of clearances without force, (k, ..)."""
    rows = clearance_constraints(prepared, ~free)[:, free]
    size = np.linalg.norm(along, axis=1, keepdims=True)
    moving = size[:, 0] > 0.0
    if not len(rows) or not moving.any():
        return along
    size = size[moving]
    _, multipliers, _ = farthest_points(
        rows, free_starts(prepared, free), along[moving] / size,
        clearances[moving] @ rows.T, _SUPPORT_PRECISION / size[:, 0],
    )  # fmt: skip
    pressing = along.copy()
    pressing[moving] -= multipliers * size @ rows
    return pressing
