"""The worst that errors within tolerances can do, bracketed.

Margin and energy are convex in the errors, so the worst lies where every error is at
one end of its tolerance.  Going from such a corner to the one its slopes point to never
lowers either: from many corners this gives a lower bound, as it does of a wrench, a
stress or a pose error, whose worst may lie elsewhere.  An upper bound comes from
play that answers every error in proportion, ``u = sum_i V_i s_i`` for errors
``t_i s_i``, abs(s_i) <= 1: one cone programme, whose V proves the bound by itself.

Sources:
    Ben-Tal, El Ghaoui, Nemirovski (2009), Robust Optimization, ch. 14 (affinely
    adjustable decisions).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.batch.many_draws import OnePosture
from assembly.batch.many_margins import PostureMargins
from assembly.model.error_distributions import ErrorSources
from assembly.statistics.responses import respond

CORNERS = 24  # to start from
_STEPS = 12  # from corner to corner; most searches end after three


@dataclass(frozen=True, eq=False)
class Corner:
    """The worst corner of the tolerances that was found.

    Attributes:
        value: the quantity there: a lower bound of the worst.
        signs: (m,) of the errors, -1 or 1.
        slopes: (m,) [its unit per rad or m] of the value with each error.
    """

    value: float
    signs: NDArray
    slopes: NDArray


def worst_corner(
    ready: PostureMargins | OnePosture, sources: ErrorSources, tolerances: NDArray,
    corners: NDArray, key: str = "energy", play: str = "worst",
) -> Corner:  # fmt: skip
    """Climb from corner to corner; the best end of all.

    Args:
        ready: a posture prepared for margins, or for energies and all others.
        sources: m of them; only their places count.
        tolerances: (m,) [rad or m] half widths.
        corners: (k, m) signs to start from.
        key: which quantity, see :func:`assembly.statistics.responses.respond`.
        play: see there.

    Returns:
        The worst corner found.
    """
    signs = corners.copy()
    if isinstance(ready, OnePosture):
        # where play takes up all of an error the energy has no slope to follow
        signs = np.vstack([
            signs,
            _worst_without_play(ready, sources, tolerances, signs),
        ])
    best = Corner(-np.inf, signs[0], np.zeros(len(sources)))
    for _ in range(_STEPS):
        values, slopes = respond(ready, sources, signs * tolerances, key, play)
        i = int(np.argmax(np.where(np.isnan(values), -np.inf, values)))
        if values[i] > best.value:
            best = Corner(float(values[i]), signs[i].copy(), slopes[i].copy())
        steeper = np.where(slopes == 0.0, signs, np.sign(slopes))
        steeper = np.where(np.isnan(slopes), signs, steeper)
        signs = np.unique(steeper[(steeper != signs).any(axis=1)], axis=0)
        if not len(signs):
            break
    return best


def _worst_without_play(
    ready: OnePosture, sources: ErrorSources, tolerances: NDArray, corners: NDArray
) -> NDArray:
    """(k, m) signs where the search ends if no clearance gives way: (h s)^2 / 2."""
    h = ready.misfit[:, 6 * sources.frame + sources.component] * tolerances
    signs = corners
    for _ in range(_STEPS):
        slopes = signs @ (h.T @ h)
        signs = np.where(slopes == 0.0, signs, np.sign(slopes))
    return np.unique(signs, axis=0)


def random_corners(count: int, sources: int, seed: int = 1) -> NDArray:
    """(count, sources) signs to start from."""
    return np.random.default_rng(seed).choice([-1.0, 1.0], size=(count, sources))


def bound_margin(
    zone: PostureMargins, sources: ErrorSources, tolerances: NDArray
) -> float:
    """Upper bound of the worst margin over all errors within tolerances.

    Args:
        zone: a posture prepared for margins, every clearance scaled by the margin.
        sources: m of them.
        tolerances: (m,) [rad or m] half widths.

    Returns:
        The bound; inf where some error is taken up by no clearance.
    """
    columns = 6 * sources.frame + sources.component
    if np.abs(zone.infeasible[:, columns] * tolerances).max(initial=0.0) > 1e-12:
        return np.inf
    if not len(zone.B):
        return 0.0
    asked = zone.K[:, columns] * tolerances
    V = _proportional_play(zone.B, asked, zone.starts, None, None)
    V += zone.B.T @ (asked - zone.B @ V)
    return float(_reach(V, zone.starts).max())


def bound_energy(one: OnePosture, sources: ErrorSources, tolerances: NDArray) -> float:
    """Upper bound of the largest energy over all errors within tolerances.

    Args:
        one: a posture prepared for energies.
        sources: m of them.
        tolerances: (m,) [rad or m] half widths.

    Returns:
        [J] the bound: springs that give way to every error in proportion need no more;
        the sizes of what they give way are added up, so it may be several times the
        worst.  inf where some error is taken up by no spring.
    """
    columns = 6 * sources.frame + sources.component
    if np.abs(one.infeasible[:, columns] * tolerances).max(initial=0.0) > 1e-12:
        return np.inf
    h = one.misfit[:, columns] * tolerances
    V = np.zeros((one.G.shape[1], len(tolerances)))
    if one.G.size:
        none = np.zeros((0, V.shape[0])), np.zeros((0, V.shape[1]))
        V = _proportional_play(*none, one.starts, one.G, h)
        V = V / max(1.0, float(_reach(V, one.starts).max()))
    return float(np.linalg.norm(one.G @ V + h, axis=0).sum() ** 2 / 2)


def _reach(V: NDArray, starts: NDArray) -> NDArray:
    """(cones,) most that play proportional to the errors asks of each cone."""
    return np.sqrt(np.add.reduceat(V**2, starts[:-1], axis=0)).sum(axis=1)


def _proportional_play(
    B: NDArray, asked: NDArray, starts: NDArray, G: NDArray | None, h: NDArray | None
) -> NDArray:
    """(nu, m) V with B V = asked that asks least of the cones, or of the springs."""
    import cvxpy as cp

    nu, m = starts[-1], asked.shape[1]
    size = np.linalg.norm(asked) or 1.0
    V, most = cp.Variable((nu, m)), cp.Variable()
    single = starts[:-1][np.diff(starts) == 1]
    double = starts[:-1][np.diff(starts) == 2]
    limit = most if G is None else 1.0
    held = []
    if len(single):
        held.append(cp.sum(cp.abs(V[single, :]), axis=1) <= limit)
    if len(double):
        pairs = cp.vstack([cp.vec(V[double + i, :], order="C") for i in (0, 1)])
        sizes = cp.reshape(cp.norm(pairs, 2, axis=0), (len(double), m), order="C")
        held.append(cp.sum(sizes, axis=1) <= limit)
    if G is None or h is None:
        held.append(B @ V == asked / size)
        goal = cp.Minimize(most)
    else:
        size, scale = 1.0, np.linalg.norm(h) or 1.0
        goal = cp.Minimize(cp.sum(cp.norm((G @ V + h) / scale, 2, axis=0)))
    cp.Problem(goal, held).solve(solver="CLARABEL")
    return V.value * size
