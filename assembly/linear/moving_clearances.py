"""Problem (27) as the compiled search reads it, and its call."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.linear.assembled import Assembly
from assembly.linear.energy import with_free_own_axes
from assembly.linear.lanes import bounds_side_by_side
from assembly.linear.reach import READINGS
from assembly.linear.robot_structure import Structure, structure_of
from assembly.linear.solutions import (
    FALLBACK,
    SOLVED,
    Bounds,
    Centres,
    ClearanceLoads,
)
from assembly.model.clearance import Compliant
from assembly.model.robot import Robot
from assembly.solvers.method import Method, check_method


@dataclass(frozen=True)
class Asked:
    """What is asked about the largest pose error.

    Attributes:
        reading: see the head of :mod:`assembly.linear.pose_error`.
        energy_budget: eta of reading ``budget``.
        tolerance_rotation: [rad] asked of upper minus lower bound.
        tolerance_translation: [m] likewise.
        offset: (3,) [m] from the platform's origin to the point whose error is meant.
        method: ``"compiled"`` or ``"reference"``.
    """

    reading: str = "frozen"
    energy_budget: float = 0.05
    tolerance_rotation: float = 1e-6
    tolerance_translation: float = 1e-6
    offset: ArrayLike = (0.0, 0.0, 0.0)
    method: Method = "compiled"

    def __post_init__(self) -> None:
        if self.reading not in READINGS:
            raise ValueError(f"reading is {self.reading!r}, expected one of {READINGS}")
        check_method(self.method)


def compiled_bounds(
    robot: Robot, transforms: NDArray, off: NDArray, errors: ArrayLike | None,
    energies: Assembly, asked: Asked,
) -> Bounds:  # fmt: skip
    """Bounds of k points; NaN in the rows that are left to numpy.

    Args:
        robot: of n frames.
        transforms: (k, n, 4, 4) frames seen from the base.
        off: (k,) [rad, m] nominal closure error of the frames.
        errors: (n, 6) or (k, n, 6) [rad, m]; the robot's if absent.
        energies: of the same points.
        asked: reading, widths and point.

    Returns:
        The bounds and where they come from.
    """
    T = np.require(transforms, dtype=float, requirements=["C", "W"])
    count = len(T)
    bounds = Bounds(
        rotation=np.full((count, 2), np.nan),
        translation=np.full((count, 2), np.nan),
        rotation_screw=np.full((count, 6), np.nan),
        translation_screw=np.full((count, 6), np.nan),
        supports=np.zeros(count, np.int64),
        outcome=np.full(count, SOLVED, np.int64),
    )
    left = (energies.status != "ok") | energies.loaded
    left |= ~np.isfinite(energies.clearances).all(axis=1)
    bounds.outcome[left] = FALLBACK
    if asked.reading == "budget" or asked.method == "reference" or left.all():
        bounds.outcome[:] = FALLBACK
        return bounds
    solution = energies
    if asked.reading == "free":
        # turning about the own axis costs nothing here: a clearance is held only if it
        # stays loaded without those soft springs
        solution = with_free_own_axes(energies)
        bounds.outcome[~np.isfinite(solution.clearances).all(axis=1)] = FALLBACK
    places = _places_of(robot, asked.reading)
    loads = ClearanceLoads(
        structure=places.loaded,
        multipliers=np.require(solution.multipliers, requirements=["C", "W"]),
        clearances=np.require(solution.clearances, requirements=["C", "W"]),
        energy=solution.energy,
        without_clearance=solution.energy_without_clearance,
        cone_of=places.cone_of,
    )
    motions = np.zeros((count, len(places.moving.free_bound)))
    motions[:, places.bounded] = energies.motions[:, places.motions]
    centres = Centres(
        screws=energies.platform_screw.copy(),
        clearances=np.ascontiguousarray(energies.clearances[:, places.columns]),
        motions=motions,
    )
    tolerance = [asked.tolerance_rotation, asked.tolerance_translation]
    given = (
        places.moving, T, off, centres, loads,
        (np.array(asked.offset, float), np.array(tolerance, float)),
    )  # fmt: skip
    bounds_side_by_side(*given, bounds)
    return bounds


class _Places(NamedTuple):
    """What a reading lets move, and where that is in (22).

    Attributes:
        moving: what may move.
        loaded: the robot of the solution of (22) that says which clearances are held.
        columns: (nu,) columns in (22) of the clearances that move.
        cone_of: (cones,) cones of ``loaded`` likewise.
        bounded: free motions that have a bound.
        motions: their places in (22).
    """

    moving: Structure
    loaded: Structure
    columns: NDArray
    cone_of: NDArray
    bounded: NDArray
    motions: NDArray


@lru_cache(maxsize=32)
def _places_of(robot: Robot, reading: str) -> _Places:
    """Places of one reading, once for each robot."""
    rigid: Compliant = "free" if reading == "free" else "rigid"
    moving, all_of = structure_of(robot, rigid)[1], structure_of(robot)[1]
    loaded = structure_of(robot, "hinged")[1] if reading == "free" else all_of
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
    """Frame and axis of every column."""
    return list(zip(frames.tolist(), axes.tolist(), strict=True))


def _indices(some: list[tuple[int, int]], among: list[tuple[int, int]]) -> NDArray:
    """Where the same frames and axes are in another reading."""
    return np.array([among.index(one) for one in some], dtype=np.int64)
