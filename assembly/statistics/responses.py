"""What errors do to a limited quantity, and its slopes with each of them."""

import numpy as np
from numpy.typing import NDArray

from assembly.link_stress import LinkStress, stressed_links
from assembly.solvers.one_posture import Draws, OnePosture
from assembly.solvers.posture_margins import PostureMargins
from assembly.statistics.distributions import ErrorSources
from assembly.statistics.sensitivity import solution_slopes

_STEP = 1e-6  # of a wrench, to differentiate a formula of stress
_PARTS = {"moment": slice(0, 3), "force": slice(3, 6), "rotation": slice(0, 3),
          "translation": slice(3, 6)}  # fmt: skip


def respond(
    ready: PostureMargins | OnePosture, sources: ErrorSources, values: NDArray,
    key: str = "energy",
) -> tuple[NDArray, NDArray]:  # fmt: skip
    """A quantity for given errors, and its slopes with each of them.

    Args:
        ready: a posture prepared for margins, or for energies and all others.
        sources: m of them.
        values: (k, m) [rad or m].
        key: which quantity, of a posture prepared for energies: energy [J], force [N],
            moment [N m], stress [Pa], rotation [rad] or translation [m].

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
    quantity = _of_screw if key in {"rotation", "translation"} else _of_wrenches
    size = np.full(len(values), np.nan)
    slopes = np.full(errors.shape, np.nan)
    solved = np.flatnonzero(np.isfinite(found.energy))
    if len(solved):
        some = _rows(found, solved)
        size[solved], by_wrench, by_screw = quantity(
            ready, key, wrenches[solved], some.platform_screw
        )
        slopes[solved] = solution_slopes(ready, some, by_wrench, by_screw)
    return size, slopes[:, sources.frame, sources.component]


def _rows(found: Draws, rows: NDArray) -> Draws:
    """Some of the draws."""
    return Draws(*(getattr(found, name)[rows] for name in Draws.__dataclass_fields__))


def _of_screw(
    ready: OnePosture, key: str, wrenches: NDArray, screws: NDArray
) -> tuple[NDArray, NDArray, NDArray]:
    """Size of a part of the platform's screw, and its slopes with everything."""
    slopes = np.zeros_like(screws)
    size, slopes[:, _PARTS[key]] = _size(screws[:, _PARTS[key]])
    return size, np.zeros_like(wrenches), slopes


def _of_wrenches(
    ready: OnePosture, key: str, wrenches: NDArray, screws: NDArray
) -> tuple[NDArray, NDArray, NDArray]:
    """The largest moment, force or stress, and its slopes with everything."""
    slopes, draws = np.zeros_like(wrenches), np.arange(len(wrenches))
    if key != "stress":
        sizes, own = _size(wrenches[:, :, _PARTS[key]])
        worst = sizes.argmax(axis=1)
        slopes[draws, worst, _PARTS[key]] = own[draws, worst]
        return sizes[draws, worst], slopes, np.zeros_like(screws)
    links = stressed_links(ready.posture.robot)
    peaks = np.stack([link.peak(wrenches[:, link.row]) for link in links], axis=1)
    worst = peaks.argmax(axis=1)
    for i, link in enumerate(links):
        some = np.flatnonzero(worst == i)
        slopes[some, link.row] = _stress_slopes(link, wrenches[some, link.row])
    return peaks[draws, worst], slopes, np.zeros_like(screws)


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
