"""Points uniform in the set where play may sit, by billiards.

The set is {u : rows (u - start) = 0, |u_k| <= 1 for each cone k}.  Near the edge of a
zone it is thin in some directions, and a walk with steps alike in all would hardly move
along the others.  So flights start in directions of Dikin's ellipsoid at the analytic
centre, which has the set's own proportions: it lies within, and the set is no farther
from it than the number of cones.  Stretching the set changes nothing.

A flight goes straight on and is mirrored at every bound it meets, as a billiard ball
is, for a random time: it crosses the set several times where a step of hit-and-run
ends at the first bound.  Several walks from different places are compared.  They are
made longer by two, what came before left out, until split R-hat and the effective
sample size of every component of the platform's screw say that all have forgotten
where they began.

Sources:
    Gryazina, Polyak (2014), Random sampling: billiard walk algorithm; Nesterov,
    Nemirovski (1994), ch. 2 (Dikin's ellipsoid); Gelman et al. (2013), Bayesian Data
    Analysis, 11.4-11.5 (split R-hat, effective sample size).
"""

import numpy as np
from numpy.typing import NDArray

CHAINS, KEPT = 4, 64  # walks, and points of each that are compared
R_HAT, EFFECTIVE = 1.05, 100.0  # most, and least
DOUBLINGS = 10  # of the walks: flights of a draw, 4 x 65 472 at most
_STILL = 1e-12  # [rad or m] deviation of a component that does not move
_NEWTON = 300


def settle_uniformly(
    Z: NDArray, starts: NDArray, to_screw: NDArray, u: NDArray,
    rng: np.random.Generator, doublings: int = DOUBLINGS,
) -> bool:  # fmt: skip
    """A point uniform in the set.

    Args:
        Z: (nu, n) orthonormal columns: the directions in which u may move.
        starts: (cones + 1,) first column of each cone, and nu.
        to_screw: (6, nu) [rad, m] what u does to the platform.
        u: (nu,) a point of the set, overwritten with the new one.
        rng: of random numbers.
        doublings: of the walks, at most.

    Returns:
        Whether the walks met the criterion; u stays where the set has no inside.
    """
    from assembly.statistics.billiard_walk import begin_apart, walk

    if Z.shape[1] == 0:
        return True
    found = _ellipsoid(Z, starts, u)
    if found is None:
        return False
    centre, M = found
    gram = M @ M.T
    walks = np.empty((CHAINS, len(u)))
    begin_apart(M, starts, centre, rng, walks)
    trace = np.empty((CHAINS, KEPT, 6))
    mixed = False
    for k in range(doublings):
        for c in range(CHAINS):
            walk(M, gram, starts, to_screw, walks[c], 2**k, rng, trace[c])
        mixed = is_mixed(trace)
        if mixed:
            break
    u[:] = walks[0]
    return mixed


def _ellipsoid(
    Z: NDArray, starts: NDArray, start: NDArray
) -> tuple[NDArray, NDArray] | None:
    """The analytic centre and (nu, n) the axes of Dikin's ellipsoid there.

    Least of -sum log(rho^2 - |u_k|^2) by Newton's method, damped so that it stays
    inside; rho begins where the start is inside and shrinks to 1.

    Returns:
        Both, each axis a column; None where the set has no inside.
    """
    u, heads = start.copy(), starts[:-1]
    cone = np.repeat(np.arange(len(heads)), np.diff(starts))
    most = _largest(heads, u)
    rho = 1.0 if most < 0.95 else 1.1 * most
    for _ in range(_NEWTON):
        slack = rho * rho - np.add.reduceat(u * u, heads)
        y = np.add.reduceat(u[:, None] * Z, heads, axis=0)
        g = 2.0 * (1.0 / slack) @ y
        H = (Z.T * (2.0 / slack[cone])) @ Z + (y.T * (4.0 / slack**2)) @ y
        try:
            step = np.linalg.solve(H, -g)
            # M M^T = Z H^-1 Z^T
            M = np.linalg.solve(np.linalg.cholesky(H), Z.T).T
        except np.linalg.LinAlgError:  # thinner than numbers can tell: no inside
            return None
        decrement = np.sqrt(max(0.0, -float(g @ step)))
        if rho == 1.0 and decrement < 1e-3:
            return u, np.ascontiguousarray(M)
        u += Z @ (step / (1.0 + decrement))
        if rho > 1.0 and decrement < 0.5:
            most = _largest(heads, u)
            if most < 1.0:
                rho = 1.0
            elif rho - most < 1e-9:
                return None
            else:
                rho = most + 0.5 * (rho - most)
    return None


def _largest(heads: NDArray, u: NDArray) -> float:
    """How far the fullest cone is filled."""
    return float(np.sqrt(np.add.reduceat(u * u, heads).max()))


def is_mixed(trace: NDArray) -> bool:
    """Whether every component (chains, kept, components) that moves is mixed."""
    moving = trace[:, :, trace.std(axis=(0, 1)) > _STILL]
    return all(
        # written so that what is not a number fails
        r_hat <= R_HAT and effective >= EFFECTIVE
        for r_hat, effective in map(diagnose, np.moveaxis(moving, 2, 0))
    )


def diagnose(x: NDArray) -> tuple[float, float]:
    """Split R-hat and effective sample size of one component.

    Args:
        x: (chains, 2 k) values along each chain; the halves count as chains.

    Returns:
        Both; R-hat nears 1 as the chains forget where they began.
    """
    k = x.shape[1] // 2
    halves = x[:, : 2 * k].reshape(-1, k)
    m = len(halves)
    means = halves.mean(axis=1)
    halves = halves - means[:, None]
    within = float((halves**2).sum()) / (m * (k - 1))
    whole = within * (k - 1) / k + float(means.var()) * m / (m - 1)
    r_hat = np.sqrt(whole / within)
    # Geyer: sums of neighbouring correlations, until one is not positive, not rising
    time, before = -1.0, np.inf
    for lag in range(0, k - 1, 2):
        pair = 0.0
        for t in (lag, lag + 1):
            covariance = float((halves[:, : k - t] * halves[:, t:]).sum())
            pair += 1.0 - (within - covariance / (m * (k - 1))) / whole
        pair = min(pair, before)
        if not pair > 0.0:
            break
        time, before = time + 2.0 * pair, pair
    return r_hat, m * k / max(time, 1.0 / np.log10(m * k))
