"""Limited quantities as functions of the errors, with derivatives."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.energy import Assembly
from forcefit.assembly.model.error_distributions import draw_generator
from forcefit.assembly.model.link_stress import WEIGHTLESS, LinkStress, stressed_links
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.statistics.callout_sources import Sources
from forcefit.assembly.statistics.clearance_positions import (
    CLEARANCE_STREAM,
    position_clearances,
)
from forcefit.assembly.statistics.linear_response import LinearResponse
from forcefit.assembly.statistics.posture_margins import PostureMargins
from forcefit.assembly.statistics.quantities import POSE_ERRORS
from forcefit.assembly.statistics.sensitivity import solution_slopes
from forcefit.assembly.statistics.worst_clearance import (
    bound_worst_errors,
    worst_error_slopes,
)
from forcefit.assembly.steps.bolted import bolted_errors

_STEP = 1e-6  # finite-difference step for the stress, relative to the wrench
_PRECISION = 1e-9  # [rad or m] precision of the largest pose errors
# finite-difference step for robots with bolted joints, relative to the largest absolute
# error, and smallest error to which the step is relative
_BOLT_STEP, _LEAST_VALUE = 1e-4, 1e-6
_PARTS = {"moment": slice(0, 3), "force": slice(3, 6)}


def respond(
    prepared: PostureMargins | LinearResponse, sources: Sources, values: NDArray,
    key: str = "energy", clearance: str = "worst",
    contact_length: float | None = None,
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """Compute a quantity and its derivatives for given errors.

    Args:
        prepared: prepared problem (21) for a margin, or linear response for another
            quantity.
        sources: the m errors, with their distributions.
        values: (k, m) [rad or m] errors.
        key: quantity for a linear response: energy [J], force [N], moment [N m], stress
            [Pa], rotation [rad] or translation [m].
        clearance: for a pose error, one of
            :data:`forcefit.assembly.statistics.clearance_positions.CLEARANCE_MODELS`.
            In the models ``"uniform"`` and ``"contact"``, the derivatives omit the
            motion of joints within their clearances.
        contact_length: [m] length of the contact model, see
            :class:`forcefit.assembly.statistics.experiment.Experiment`.

    Returns:
        Values, (k,), and derivatives, (k, m); NaN without a solution. Bolted joints are
        fixed at the clearances with the smallest sum of squares.

    Raises:
        CannotBolt: a robot cannot be assembled at the pose where a joint is bolted.
    """
    robot = prepared.posture.robot
    errors = bolted_errors(robot, sources.errors(values))
    by_number = partial(_by_number, robot, sources, values)
    if isinstance(prepared, PostureMargins):
        margins = prepared.solve(errors)
        slopes = prepared.slopes(margins)
        return margins.margin, by_number(slopes)
    draws = prepared.solve(errors)
    if key == "energy":
        return draws.energy, -by_number(draws.wrenches)
    size = np.full(len(values), np.nan)
    slopes = np.full(errors.shape, np.nan)
    # Derivatives are computed only for draws with known clearances.
    known = np.isfinite(draws.energy) & np.isfinite(draws.clearances).all(axis=1)
    solved = np.flatnonzero(known)
    if len(solved):
        some = draws[solved]
        if key in POSE_ERRORS:
            size[solved], by_screw, by_clearance = _pose_error(
                prepared, some, key, (clearance, contact_length), solved
            )
            by_wrench = np.zeros_like(errors[solved])
        else:
            size[solved], by_wrench = _wrench_quantity(some, key)
            by_screw, by_clearance = np.zeros_like(some.platform_screw), None
        slopes[solved] = solution_slopes(
            prepared, some, by_wrench, by_screw, by_clearance
        )
    return size, by_number(slopes)


def _by_number(
    robot: Robot, sources: Sources, values: NDArray, slopes: NDArray
) -> NDArray:
    """Return the derivatives with respect to the m sources, (k, m).

    The frame error of a bolted joint depends on all errors. Its derivatives are
    computed by central differences.
    """
    if not any(frame.locked_at for frame in robot.frames):
        return sources.of_numbers(slopes)
    k, m = values.shape
    steps = np.diag(_BOLT_STEP * np.maximum(np.abs(values).max(axis=0), _LEAST_VALUE))
    moved = np.concatenate([values + step for step in (*steps, *-steps)])
    ahead, behind = bolted_errors(robot, sources.errors(moved)).reshape(2, m, k, -1)
    change = (ahead - behind) / (2 * np.diag(steps))[:, None, None]
    return np.asarray(np.einsum("mkn,kn->km", change, slopes.reshape(k, -1)))


def _pose_error(
    prepared: LinearResponse, draws: Assembly, key: str,
    model: tuple[str, float | None], numbers: NDArray,
) -> tuple[NDArray, NDArray, NDArray | None]:  # fmt: skip
    """Return a pose error, and its derivatives by platform screw and by clearance."""
    part, (clearance, contact_length) = 3 * POSE_ERRORS.index(key), model
    if clearance == "worst":
        precision = (_PRECISION, np.inf) if key == "rotation" else (np.inf, _PRECISION)
        bounds, screws = bound_worst_errors(draws, precision)
        which = POSE_ERRORS.index(key)
        by_screw, by_clearance = worst_error_slopes(
            prepared, draws, key, screws[:, which]
        )
        return bounds[:, which, 0], by_screw, -by_clearance
    generators = [draw_generator(1, i, CLEARANCE_STREAM) for i in numbers.tolist()]
    screws, _ = position_clearances(
        prepared, draws, clearance, generators, contact_length
    )
    slopes = np.zeros_like(screws)
    size, slopes[:, part : part + 3] = _size(screws[:, part : part + 3])
    return size, slopes, None


def _wrench_quantity(some: Assembly, key: str) -> tuple[NDArray, NDArray]:
    """Return the largest moment, force or stress, and its derivatives."""
    wrenches, at_tips = some.wrenches, some.frame_loads.at_tips
    slopes, draws = np.zeros_like(wrenches), np.arange(len(wrenches))
    if key != "stress":
        sizes, own = _size((wrenches - at_tips)[:, :, _PARTS[key]])
        worst = sizes.argmax(axis=1)
        slopes[draws, worst, _PARTS[key]] = own[draws, worst]
        return sizes[draws, worst], slopes
    links = stressed_links(some.posture.robot)
    each = [link.peak(wrenches[:, link.row], at_tips[link.row]) for link in links]
    peaks = np.stack(each, axis=1)
    worst = peaks.argmax(axis=1)
    for i, link in enumerate(links):
        own = np.flatnonzero(worst == i)
        slopes[own, link.row] = _stress_slopes(
            link, wrenches[own, link.row], at_tips[link.row]
        )
    return peaks[draws, worst], slopes


def _size(parts: NDArray) -> tuple[NDArray, NDArray]:
    """Return the norms of vectors, and the derivatives of the norms."""
    size = np.linalg.norm(parts, axis=-1)
    return size, parts / np.maximum(size, 1e-300)[..., None]


def _stress_slopes(
    link: LinkStress, wrenches: NDArray, at_tip: NDArray = WEIGHTLESS
) -> NDArray:
    """Differentiate the peak stress of a link with respect to its wrench, (k, 6)."""
    # Central differences of the stress formula have a relative error of about 1e-10.
    slopes = np.zeros_like(wrenches)
    for part in (slice(0, 3), slice(3, 6)):
        step = _STEP * np.linalg.norm(wrenches[:, part], axis=1).max(initial=1e-9)
        for c in range(part.start, part.stop):
            change = step * np.eye(6)[c]
            slopes[:, c] = (
                link.peak(wrenches + change, at_tip)
                - link.peak(wrenches - change, at_tip)
            ) / (2 * step)
    return slopes
