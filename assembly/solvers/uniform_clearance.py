"""Sample uniformly distributed joint positions within clearances by a billiard walk.

The set of positions is {u : rows (u - start) = 0, |u_k| <= 1 for each cone k}.  Near
the edge of an assembly zone, this set is thin in some directions.  Directions are
therefore sampled from the Dikin ellipsoid at the analytic centre.  The ellipsoid is
inside the set, and the set is inside the ellipsoid multiplied by the number of cones.

A trajectory is straight for a random time and is reflected at every bound.  Chains from
different initial points are compared.  Their length is doubled until the split R-hat
and the effective sample size of the platform screw satisfy their criteria.  The first
half of each chain is discarded.

Sources:
    Gryazina, Polyak (2014), Random sampling: billiard walk algorithm; Nesterov,
    Nemirovski (1994), ch. 2 (Dikin's ellipsoid); Gelman et al. (2013), Bayesian Data
    Analysis, 11.4-11.5 (split R-hat, effective sample size).
"""

import numpy as np
from numpy.typing import NDArray

# number of chains, and number of points of each chain
CHAINS, KEPT = 4, 64
# largest accepted split R-hat, and smallest accepted effective sample size
R_HAT, EFFECTIVE = 1.05, 100.0
# largest number of doublings of the chain length
DOUBLINGS = 10
_CONSTANT = 1e-12  # [rad or m] standard deviation of a constant component
_NEWTON = 300  # largest number of Newton iterations


def sample_uniform_position(
    Z: NDArray, starts: NDArray, to_screw: NDArray, u: NDArray,
    rng: np.random.Generator, doublings: int = DOUBLINGS,
) -> bool:  # fmt: skip
    """Replace u by a sample from the uniform distribution over the set.

    Args:
        Z: (nu, n) orthonormal columns of the directions in which u can move.
        starts: (cones + 1,) index of the first clearance of each cone, then nu.
        to_screw: (6, nu) [rad, m] map from u to the platform screw.
        u: (nu,) a point of the set, overwritten with the sample.
        rng: generator of random numbers.
        doublings: largest number of doublings of the chains.

    Returns:
        Whether the chains have mixed.  If the set has an empty interior, u does not
        change.
    """
    from forcefit.assembly.solvers.billiard_walk import Positions

    if Z.shape[1] == 0:
        return True
    ellipsoid = _ellipsoid(Z, starts, u)
    if ellipsoid is None:
        return False
    centre, M = ellipsoid
    positions = Positions(M, starts, to_screw)
    walks = np.empty((CHAINS, len(u)))
    positions.start_chains(centre, rng, walks)
    trace = np.empty((CHAINS, KEPT, 6))
    mixed = False
    for k in range(doublings):
        for c in range(CHAINS):
            positions.walk(walks[c], 2**k, rng, trace[c])
        mixed = is_mixed(trace)
        if mixed:
            break
    u[:] = walks[0]
    return mixed


def _ellipsoid(
    Z: NDArray, starts: NDArray, start: NDArray
) -> tuple[NDArray, NDArray] | None:
    """Return the analytic centre of the set, and the axes of Dikin's ellipsoid.

    Damped Newton steps minimise -sum log(rho^2 - |u_k|^2).  The radius rho decreases to
    1 from a value for which the start point is inside.

    Returns:
        Centre (nu,) and axes (nu, n); None if the set has an empty interior.
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
            decrement = np.sqrt(max(0.0, -float(g @ step)))
            if rho == 1.0 and decrement < 1e-3:
                # M M^T = Z H^-1 Z^T
                M = np.linalg.solve(np.linalg.cholesky(H), Z.T).T
                return u, np.ascontiguousarray(M)
        except np.linalg.LinAlgError:  # The set has an empty interior.
            return None
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
    """Return the largest norm of the components of u in one cone."""
    return float(np.sqrt(np.add.reduceat(u * u, heads).max()))


def is_mixed(trace: NDArray) -> bool:
    """Return whether the chains have mixed in all components that vary."""
    moving = trace[:, :, trace.std(axis=(0, 1)) > _CONSTANT]
    return all(
        # With NaN, the comparison is False, so the chains are not mixed.
        r_hat <= R_HAT and effective >= EFFECTIVE
        for r_hat, effective in map(diagnose, np.moveaxis(moving, 2, 0))
    )


def diagnose(x: NDArray) -> tuple[float, float]:
    """Compute split R-hat and the effective sample size of one component.

    Args:
        x: (chains, 2 k) values along each chain; each half is treated as a chain.

    Returns:
        R-hat and effective sample size.  R-hat is 1 for chains that are independent of
        their initial points, and infinite if no chain moves.
    """
    k = x.shape[1] // 2
    halves = x[:, : 2 * k].reshape(-1, k)
    m = len(halves)
    means = halves.mean(axis=1)
    halves = halves - means[:, None]
    within = float((halves**2).sum()) / (m * (k - 1))
    if within == 0.0:
        return np.inf, 0.0
    whole = within * (k - 1) / k + float(means.var()) * m / (m - 1)
    r_hat = np.sqrt(whole / within)
    # Geyer's initial monotone sequence is the sum of pairs of autocorrelations while
    # they are positive and decrease.
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
