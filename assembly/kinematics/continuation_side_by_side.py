"""Continuation to several targets side by side, by ``continuation.cpp``.

The same steps and thresholds as :mod:`assembly.kinematics.compiled_continuation`, one
target in each lane of the processor's vector registers.  No lane depends on another.
"""

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.track import Track
from forcefit.native.libraries import address, load_library

SOURCE = "assembly/kinematics/continuation.cpp"
_ARRAYS = ("parents", "kinds", "pairs", "moves", "groups", "fixed")


class TreeAddresses(ctypes.Structure):
    """``Tree`` of continuation.cpp; ``arrays`` are kept as long as it is."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("n", "closures", "platform")),
        ("size", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in _ARRAYS),
    )


class _Targets(ctypes.Structure):
    """``Targets`` of continuation.cpp."""

    _fields_ = (
        ("count", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in ("start", "poses", "held")),
        ("guess", ctypes.c_int64),
    )


def tree_of(fields: dict[str, Any]) -> TreeAddresses:
    """A robot's tree for C++.

    Args:
        fields: of :class:`assembly.kinematics.compiled_continuation.Tree`.

    Returns:
        The addresses of its arrays.
    """
    tree = TreeAddresses(
        len(fields["parents"]), len(fields["pairs"]), fields["platform"],
        fields["size"], *(address(fields[name]) for name in _ARRAYS),
    )  # fmt: skip
    tree.arrays = fields
    return tree


def follow_side_by_side(
    tree: TreeAddresses, start: NDArray, poses: NDArray, held: NDArray, guess: bool,
    track: Track,
) -> bool:  # fmt: skip
    """Follow every target along its straight line.

    Args:
        tree: of the robot.
        start: (n,) coordinates at home.
        poses: (k, 6) ``[tx ty tz rx ry rz]``, NaN where free; no rows if not asked.
        held: (k, n) coordinates, NaN where free.
        guess: the start is one, and does not close: one step, of any length.
        track: to fill.

    Returns:
        Whether it did; not where there is no compiler.
    """
    library = load_library(SOURCE)
    if library is None:
        return False
    out = (track.coordinates, track.progress, track.transforms, track.closure_mismatch)
    if len(held) == 1:
        _follow(library, tree, (start, poses, held), guess, out)
        return True
    asked = np.isfinite(np.hstack([poses, held]) if len(poses) else held)
    left = np.arange(len(held))
    while left.size:
        # those of a call ask for the same entries
        same = (asked[left] == asked[left[0]]).all(axis=1)
        rows, left = left[same], left[~same]
        whole = len(rows) == len(held)
        filled = out if whole else tuple(array[rows] for array in out)
        given = (start, poses[rows[: len(poses)]], held[rows])
        _follow(library, tree, given, guess, filled)
        if not whole:
            for array, part in zip(out, filled, strict=True):
                array[rows] = part
    return True


def _follow(
    library: ctypes.CDLL, tree: TreeAddresses, given: tuple[NDArray, NDArray, NDArray],
    guess: bool, out: tuple[NDArray, ...],
) -> None:  # fmt: skip
    """Targets that ask for the same entries: start, poses and held coordinates."""
    arrays = [np.ascontiguousarray(array) for array in given]
    targets = _Targets(
        len(arrays[2]), *(address(a) if a.size else None for a in arrays), guess
    )
    tracks = (ctypes.c_void_p * len(out))(*map(address, out))
    library.follow_all(ctypes.byref(tree), ctypes.byref(targets), tracks)
