"""Compiled continuation to several targets in parallel.

Each element of the processor's vector registers follows one target independently.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kernels.choice import kernels
from forcefit.assembly.kinematics.track import Track


def tree_of(fields: dict[str, Any]) -> Any:
    """Return the kinematic tree of a robot as a C++ object.

    Args:
        fields: arrays and numbers of the C++ structure ``Tree``.

    Returns:
        The tree with checked arrays.

    Raises:
        ValueError: the shape, type or memory order of an array is wrong.
    """
    return kernels.Tree(**fields)


def follow_side_by_side(
    tree: Any, start: NDArray, poses: NDArray, held: NDArray, guess: bool,
    track: Track,
) -> None:  # fmt: skip
    """Move the robot to every target along a straight line.

    Args:
        tree: tree of the robot.
        start: (n,) coordinates at home.
        poses: (k, 6) ``[tx ty tz rx ry rz]``, NaN for free components; no rows if no
            poses are given.
        held: (k, n) coordinates, NaN for free coordinates.
        guess: whether the closures are open at ``start``.  In this case, a single step
            of unlimited length is made.
        track: track to fill.
    """
    out = (track.coordinates, track.progress, track.transforms, track.closure_mismatch)
    if len(held) == 1:
        _follow(tree, (start, poses, held), guess, out)
        return
    asked = np.isfinite(np.hstack([poses, held]) if len(poses) else held)
    left = np.arange(len(held))
    while left.size:
        # The targets of one call must prescribe the same components.
        same = (asked[left] == asked[left[0]]).all(axis=1)
        rows, left = left[same], left[~same]
        whole = len(rows) == len(held)
        filled = out if whole else tuple(array[rows] for array in out)
        given = (start, poses[rows[: len(poses)]], held[rows])
        _follow(tree, given, guess, filled)
        if not whole:
            for array, part in zip(out, filled, strict=True):
                array[rows] = part


def _follow(
    tree: Any, given: tuple[NDArray, NDArray, NDArray], guess: bool,
    out: tuple[NDArray, ...],
) -> None:  # fmt: skip
    """Follow targets that prescribe the same components."""
    kernels.follow_all(tree, *map(np.ascontiguousarray, given), guess, *out)
