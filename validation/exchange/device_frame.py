"""Pose of the device, exchanged targets, and blunders among readings.

Sources:
    Kabsch (1976), A solution for the best rotation to relate two sets of vectors, Acta
    Crystallographica A32, 922.
    Rousseeuw, Croux (1993), Alternatives to the median absolute deviation: 1.4826 MAD
    is one standard deviation of Gaussian scatter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

# multiple of the scatter of all readings that is impossible for a machine
_GROSS = 20.0
# relative to the misfit: largest misfit with which an exchange is accepted
_BETTER = 0.25
_MOST = 6  # largest number of targets whose exchanges are all tried, 720 of them


@dataclass(frozen=True, eq=False)
class DeviceFrame:
    """Pose of the base in the device's axes: base = rotation @ device + shift.

    Attributes:
        rotation: (3, 3) rotation from the device's to the base's axes.
        shift: (3,) [m] origin of the device in base axes.
    """

    rotation: NDArray
    shift: NDArray

    def to_base(self, points: NDArray) -> NDArray:
        """Return (..., 3) [m] points, given in device axes, in base axes."""
        return points @ self.rotation.T + self.shift


def fit_frame(measured: NDArray, nominal: NDArray) -> DeviceFrame:
    """Return the frame that brings measured points nearest to nominal points.

    Args:
        measured: (N, 3) [m] points in device axes.
        nominal: (N, 3) [m] points in base axes.

    Returns:
        The least-squares frame.
    """
    a, b = measured.mean(axis=0), nominal.mean(axis=0)
    U, _, Vt = np.linalg.svd((measured - a).T @ (nominal - b))
    sign = np.sign(np.linalg.det(Vt.T @ U.T))
    R = Vt.T @ np.diag([1.0, 1.0, sign]) @ U.T
    return DeviceFrame(R, b - R @ a)


def spans_a_plane(points: NDArray) -> bool:
    """Return whether (N, 3) points determine a frame: they are not on one line."""
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return len(points) > 2 and bool(sizes[1] > 1e-6 * sizes[0] > 0)


def robust_frame(measured: NDArray, nominal: NDArray) -> tuple[DeviceFrame, float]:
    """Return the frame fitted without gross readings, and the scatter about it.

    Args:
        measured: (N, 3) [m] points in device axes.
        nominal: (N, 3) [m] points in base axes.

    Returns:
        The frame, and the scatter [m] of one component.
    """
    kept = np.ones(len(measured), dtype=bool)
    for _ in range(20):
        frame = fit_frame(measured[kept], nominal[kept])
        gaps = np.linalg.norm(frame.to_base(measured) - nominal, axis=1)
        scatter = scatter_of(gaps)
        now = gaps <= _GROSS * scatter
        if np.array_equal(now, kept) or not spans_a_plane(nominal[now]):
            break
        kept = now
    return frame, scatter


def scatter_of(gaps: NDArray) -> float:
    """Return the [m] robust scatter of (N,) distances; at least the rounding error."""
    # the median length of a Gaussian vector in space is 1.538 of one component's sigma
    return float(np.median(gaps)) / 1.538 + 1e-12


def is_gross(gap: float, scatter: float) -> bool:
    """Return whether a distance [m] is too large for the scatter [m]."""
    return gap > _GROSS * scatter


def exchanged_throughout(
    measured: Sequence[NDArray], nominal: Sequence[NDArray]
) -> tuple[int, ...] | None:
    """Return an order of the targets that fits far better than the given order.

    Args:
        measured: for each target (R, 3) [m] in device axes, NaN where not read.
        nominal: for each target (R, 3) [m] in base axes.

    Returns:
        For each target the index of the target that was read; None if the names are
        right.
    """
    count = len(measured)
    if not 2 <= count <= _MOST:
        return None
    misfits = {}
    for order in permutations(range(count)):
        a = np.concatenate(list(measured))
        b = np.concatenate([nominal[k] for k in order])
        read = np.isfinite(a).all(axis=1)
        frame = fit_frame(a[read], b[read])
        gaps = np.linalg.norm(frame.to_base(a[read]) - b[read], axis=1)
        misfits[order] = float(np.median(gaps))
    best = min(misfits, key=lambda order: misfits[order])
    own = misfits[tuple(range(count))]
    return best if misfits[best] < _BETTER * own else None


def exchanged_here(measured: NDArray, nominal: NDArray, scatter: float) -> (
    tuple[int, ...] | None
):  # fmt: skip
    """Return the targets of one row that were exchanged.

    Args:
        measured: (k, 3) [m] points in base axes.
        nominal: (k, 3) [m] points in base axes.
        scatter: [m] scatter of all readings.

    Returns:
        For each target the index of the target that was read; None if none was
        exchanged.
    """
    count = len(measured)
    own = np.linalg.norm(measured - nominal, axis=1).max(initial=0.0)
    if not 2 <= count <= _MOST or not is_gross(float(own), scatter):
        return None
    orders = list(permutations(range(count)))
    gaps = [
        np.linalg.norm(measured - nominal[list(order)], axis=1).max()
        for order in orders
    ]
    best = int(np.argmin(gaps))
    return orders[best] if gaps[best] < _BETTER * own else None
