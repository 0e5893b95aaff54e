"""The support function of a convex zone, with a certificate."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_GAP = 3e-8  # relative, of a certified support


def largest_product(w: NDArray, bounds: Sequence[NDArray]) -> tuple[NDArray, float]:
    """Return the largest w.x where |bound @ x| <= 1, by an interior-point method.

    Args:
        w: (m,).
        bounds: (k, m) each, bounding every direction.

    Returns:
        (m,) x in the set, and a certified upper bound of the largest w.x: the sum of
        the sizes of multipliers with sum bound^T multiplier = w.
    """
    size = float(np.linalg.norm(w))
    if size == 0.0:
        return np.zeros_like(w), 0.0
    w = w / size
    # a value that is attained along w itself is the unit of all others
    size *= (unit := 1.0 / max(float(np.linalg.norm(b @ w)) for b in bounds))
    w, x, mu, best = w / unit, np.zeros_like(w), 1.0, np.inf
    rows = np.vstack(bounds)
    # a smaller mu leaves no digits in the Newton steps
    while best > (1 + _GAP) * max(float(w @ x), 0.0) and mu > 1e-9:
        for _ in range(50):
            slack = [1.0 - (b @ x) @ (b @ x) for b in bounds]
            parts = [2 * mu / s * (b @ x) for b, s in zip(bounds, slack, strict=True)]
            gradient = w - rows.T @ np.concatenate(parts)
            H = sum(
                2 * mu / s * (b.T @ b) + 4 * mu / s**2 * np.outer(g := b.T @ b @ x, g)
                for b, s in zip(bounds, slack, strict=True)
            )
            step = np.linalg.solve(H, gradient)
            decrement = float(gradient @ step) / mu
            length = 1.0 / (1.0 + np.sqrt(max(decrement, 0.0)))
            x = x + (length if decrement > 0.1 else 1.0) * step
            if decrement < 1e-16:
                break
        # multipliers of least change that balance w exactly
        change = np.linalg.lstsq(rows.T, gradient, rcond=None)[0]
        ends = np.cumsum([len(b) for b in bounds])[:-1]
        multipliers = np.split(np.concatenate(parts) + change, ends)
        best = min(best, sum(float(np.linalg.norm(part)) for part in multipliers))
        mu /= 10
    reach = max(float(np.linalg.norm(b @ x)) for b in bounds)
    return x / max(1.0, reach), best * size
