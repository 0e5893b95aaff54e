"""Estimate the device pose and find exchanged targets and blunders."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

# Multiple of the scatter of all readings above which a deviation is an outlier.
_GROSS = 20.0
# Targets are regarded as exchanged if their exchange reduces the residual below this
# fraction of its value.
_BETTER = 0.25
_MOST = 6  # largest number of targets for which every order is tried


@dataclass(frozen=True, eq=False)
class DeviceFrame:
    """Transformation from device axes to base axes: base = rotation @ device + shift.

    Attributes:
        rotation: (3, 3) rotation from the axes of the device to the axes of the base.
        shift: (3,) [m] origin of the device in base axes.
    """

    rotation: NDArray
    shift: NDArray

    def to_base(self, points: NDArray) -> NDArray:
        """Transform (..., 3) [m] points from device axes to base axes."""
        return points @ self.rotation.T + self.shift


def fit_frame(measured: NDArray, nominal: NDArray) -> DeviceFrame:
    """Return the device frame that fits measured to nominal points by least squares.

    Args:
        measured: (N, 3) [m] points in device axes.
        nominal: (N, 3) [m] points in base axes.

    Returns:
        The frame.
    """
    a, b = measured.mean(axis=0), nominal.mean(axis=0)
    U, _, Vt = np.linalg.svd((measured - a).T @ (nominal - b))
    sign = np.sign(np.linalg.det(Vt.T @ U.T))
    R = Vt.T @ np.diag([1.0, 1.0, sign]) @ U.T
    return DeviceFrame(R, b - R @ a)


def spans_a_plane(points: NDArray) -> bool:
    """Return whether points (N, 3) are not collinear and thus determine a frame."""
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return len(points) > 2 and bool(sizes[1] > 1e-6 * sizes[0] > 0)


def robust_frame(measured: NDArray, nominal: NDArray) -> tuple[DeviceFrame, float]:
    """Fit the device frame and estimate the scatter, excluding outliers.

    Args:
        measured: (N, 3) [m] points in device axes.
        nominal: (N, 3) [m] points in base axes.

    Returns:
        The frame, and the standard deviation [m] of one coordinate of the points.
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
    """Return the scatter [m] estimated from the median of distances (N,)."""
    # The median length of a Gaussian vector in three dimensions is 1.538 times the
    # standard deviation of one component.
    return float(np.median(gaps)) / 1.538 + 1e-12


def is_gross(gap: float, scatter: float) -> bool:
    """Return whether a distance [m] is too large for the scatter [m]."""
    return gap > _GROSS * scatter


def exchanged_throughout(
    measured: Sequence[NDArray], nominal: Sequence[NDArray]
) -> tuple[int, ...] | None:
    """Return the order of the targets if another order fits much better.

    Args:
        measured: positions of each target in device axes, (R, 3) [m]; NaN if not
            measured.
        nominal: nominal positions of each target in base axes, (R, 3) [m].

    Returns:
        For each target, the index of the target that was measured under its name.  None
        if the names are correct.
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
    """Return the order of the targets in one row if targets were exchanged.

    Args:
        measured: (k, 3) [m] points in base axes.
        nominal: (k, 3) [m] points in base axes.
        scatter: [m] scatter of all readings.

    Returns:
        For each target, the index of the target that was measured under its name.  None
        if no targets were exchanged.
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
