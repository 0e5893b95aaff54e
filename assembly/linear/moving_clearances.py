"""Call the compiled search for the largest pose error, problem (27)."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.energy import with_free_own_axes
from forcefit.assembly.linear.lanes import COMPILED, REFERENCE, bounds_side_by_side
from forcefit.assembly.linear.reference.pose_error import ASSUMPTIONS
from forcefit.assembly.linear.robot_structure import Structure, structure_of
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import OK
from forcefit.assembly.solvers.method import Method, check_method


@dataclass(frozen=True)
class Asked:
    """Settings for the computation of pose error bounds.

    Attributes:
        assumption: name from the table in :mod:`forcefit.assembly.linear.pose_error`.
        energy_budget: eta of the assumption ``budget``.
        tolerance_rotation: [rad] largest accepted difference between the upper and
            lower bound on the rotation.
        tolerance_translation: [m] largest accepted difference between the bounds on the
            translation.
        offset: (3,) [m] from the platform's origin to the point whose error is bounded.
        method: ``"compiled"`` or ``"reference"``.
    """

    assumption: str = "frozen"
    energy_budget: float = 0.05
    tolerance_rotation: float = 1e-6
    tolerance_translation: float = 1e-6
    offset: ArrayLike = (0.0, 0.0, 0.0)
    method: Method = "compiled"

    def __post_init__(self) -> None:
        if self.assumption not in ASSUMPTIONS:
            raise ValueError(
                f"assumption is {self.assumption!r}, expected one of {ASSUMPTIONS}"
            )
        check_method(self.method)


def compiled_bounds(assembly: Assembly, asked: Asked) -> tuple[dict[str, Any], NDArray]:
    """Bound the largest pose error at k points by the compiled search.

    Args:
        assembly: assembly of k points.
        asked: assumption, accuracy of the bounds and reference point.

    Returns:
        Mapping with ``rotation_error`` (k, 2) [rad] and ``translation_error`` (k, 2)
        [m], lower and upper bounds; ``rotation_screw`` and ``translation_screw`` (k, 6)
        [rad, m] that attain the lower bounds; and ``supports`` (k,) number of support
        functions evaluated.  Also an array (k,) that is True for points without bounds,
        because (22) has no solution or because they must be solved in numpy.
    """
    count, robot = len(assembly), assembly.posture.robot
    rows = {
        "rotation_error": np.full((count, 2), np.nan),
        "translation_error": np.full((count, 2), np.nan),
        "rotation_screw": np.full((count, 6), np.nan),
        "translation_screw": np.full((count, 6), np.nan),
        "supports": np.zeros(count, np.int64),
    }
    outcome = np.full(count, COMPILED, np.int64)
    left = assembly.status != OK
    if assembly.frame_loads:
        left |= assembly.loaded
    left[list(assembly.apart)] = True
    left |= ~np.isfinite(assembly.clearances).all(axis=1)
    outcome[left] = REFERENCE
    if asked.assumption == "budget" or asked.method == "reference" or left.all():
        return rows, np.ones(count, dtype=bool)
    solution = assembly
    if asked.assumption == "free":
        # Under this assumption, joints rotate freely about their own axes. A clearance
        # is fixed only if it remains loaded without the springs about these axes.
        solution = with_free_own_axes(assembly)
        outcome[~np.isfinite(solution.clearances).all(axis=1)] = REFERENCE
    places = _places_of(robot, asked.assumption)
    motions = np.zeros((count, len(places.moving.free_bound)))
    motions[:, places.bounded] = assembly.motions[:, places.motions]
    centres = (
        assembly.platform_screw.copy(),
        np.ascontiguousarray(assembly.clearances[:, places.columns]),
        motions,
    )
    loads = (
        np.require(solution.multipliers, requirements=["C", "W"]),
        np.require(solution.clearances, requirements=["C", "W"]),
        solution.energy, solution.energy_without_clearance, places.cone_of,
    )  # fmt: skip
    T = assembly.posture.transforms
    T = T.copy() if T.ndim > 3 else np.repeat(T[None], count, axis=0)
    tolerance = [asked.tolerance_rotation, asked.tolerance_translation]
    bounds_side_by_side(
        places.moving, T, np.full(count, assembly.posture.mismatch, dtype=float),
        centres, places.loaded, loads,
        (np.array(asked.offset, float), np.array(tolerance, float)),
        (*rows.values(), outcome),
    )  # fmt: skip
    return rows, outcome != COMPILED


class _Places(NamedTuple):
    """Clearances and motions that can change under an assumption of (27).

    Attributes:
        moving: structure of the robot with the columns that can change.
        loaded: structure for which (22) is solved to identify the loaded clearances.
        columns: (nu,) columns in (22) of the clearances that can change.
        cone_of: (cones,) cones of ``loaded`` that contain these clearances.
        bounded: free motions that have a bound.
        motions: indices of these motions in (22).
    """

    moving: Structure
    loaded: Structure
    columns: NDArray
    cone_of: NDArray
    bounded: NDArray
    motions: NDArray


@lru_cache(maxsize=32)
def _places_of(robot: Robot, assumption: str) -> _Places:
    """Return the clearances and motions that can change under an assumption."""
    own_axes_free = assumption == "free"
    moving = structure_of(robot, False, own_axes_free)[1]
    all_of = structure_of(robot)[1]
    loaded = structure_of(robot, True, True)[1] if own_axes_free else all_of
    own = _columns(moving.cone_frame, moving.cone_axis)
    in_loaded = _indices(own, _columns(loaded.cone_frame, loaded.cone_axis))
    cone_of = np.searchsorted(loaded.starts, in_loaded, side="right") - 1
    bounded = np.flatnonzero(np.isfinite(moving.free_bound))
    free = _columns(moving.free_frame[bounded], moving.free_axis[bounded])
    return _Places(
        moving=moving,
        loaded=loaded,
        columns=_indices(own, _columns(all_of.cone_frame, all_of.cone_axis)),
        cone_of=cone_of[moving.starts[:-1]].astype(np.int64),
        bounded=bounded,
        motions=_indices(free, _columns(all_of.free_frame, all_of.free_axis)),
    )


def _columns(frames: NDArray, axes: NDArray) -> list[tuple[int, int]]:
    """Return the frame and the axis of each column as pairs of indices."""
    return list(zip(frames.tolist(), axes.tolist(), strict=True))


def _indices(some: list[tuple[int, int]], among: list[tuple[int, int]]) -> NDArray:
    """Return the index of each pair of frame and axis in another list of pairs."""
    return np.array([among.index(one) for one in some], dtype=np.int64)
