"""Lower and upper bounds on a quantity over all errors within tolerances.

Margin and energy are convex in the errors, so their maximum is at a corner of the
tolerance box. Each step of the search moves to the corner that the signs of the
derivatives select. The largest value found is a lower bound on the maximum, even if
the quantity is not convex. For the upper bound, the clearances are restricted to
linear functions of the errors, ``u = sum_i V_i s_i`` for errors ``t_i s_i`` with
abs(s_i) <= 1. A cone programme computes the optimal V.

Sources:
    Ben-Tal, El Ghaoui, Nemirovski (2009), Robust Optimization, ch. 14 (affinely
    adjustable decisions).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.error_distributions import ErrorSources
from forcefit.assembly.statistics.linear_response import LinearResponse
from forcefit.assembly.statistics.posture_margins import PostureMargins
from forcefit.assembly.statistics.responses import respond

CORNERS = 24  # number of random starting corners of the search
# largest number of steps of a search
_ITERATIONS = 12


@dataclass(frozen=True, eq=False)
class Corner:
    """Worst corner found in the tolerance box.

    Attributes:
        value: value of the quantity at the corner, a lower bound on its maximum.
        signs: (m,) signs of the errors, -1 or 1.
        slopes: (m,) [unit of the value per rad or m] derivatives with respect to the
            errors.
    """

    value: float
    signs: NDArray
    slopes: NDArray


def worst_corner(
    prepared: PostureMargins | LinearResponse, sources: ErrorSources,
    tolerances: NDArray, corners: NDArray, key: str = "energy",
    clearance: str = "worst",
    contact_length: float | None = None,
) -> Corner:  # fmt: skip
    """Search for the worst corner of the tolerance box.

    Args:
        prepared: prepared problem (21) for a margin, or linear response for another
            quantity.
        sources: m errors, whose distributions are not used.
        tolerances: (m,) [rad or m] half widths of the tolerances.
        corners: (k, m) signs of the errors at the start of each search.
        key: the quantity, see :func:`forcefit.assembly.statistics.responses.respond`.
        clearance: clearance model, see the same function.
        contact_length: [m] contact length, see the same function.

    Returns:
        The worst corner.
    """
    signs = corners.copy()
    if isinstance(prepared, LinearResponse):
        # The derivative of the energy is zero if clearances compensate all errors.
        # Corners of large energy without clearances are therefore additional starts.
        signs = np.vstack([
            signs,
            _worst_without_clearance(prepared, sources, tolerances, signs),
        ])
    best = Corner(-np.inf, signs[0], np.zeros(len(sources)))
    for _ in range(_ITERATIONS):
        values, slopes = respond(
            prepared, sources, signs * tolerances, key, clearance, contact_length
        )
        i = int(np.argmax(np.where(np.isnan(values), -np.inf, values)))
        if values[i] > best.value:
            best = Corner(float(values[i]), signs[i].copy(), slopes[i].copy())
        steeper = np.where(slopes == 0.0, signs, np.sign(slopes))
        steeper = np.where(np.isnan(slopes), signs, steeper)
        signs = np.unique(steeper[(steeper != signs).any(axis=1)], axis=0)
        if not len(signs):
            break
    return best


def _worst_without_clearance(
    prepared: LinearResponse, sources: ErrorSources, tolerances: NDArray,
    corners: NDArray,
) -> NDArray:  # fmt: skip
    """Return signs (k, m) with a large energy (h s)^2 / 2 without clearances."""
    h = prepared.misfit[:, 6 * sources.frame + sources.component] * tolerances
    signs = corners
    for _ in range(_ITERATIONS):
        slopes = signs @ (h.T @ h)
        signs = np.where(slopes == 0.0, signs, np.sign(slopes))
    return np.unique(signs, axis=0)


def random_corners(count: int, sources: int, seed: int = 1) -> NDArray:
    """Return the signs of the errors at random corners, (count, sources)."""
    return np.random.default_rng(seed).choice([-1.0, 1.0], size=(count, sources))


def bound_margin(
    zone: PostureMargins, sources: ErrorSources, tolerances: NDArray
) -> float:
    """Return an upper bound on the margin for all errors within tolerances.

    Args:
        zone: prepared problem (21) of a posture.
        sources: the m errors, with their distributions.
        tolerances: (m,) [rad or m] half widths of the tolerances.

    Returns:
        The bound; inf if no clearance can compensate one of the errors.
    """
    columns = 6 * sources.frame + sources.component
    if np.abs(zone.infeasible[:, columns] * tolerances).max(initial=0.0) > 1e-12:
        return np.inf
    if not len(zone.B):
        return 0.0
    asked = zone.K[:, columns] * tolerances
    V = _affine_clearances(zone.B, asked, zone.starts, None, None)
    V += zone.B.T @ (asked - zone.B @ V)
    return float(_reach(V, zone.starts).max())


def bound_energy(
    prepared: LinearResponse, sources: ErrorSources, tolerances: NDArray
) -> float:
    """Return an upper bound on the energy over all errors within tolerances.

    Args:
        prepared: linear response of a posture.
        sources: the m errors, with their distributions.
        tolerances: (m,) [rad or m] half widths of the tolerances.

    Returns:
        Bound [J]; inf if no clearance or spring can compensate one of the errors. It
        is a sum of norms over all errors, which can be several times as large as the
        maximum.
    """
    columns = 6 * sources.frame + sources.component
    if np.abs(prepared.infeasible[:, columns] * tolerances).max(initial=0.0) > 1e-12:
        return np.inf
    h = prepared.misfit[:, columns] * tolerances
    V = np.zeros((prepared.G.shape[1], len(tolerances)))
    if prepared.G.size:
        none = np.zeros((0, V.shape[0])), np.zeros((0, V.shape[1]))
        V = _affine_clearances(*none, prepared.starts, prepared.G, h)
        V = V / max(1.0, float(_reach(V, prepared.starts).max()))
    return float(np.linalg.norm(prepared.G @ V + h, axis=0).sum() ** 2 / 2)


def _reach(V: NDArray, starts: NDArray) -> NDArray:
    """Return the largest norm of each affine clearance over all errors, (cones,)."""
    return np.sqrt(np.add.reduceat(V**2, starts[:-1], axis=0)).sum(axis=1)


def _affine_clearances(
    B: NDArray, asked: NDArray, starts: NDArray, G: NDArray | None, h: NDArray | None
) -> NDArray:
    """Return V, (nu, m), with B V = asked; for given G, with minimum energy bound."""
    import cvxpy as cp

    nu, m = starts[-1], asked.shape[1]
    size = np.linalg.norm(asked) or 1.0
    V, largest = cp.Variable((nu, m)), cp.Variable()
    single = starts[:-1][np.diff(starts) == 1]
    limit = largest if G is None else 1.0
    constraints = []
    if len(single):
        constraints.append(cp.sum(cp.abs(V[single, :]), axis=1) <= limit)
    for width in (2, 3):
        heads = starts[:-1][np.diff(starts) == width]
        if len(heads):
            of_cone = [cp.vec(V[heads + i, :], order="C") for i in range(width)]
            sizes = cp.norm(cp.vstack(of_cone), 2, axis=0)
            sizes = cp.reshape(sizes, (len(heads), m), order="C")
            constraints.append(cp.sum(sizes, axis=1) <= limit)
    if G is None or h is None:
        constraints.append(B @ V == asked / size)
        goal = cp.Minimize(largest)
    else:
        size, scale = 1.0, np.linalg.norm(h) or 1.0
        goal = cp.Minimize(cp.sum(cp.norm((G @ V + h) / scale, 2, axis=0)))
    cp.Problem(goal, constraints).solve(solver="CLARABEL")
    return V.value * size
