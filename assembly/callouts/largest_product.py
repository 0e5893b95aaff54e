"""The support function of a convex zone, with a certificate."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_GAP = 3e-8  # relative, of a certified support
_LEAST_MU = 1e-9  # a smaller barrier leaves no digits in the Newton steps
_STEPS = 50  # most Newton steps of one barrier


def largest_product(w: NDArray, bounds: Sequence[NDArray]) -> tuple[NDArray, float]:
    """Return the largest w.x where |bound @ x| <= 1, by an interior-point method.

    Args:
        w: (m,).
        bounds: (k, m) each, bounding every direction.

    Returns:
        (m,) x in the set, and a certified upper bound of the largest w.x: the sum of
        the sizes of multipliers with sum bound^T multiplier = w.
    """
    length = float(np.linalg.norm(w))
    if length == 0.0:
        return np.zeros_like(w), 0.0
    # a value that is attained along w itself is the unit of all others
    reached = 1.0 / max(float(np.linalg.norm(b @ w)) for b in bounds)
    unit = length * length * reached
    w = w / unit
    rows, x, mu = np.vstack(bounds), np.zeros_like(w), 1.0
    best = float(np.abs(np.linalg.lstsq(rows.T, w, rcond=None)[0]).sum())
    ends = np.cumsum([len(b) for b in bounds])[:-1]
    while best > (1 + _GAP) * max(float(w @ x), 0.0) and mu > _LEAST_MU:
        centre = _centre(w, bounds, x, mu)
        if centre is None:  # rounding: what is certified so far remains
            break
        x, multipliers = centre
        # the least change that balances w exactly
        change = np.linalg.lstsq(rows.T, w - rows.T @ multipliers, rcond=None)[0]
        parts = np.split(multipliers + change, ends)
        best = min(best, sum(float(np.linalg.norm(part)) for part in parts))
        mu /= 10
    outside = max(1.0, *(float(np.linalg.norm(b @ x)) for b in bounds))
    return x / outside, best * unit


def _centre(
    w: NDArray, bounds: Sequence[NDArray], x: NDArray, mu: float
) -> tuple[NDArray, NDArray] | None:
    """The largest w.x + mu sum log(1 - |bound x|^2) and its multipliers, from x."""
    for _ in range(_STEPS):
        slacks = [1.0 - float((b @ x) @ (b @ x)) for b in bounds]
        gradient, H = w.copy(), np.zeros((len(w), len(w)))
        for b, slack in zip(bounds, slacks, strict=True):
            g = b.T @ (b @ x)
            gradient -= 2 * mu / slack * g
            H += 2 * mu / slack * (b.T @ b) + 4 * mu / slack**2 * np.outer(g, g)
        try:
            step = np.linalg.solve(H, gradient)
        except np.linalg.LinAlgError:
            return None
        decrement = float(gradient @ step) / mu
        if not 0.0 <= decrement < np.inf or min(slacks) <= 0.0:
            return None
        if decrement < 1e-16:
            break
        x = x + (1.0 / (1.0 + np.sqrt(decrement)) if decrement > 0.1 else 1.0) * step
    parts = [2 * mu / s * (b @ x) for b, s in zip(bounds, slacks, strict=True)]
    return x, np.concatenate(parts)
