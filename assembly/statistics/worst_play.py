"""How far off the platform can be wherever play sits: problem (27) for many draws.

Asked in the reading ``frozen``: all springs as (22) leaves them, all play that carries
no load anywhere within its bounds.  By strict convexity every solution of (22) has the
same springs, and by complementary slackness the same loaded clearances, so this is the
set of *all* solutions of (22), inside a zone and outside: where play may be without
costing energy.  Uniform play, play at contact and the solver's own solution are points
of it.  The other readings ask of something else than the robot's file says: ``free``
lets compliant joints turn against their springs for nothing, ``budget`` lets parts
store more energy than they must.

Under a load the same holds of energy minus work: what the load takes up stays, and
only play that no load holds counts as open.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.batch.draws import Draws
from assembly.batch.many_draws import OnePosture
from assembly.batch.many_pose_errors import bound_pose_errors
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reduction import FreeMotion
from assembly.solvers.conic import SolverFailed
from assembly.statistics.play import free_starts, loaded_clearances, play_rows
from assembly.statistics.quantities import POSE_ERRORS

if TYPE_CHECKING:
    from assembly.solvers.support import Body

READING = "frozen"
PRECISION = (1e-6, 1e-6)  # [rad, m] asked of upper minus lower bounds
_SHARP = 1e-12  # [rad or m] asked of a support whose multipliers are slopes


def bound_play(
    one: OnePosture, found: Draws, errors: NDArray,
    precision: tuple[float, float] = PRECISION,
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Certified bounds of the largest pose errors of draws, wherever play sits.

    Args:
        one: the posture.
        found: what it answered to k draws.
        errors: (k, n, 6) [rad, m] of these draws.
        precision: [rad, m] asked of upper minus lower bounds; inf leaves a part out.

    Returns:
        (k, 2, 2) lower and upper bounds of the rotation [rad] and the translation [m],
        no lower than the screw of ``found``; NaN for a draw without an answer, upper
        bounds inf where none is proved.  And (k, 2, 6) [rad, m] screws that attain the
        lower bounds, or nearly.
    """
    bounds = np.full((len(errors), 2, 2), np.nan)
    screws = np.tile(found.platform_screw[:, None], (1, 2, 1))
    solved = np.flatnonzero(np.isfinite(found.energy))
    if one.loads is None:
        bounds[solved], screws[solved] = _of_all(one, errors[solved], precision)
    else:
        for i in solved.tolist():
            bounds[i], screws[i] = _under_load(one, errors[i], precision)
    # another solution of (22) differs from this one's by the root of their gaps
    least = np.stack([
        np.linalg.norm(found.platform_screw[:, part], axis=1)
        for part in (slice(0, 3), slice(3, 6))
    ], axis=1)  # fmt: skip
    own = ~(bounds[..., 0] > least)
    screws[own] = np.tile(found.platform_screw[:, None], (1, 2, 1))[own]
    bounds[..., 0] = np.where(own, least, bounds[..., 0])
    upper = np.where(np.isnan(bounds[..., 1]), np.inf, bounds[..., 1])
    bounds[..., 1] = np.maximum(upper, bounds[..., 0])
    bounds[~np.isfinite(found.energy)] = np.nan
    return bounds, screws


def _of_all(
    one: OnePosture, errors: NDArray, precision: tuple[float, float]
) -> tuple[NDArray, NDArray]:
    """Bounds and screws of unloaded draws, compiled."""
    posture = one.posture
    T = np.repeat(posture.transforms[None], len(errors), axis=0)
    found = bound_pose_errors(
        posture.robot, T, READING, errors, posture.mismatch,
        tolerance_rotation=precision[0], tolerance_translation=precision[1],
    )  # fmt: skip
    return (
        np.stack([found.rotation_error, found.translation_error], axis=1),
        np.stack([found.rotation_screw, found.translation_screw], axis=1),
    )


def _under_load(
    one: OnePosture, errors: NDArray, precision: tuple[float, float]
) -> tuple[NDArray, NDArray]:
    """Bounds and screws of one loaded draw; NaN if the solver gave up."""
    assert one.loads is not None
    posture = replace(one.posture, robot=one.posture.robot.with_errors(errors))
    try:
        answer = solve_assembly(posture, one.loads.load, gravity=one.loads.gravity)
        found = bound_pose_error(
            answer, READING,
            tolerance_rotation=precision[0], tolerance_translation=precision[1],
        )  # fmt: skip
    except (CannotAssemble, SolverFailed, FreeMotion):
        return np.full((2, 2), np.nan), np.zeros((2, 6))
    bounds = np.array([found.rotation_error, found.translation_error])
    return bounds, np.array([found.rotation_screw, found.translation_screw])


def play_pulls(
    one: OnePosture, found: Draws, key: str, screws: NDArray
) -> tuple[NDArray, NDArray]:
    """What holds the platform where it is farthest off, for slopes.

    The farthest point is that of a support function along its own direction, so by the
    envelope theorem it grows with the errors as that does with its bounds given.

    Args:
        one: the posture.
        found: what it answered to k draws, none under a load.
        key: ``"rotation"`` or ``"translation"``.
        screws: (k, 6) [rad, m] that attain the largest, of :func:`bound_play`.

    Returns:
        (k, 6) slopes of the largest error with the platform's screw, and (k, nu) pulls
        with which it presses on the bound of every clearance that carries no load.
    """
    from assembly.solvers.support import pulls_along

    part = 3 * POSE_ERRORS.index(key)
    size = np.linalg.norm(screws[:, part : part + 3], axis=1, keepdims=True)
    by_screw, pulls = np.zeros_like(screws), np.zeros_like(found.clearances)
    by_screw[:, part : part + 3] = screws[:, part : part + 3] / np.maximum(size, 1e-300)
    loaded = loaded_clearances(one, found)
    for i in range(len(screws)):
        free = ~loaded[i]
        if free.any():
            body = _body(one, found, i, free)
            direction = by_screw[i, part : part + 3].copy()
            pulls[i, free] = pulls_along(body, part, direction, _SHARP)
    return by_screw, pulls


def _body(one: OnePosture, found: Draws, i: int, free: NDArray) -> "Body":
    """The platform screws that remain possible to draw i."""
    from assembly.solvers.support import Body

    nu = len(free)
    rows = play_rows(one, ~free)[:, free]
    return Body(
        found.platform_screw[i].copy(),
        np.ascontiguousarray(one.screws[:, :nu][:, free]), np.ascontiguousarray(rows),
        found.clearances[i, free].copy(), free_starts(one, free),
    )  # fmt: skip
