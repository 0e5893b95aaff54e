"""The largest pose error of the platform: problem (27) with certified bounds.

As printed, (27) is degenerate: with the deformations frozen at the solution of (22),
complementary slackness fixes every loaded clearance.  So there are three readings of
what may still move:

======== =================================================================
frozen   all deformations stay; only unloaded clearances move (the paper)
free     compliant joints also turn freely about their own axis
budget   everything that closes with at most (1 + eta) times the least energy
======== =================================================================

Passive joints keep within the bounds of their own motion.  Rotation and translation are
bounded each by itself: a tool on a bearing turns freely, and its point still has a
largest error.

The set of platform screws (:mod:`assembly.linear.reach`) is convex; its farthest one is
bracketed by :mod:`assembly.solvers.farthest`, compiled, with Clarabel as its fallback.
Many postures at once: :func:`assembly.batch.many_pose_errors.bound_pose_errors`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.linear.assembled import Assembly
from assembly.linear.certificate import unproved
from assembly.linear.reach import ReachableSet, reachable_screws
from forcefit.inputs.display import Figures, bracket, html_table, short_repr


@dataclass(frozen=True, eq=False)
class PoseError:
    """Certified bounds of the largest pose error, and screws that attain the lower.

    Attributes:
        reading: ``"frozen"``, ``"free"`` or ``"budget"``.
        rotation_error: [rad] (lower, upper) bounds.
        translation_error: [m] (lower, upper) bounds.
        rotation_screw: (6,) [rad, m] attains the lower bound of the rotation.
        translation_screw: (6,) [rad, m] attains that of the translation.
        cuts: support functions computed.
        unproved: what of the solution of (22), or of the width asked of the bounds, is
            not proved; empty if nothing.
    """

    reading: str
    rotation_error: tuple[float, float]
    translation_error: tuple[float, float]
    rotation_screw: NDArray
    translation_screw: NDArray
    cuts: int
    unproved: str = ""

    __repr__, _repr_html_, summary = short_repr, html_table, short_repr

    def _figures(self) -> Figures:
        """What ``forcefit assembly error`` prints of it."""
        figures = {
            "reading": self.reading,
            "rotation": bracket(self.rotation_error, "mrad"),
            "translation": bracket(self.translation_error, "mm"),
        }
        return figures | ({"not proved": self.unproved} if self.unproved else {})


def bound_pose_error(
    assembly: Assembly,
    reading: str = "frozen",
    energy_budget: float = 0.05,
    tolerance_rotation: float = 1e-6,
    tolerance_translation: float = 1e-6,
    offset: ArrayLike = (0.0, 0.0, 0.0),
) -> PoseError:
    """Bracket the largest rotation and translation error of the platform.

    Args:
        assembly: of least energy, without a load in reading ``budget``.
        reading: see the head of this module.
        energy_budget: eta of reading ``budget``.
        tolerance_rotation: [rad] asked of upper minus lower bound.
        tolerance_translation: [m] likewise.
        offset: (3,) [m] from the platform's origin to the point whose error is meant.

    Returns:
        Bounds; wider than asked only if 400 supports did not suffice, which
        ``unproved`` then says; infinite where the platform can turn, or its point
        move, without bound.

    Raises:
        ValueError: the reading is unknown, or ``budget`` is asked under a load.
        SolverFailed: the cone solver gave up.
    """
    reachable = reachable_screws(assembly, reading, energy_budget).at_point(offset)
    rotation, rotation_screw, supports = _farthest(reachable, 0, tolerance_rotation)
    translation, translation_screw, more = _farthest(
        reachable, 3, tolerance_translation
    )
    open_ = (
        unproved(assembly),
        _too_wide("rotation", rotation, tolerance_rotation, "rad"),
        _too_wide("translation", translation, tolerance_translation, "m"),
    )
    return PoseError(
        reading=reading,
        rotation_error=rotation,
        translation_error=translation,
        rotation_screw=rotation_screw,
        translation_screw=translation_screw,
        cuts=supports + more,
        unproved="; ".join(filter(None, open_)),
    )


def _too_wide(
    part: str, bounds: tuple[float, float], tolerance: float, unit: str
) -> str:
    """That bounds are farther apart than asked, if they are."""
    low, high = bounds
    # both infinite: the platform can move without bound
    if high - low <= tolerance or low == high:
        return ""
    return (
        f"the bounds of the {part} are {high - low:.1e} {unit} apart, "
        f"expected {tolerance:.1e}"
    )


def _farthest(
    reachable: ReachableSet, part: int, tolerance: float
) -> tuple[tuple[float, float], NDArray, int]:
    """Bounds of the largest size of half a screw, a screw, and the supports it took."""
    from assembly.solvers.farthest import NEEDED, begin_search, search_on

    if reachable.unbounded(part):
        return (np.inf, np.inf), reachable.centre, 0
    body = reachable.body
    search, nothing = begin_search(body, part, tolerance), np.zeros(0)
    state = search_on(body, search, 0.0, nothing, nothing)
    while state == NEEDED:
        support = reachable.support(search.direction @ np.eye(6)[part : part + 3])
        state = search_on(body, search, support.height, support.screw, support.gradient)
    low, high = search.bounds.tolist()
    return (low, high), search.best, int(search.counts[1])
