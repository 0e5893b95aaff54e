"""Random points in products of unit balls from uniform random numbers."""

import numpy as np
from numpy.typing import NDArray

VOLUMES = {1: 2.0, 2: np.pi, 3: 4 * np.pi / 3}  # volume of the unit ball, by dimension


def in_balls(
    uniform: NDArray, dimensions: tuple[int, ...], distribution: str = "uniform",
    s: float = 0.0,
) -> NDArray:  # fmt: skip
    """Transform uniform random numbers to points in a product of unit balls.

    Args:
        uniform: uniform random numbers between 0 and 1, (k, m) or with more columns.
        dimensions: dimension of each ball, with the sum m.
        distribution: ``"uniform"``, ``"truncated"`` or ``"normal"``.  Points of the
            normal distribution may be outside the balls.
        s: standard deviation of each coordinate for ``"normal"`` and ``"truncated"``.

    Returns:
        Points, (k, m).
    """
    ends = np.cumsum(dimensions)
    parts = np.split(uniform[:, : ends[-1]], ends[:-1], axis=1)
    return np.hstack([_in_ball(part, distribution, s) for part in parts])


def _in_ball(uniform: NDArray, distribution: str, s: float) -> NDArray:
    """Transform uniform random numbers (k, d) to points in a unit ball, (k, d)."""
    from scipy.special import gammainc, gammaincinv

    d = uniform.shape[1]
    v = abs(2 * uniform[:, 0] - 1) if d == 1 else uniform[:, 0]
    if distribution == "uniform":
        radius = v ** (1 / d)
    else:
        share = gammainc(d / 2, 0.5 / s**2) if distribution == "truncated" else 1.0
        radius = s * np.sqrt(2 * gammaincinv(d / 2, np.minimum(v, 1 - 2**-53) * share))
    if d == 1:
        return np.asarray(np.copysign(radius, uniform[:, 0] - 0.5))[:, None]
    angle = 2 * np.pi * uniform[:, 1]
    across, along = radius, None
    if d == 3:
        height = 2 * uniform[:, 2] - 1
        across, along = radius * np.sqrt(1 - height**2), radius * height
    plane = [across * np.cos(angle), across * np.sin(angle)]
    return np.column_stack(plane if along is None else [*plane, along])


def ball_variance(d: int, distribution: str, s: float) -> float:
    """Return the variance of a coordinate of random points in a unit ball."""
    if distribution == "uniform":
        return 1.0 / (d + 2)
    if distribution == "normal":
        return s**2
    from scipy.special import gammainc

    limit = 0.5 / s**2
    return float(s**2 * gammainc(d / 2 + 1, limit) / gammainc(d / 2, limit))
