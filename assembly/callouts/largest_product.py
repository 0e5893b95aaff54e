"""Support function of a convex tolerance zone, with a certified upper bound."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

_GAP = 3e-8  # accepted relative duality gap
_LEAST_MU = 1e-9  # smallest barrier parameter; below it, rounding errors dominate
_STEPS = 50  # maximum number of Newton steps for each barrier parameter


def largest_product(
    w: NDArray, bounds: Sequence[NDArray], cones: Sequence[NDArray] = ()
) -> tuple[NDArray, float]:
    """Maximise w.x subject to |bound @ x| <= 1 with an interior-point method.

    Args:
        w: coefficients, (m,).
        bounds: matrices (k, m), which together bound all directions.
        cones: matrices (k, m) that consist of a row s and rows S, and define a double
            cone |s.x| + |S x| <= 1.

    Returns:
        Feasible point x, (m,), and an upper bound on the maximum.  The upper bound is
        the sum of the dual norms of multipliers with sum bound^T multiplier = w.
    """
    x, value, _ = product_by_bounds(w, bounds, cones)
    return x, value


def product_by_bounds(
    w: NDArray, bounds: Sequence[NDArray], cones: Sequence[NDArray] = ()
) -> tuple[NDArray, float, NDArray]:
    """Maximise w.x, and return the contribution of each bound to the upper bound.

    Args:
        w: coefficients, (m,).
        bounds: see :func:`largest_product`.
        cones: see :func:`largest_product`.

    Returns:
        Feasible point x, upper bound, and contributions of ``bounds`` and ``cones``.  A
        contribution is the dual norm of the multiplier.  It is the derivative of the
        upper bound with respect to the logarithm of the size of the bound or cone.
    """
    length = float(np.linalg.norm(w))
    if length == 0.0:
        return np.zeros_like(w), 0.0, np.zeros(len(bounds) + len(cones))
    # the problem is scaled by the value of the largest feasible multiple of w
    reached = 1.0 / max(_largest_gauge(w, bounds, cones), 1e-300)
    unit = length * length * reached
    w = w / unit
    rows, x, mu = np.vstack([*bounds, *cones]), np.zeros_like(w), 1.0
    start = np.abs(np.linalg.lstsq(rows.T, w, rcond=None)[0])
    best = float(start.sum())
    ends = np.cumsum([len(b) for b in (*bounds, *cones)])[:-1]
    of_bounds = [float(part.sum()) for part in np.split(start, ends)]
    while best > (1 + _GAP) * max(float(w @ x), 0.0) and mu > _LEAST_MU:
        centre = _centre(w, bounds, cones, x, mu)
        if centre is None:  # rounding errors; the best upper bound is returned
            break
        x, multipliers = centre
        # smallest change of the multipliers that satisfies sum bound^T multiplier = w
        change = np.linalg.lstsq(rows.T, w - rows.T @ multipliers, rcond=None)[0]
        parts = np.split(multipliers + change, ends)
        count = len(bounds)
        sizes = [float(np.linalg.norm(part)) for part in parts[:count]]
        sizes += [
            max(abs(part[0]), float(np.linalg.norm(part[1:]))) for part in parts[count:]
        ]
        if sum(sizes) < best:
            best, of_bounds = sum(sizes), sizes
        mu /= 10
    outside = max(1.0, _largest_gauge(x, bounds, cones))
    return x / outside, best * unit, np.array(of_bounds) * unit


def _largest_gauge(
    x: NDArray, bounds: Sequence[NDArray], cones: Sequence[NDArray]
) -> float:
    """Return the gauge of x, which is 1 on the boundary of the feasible set."""
    sizes = [float(np.linalg.norm(b @ x)) for b in bounds]
    sizes += [abs(c[0] @ x) + float(np.linalg.norm(c[1:] @ x)) for c in cones]
    return max(sizes)


def _centre(
    w: NDArray, bounds: Sequence[NDArray], cones: Sequence[NDArray], x: NDArray,
    mu: float,
) -> tuple[NDArray, NDArray] | None:  # fmt: skip
    """Maximise w.x + mu sum log(1 - |bound x|^2), and return x and the multipliers."""
    # barrier of a double cone: log((1 - s.x)^2 - |S x|^2) + log((1 + s.x)^2 - |S x|^2)
    for _ in range(_STEPS):
        slacks = [1.0 - float((b @ x) @ (b @ x)) for b in bounds]
        gradient, H = w.copy(), np.zeros((len(w), len(w)))
        for b, slack in zip(bounds, slacks, strict=True):
            g = b.T @ (b @ x)
            gradient -= 2 * mu / slack * g
            H += 2 * mu / slack * (b.T @ b) + 4 * mu / slack**2 * np.outer(g, g)
        for signed, f in _halves(cones, x):
            slacks.append(f)
            g = _slope(signed, x)
            gradient += mu / f * g
            curvature = signed[1:].T @ signed[1:] - np.outer(signed[0], signed[0])
            H += 2 * mu / f * curvature + mu / f**2 * np.outer(g, g)
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
    parts = [
        2 * mu / slack * (b @ x)
        for b, slack in zip(bounds, slacks[: len(bounds)], strict=True)
    ]
    halves = list(_halves(cones, x))
    for (plus, f), (minus, h) in zip(halves[::2], halves[1::2], strict=True):
        along = (1.0 - plus[0] @ x) / f - (1.0 - minus[0] @ x) / h
        across = (1.0 / f + 1.0 / h) * (plus[1:] @ x)
        parts.append(2 * mu * np.concatenate([[along], across]))
    return x, np.concatenate(parts)


def _halves(cones: Sequence[NDArray], x: NDArray) -> Iterator[tuple[NDArray, float]]:
    """Yield the rows and the slack of both halves |S x| <= 1 -+ s.x of double cones."""
    for cone in cones:
        for sign in (1.0, -1.0):
            signed = np.vstack([sign * cone[:1], cone[1:]])
            height = 1.0 - float(signed[0] @ x)
            across = float(np.linalg.norm(signed[1:] @ x))
            # both factors are positive inside the cone
            yield signed, (height - across) * (height + across)


def _slope(cone: NDArray, x: NDArray) -> NDArray:
    """Return the gradient of (1 - s.x)^2 - |S x|^2, (m,)."""
    return np.asarray(
        -2.0 * (1.0 - cone[0] @ x) * cone[0] - 2.0 * cone[1:].T @ (cone[1:] @ x)
    )
