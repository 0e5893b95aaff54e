"""What errors do to a limited quantity, and its slopes with each of them."""

import numpy as np
from numpy.typing import NDArray

from assembly.batch.draws import Draws
from assembly.batch.many_draws import OnePosture
from assembly.batch.many_margins import PostureMargins
from assembly.model.error_distributions import ErrorSources, draw_generator
from assembly.model.link_stress import LinkStress, stressed_links
from assembly.statistics.play import PLAY_STREAM, settle_play
from assembly.statistics.quantities import POSE_ERRORS
from assembly.statistics.sensitivity import solution_slopes
from assembly.statistics.worst_play import bound_play, play_pulls

_STEP = 1e-6  # of a wrench, to differentiate a formula of stress
_SHARP = 1e-9  # [rad or m] asked of the largest pose errors
_PARTS = {"moment": slice(0, 3), "force": slice(3, 6)}


def respond(
    ready: PostureMargins | OnePosture, sources: ErrorSources, values: NDArray,
    key: str = "energy", play: str = "worst",
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """A quantity for given errors, and its slopes with each of them.

    Args:
        ready: a posture prepared for margins, or for energies and all others.
        sources: m of them.
        values: (k, m) [rad or m].
        key: which quantity, of a posture prepared for energies: energy [J], force [N],
            moment [N m], stress [Pa], rotation [rad] or translation [m].
        play: what is assumed of it where that is a pose error, one of
            :data:`assembly.statistics.play.PLAY`.  With the worst, the value is the
            largest found and the slopes are its own; of uniform play and play at
            contact the slopes are those of the solution, which know nothing of it.

    Returns:
        (k,) and (k, m); NaN where there is no answer.
    """
    errors = sources.errors(values)
    if isinstance(ready, PostureMargins):
        margins = ready.solve(errors)
        return margins.margin, margins.slopes[:, sources.frame, sources.component]
    found = ready.solve(errors)
    wrenches = ready.wrenches(found.multipliers)
    if key == "energy":
        return found.energy, -wrenches[:, sources.frame, sources.component]
    size = np.full(len(values), np.nan)
    slopes = np.full(errors.shape, np.nan)
    # without clearances in unit cones nothing tells which of them are used up
    known = np.isfinite(found.energy) & np.isfinite(found.clearances).all(axis=1)
    solved = np.flatnonzero(known)
    if len(solved):
        some = _rows(found, solved)
        if key in POSE_ERRORS:
            size[solved], by_screw, by_play = _of_pose(
                ready, some, errors[solved], key, play, solved
            )
            by_wrench = np.zeros_like(wrenches[solved])
        else:
            size[solved], by_wrench = _of_wrenches(ready, key, wrenches[solved])
            by_screw, by_play = np.zeros_like(some.platform_screw), None
        slopes[solved] = solution_slopes(ready, some, by_wrench, by_screw, by_play)
    return size, slopes[:, sources.frame, sources.component]


def _of_pose(
    ready: OnePosture, found: Draws, errors: NDArray, key: str, play: str,
    numbers: NDArray,
) -> tuple[NDArray, NDArray, NDArray | None]:  # fmt: skip
    """Size of a pose error, and its slopes with the platform's screw and the play."""
    part = 3 * POSE_ERRORS.index(key)
    if play == "worst":
        sharp = (_SHARP, np.inf) if key == "rotation" else (np.inf, _SHARP)
        bounds, screws = bound_play(ready, found, errors, sharp)
        which = POSE_ERRORS.index(key)
        by_screw, pulls = play_pulls(ready, found, key, screws[:, which])
        return bounds[:, which, 0], by_screw, -pulls
    generators = [draw_generator(1, i, PLAY_STREAM) for i in numbers.tolist()]
    screws, _ = settle_play(ready, found, play, generators)
    slopes = np.zeros_like(screws)
    size, slopes[:, part : part + 3] = _size(screws[:, part : part + 3])
    return size, slopes, None


def _rows(found: Draws, rows: NDArray) -> Draws:
    """Some of the draws."""
    return Draws(*(getattr(found, name)[rows] for name in Draws.__dataclass_fields__))


def _of_wrenches(
    ready: OnePosture, key: str, wrenches: NDArray
) -> tuple[NDArray, NDArray]:
    """The largest moment, force or stress, and its slopes with the wrenches."""
    slopes, draws = np.zeros_like(wrenches), np.arange(len(wrenches))
    if key != "stress":
        sizes, own = _size(wrenches[:, :, _PARTS[key]])
        worst = sizes.argmax(axis=1)
        slopes[draws, worst, _PARTS[key]] = own[draws, worst]
        return sizes[draws, worst], slopes
    links = stressed_links(ready.posture.robot)
    peaks = np.stack([link.peak(wrenches[:, link.row]) for link in links], axis=1)
    worst = peaks.argmax(axis=1)
    for i, link in enumerate(links):
        some = np.flatnonzero(worst == i)
        slopes[some, link.row] = _stress_slopes(link, wrenches[some, link.row])
    return peaks[draws, worst], slopes


def _size(parts: NDArray) -> tuple[NDArray, NDArray]:
    """Lengths of vectors, and their slopes with the components."""
    size = np.linalg.norm(parts, axis=-1)
    return size, parts / np.maximum(size, 1e-300)[..., None]


def _stress_slopes(link: LinkStress, wrenches: NDArray) -> NDArray:
    """(k, 6) slopes of the peak stress with a link's wrench."""
    # differences of the formula, not of the solution: a fibre's stress is the root of
    # a quadratic form, and central differences lose 1e-10 of its slope
    slopes = np.zeros_like(wrenches)
    for part in (slice(0, 3), slice(3, 6)):
        step = _STEP * np.linalg.norm(wrenches[:, part], axis=1).max(initial=1e-9)
        for c in range(part.start, part.stop):
            way = step * np.eye(6)[c]
            slopes[:, c] = (link.peak(wrenches + way) - link.peak(wrenches - way)) / (
                2 * step
            )
    return slopes
