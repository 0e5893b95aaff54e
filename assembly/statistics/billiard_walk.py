"""Points uniform in the set where play may sit, by billiards; compiled.

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
from numba import njit
from numpy.typing import NDArray

CHAINS, KEPT = 4, 64  # walks, and points of each that are compared
FLIGHT = 2.0  # mean time; Dikin's ellipsoid is crossed in about one
MIRRORS = 20  # of a flight at most, for each dimension
_OUT = 0.9
R_HAT, EFFECTIVE = 1.05, 100.0  # most, and least
DOUBLINGS = 10  # of the walks: flights of a draw, 4 x 65 472 at most
_STILL = 1e-12  # [rad or m] deviation of a component that does not move
_NEWTON = 300


@njit(cache=True, error_model="numpy", nogil=True)
def settle_uniformly(
    Z: NDArray, starts: NDArray, to_screw: NDArray, u: NDArray,
    rng: np.random.Generator, doublings: int = DOUBLINGS,
) -> bool:  # fmt: skip
    """A point uniform in the set.

    Args:
        Z: (nu, n) orthonormal columns: the directions in which u may move.
        starts: (cones + 1,) first column of each cone, and nu.
        to_screw: (6, nu) [rad, m] what u does to the platform.
        u: (nu,) a point of the set, left holding the new one.
        rng: of random numbers.
        doublings: of the walks, at most.

    Returns:
        Whether the walks met the criterion; u stays where the set has no inside.
    """
    if Z.shape[1] == 0:
        return True
    found, M = _ellipsoid(Z, starts, u)
    if not found:
        return False
    gram = M @ np.ascontiguousarray(M.T)
    walks = np.empty((CHAINS, len(u)))
    trace = np.empty((CHAINS, KEPT, 6))
    for c in range(CHAINS):
        # most of the way to the boundary in a random direction: they begin apart
        way = _direction(M, rng)
        walks[c] = u + _OUT * _until(starts, u, way, np.inf)[0] * way
    mixed = False
    for k in range(doublings):
        for c in range(CHAINS):
            _walk(M, gram, starts, to_screw, walks[c], 2**k, rng, trace[c])
        if is_mixed(trace):
            mixed = True
            break
    u[:] = walks[0]
    return mixed


@njit(cache=True, error_model="numpy", nogil=True)
def _ellipsoid(Z: NDArray, starts: NDArray, u: NDArray) -> tuple[bool, NDArray]:
    """Go to the analytic centre; whether there is one, and (nu, n) axes of Dikin's.

    Least of -sum log(rho^2 - |u_k|^2) by Newton's method, damped so that it stays
    inside; rho begins where the start is inside and shrinks to 1.

    Returns:
        Whether there is one; the axes, each a column.
    """
    nu, n = Z.shape
    y = np.zeros(n)
    H, g, M = np.empty((n, n)), np.empty(n), np.zeros((nu, n))
    most = _largest(starts, u)
    rho = 1.0 if most < 0.95 else 1.1 * most
    for _ in range(_NEWTON):
        H[:], g[:] = 0.0, 0.0
        for k in range(len(starts) - 1):
            slack = rho * rho
            y[:] = 0.0
            for c in range(starts[k], starts[k + 1]):
                slack -= u[c] * u[c]
                for i in range(n):
                    y[i] += u[c] * Z[c, i]
            for i in range(n):
                g[i] += 2.0 * y[i] / slack
                for j in range(i + 1):
                    along = 4.0 * y[i] * y[j] / slack**2
                    for c in range(starts[k], starts[k + 1]):
                        along += 2.0 * Z[c, i] * Z[c, j] / slack
                    H[i, j] += along
        for i in range(n):
            for j in range(i):
                H[j, i] = H[i, j]
        try:
            step = np.linalg.solve(H, -g)
        except Exception:  # thinner than numbers can tell: no inside
            return False, M
        decrement = np.sqrt(max(0.0, -np.sum(g * step)))
        if rho == 1.0 and decrement < 1e-3:
            try:
                C = np.linalg.cholesky(H)
            except Exception:
                return False, M
            # M M^T = Z H^-1 Z^T
            M[:] = Z @ np.ascontiguousarray(np.linalg.inv(C).T)
            return True, M
        step /= 1.0 + decrement
        u += Z @ step
        if rho > 1.0 and decrement < 0.5:
            most = _largest(starts, u)
            if most < 1.0:
                rho = 1.0
            elif rho - most < 1e-9:
                return False, M
            else:
                rho = most + 0.5 * (rho - most)
    return False, M


@njit(cache=True, error_model="numpy", nogil=True)
def _largest(starts: NDArray, u: NDArray) -> float:
    """How far the fullest cone is filled."""
    most = 0.0
    for k in range(len(starts) - 1):
        size = 0.0
        for c in range(starts[k], starts[k + 1]):
            size += u[c] * u[c]
        most = max(most, size)
    return np.sqrt(most)


@njit(cache=True, error_model="numpy", nogil=True)
def _walk(
    M: NDArray, gram: NDArray, starts: NDArray, to_screw: NDArray, u: NDArray,
    every: int, rng: np.random.Generator, trace: NDArray,
) -> None:  # fmt: skip
    """Walk on; u moves, and its platform screw is kept every so many flights."""
    for k in range(len(trace)):
        for _ in range(every):
            _fly(M, gram, starts, u, rng)
        for a in range(6):
            trace[k, a] = 0.0
            for c in range(len(u)):
                trace[k, a] += to_screw[a, c] * u[c]


@njit(cache=True, error_model="numpy", nogil=True)
def _fly(
    M: NDArray, gram: NDArray, starts: NDArray, u: NDArray, rng: np.random.Generator
) -> None:
    """A straight flight in a random direction, mirrored wherever it meets a bound.

    The ellipsoid is a ball to it: u = M y, mirrored at normals M_k^T u_k of y; M M^T is
    all that needs.
    """
    w, left = _direction(M, rng), FLIGHT * rng.standard_exponential()
    v = u.copy()
    for _ in range(MIRRORS * (M.shape[1] + 1)):
        reach, wall = _until(starts, v, w, left)
        for c in range(len(v)):
            v[c] += reach * w[c]
        if wall < 0:
            u[:] = v
            return
        left -= reach
        first, end = starts[wall], starts[wall + 1]
        across, size = 0.0, 0.0
        for a in range(first, end):
            across += v[a] * w[a]
            for b in range(first, end):
                size += v[a] * gram[a, b] * v[b]
        for a in range(first, end):
            turn = 2.0 * across / size * v[a]
            for c in range(len(w)):
                w[c] -= turn * gram[a, c]
    # too many mirrors, as in a corner: it stays, so that the way back is as likely


@njit(cache=True, error_model="numpy", nogil=True)
def _direction(M: NDArray, rng: np.random.Generator) -> NDArray:
    """(nu,) random, of Dikin's ellipsoid."""
    nu, n = M.shape
    w = np.zeros(nu)
    for i in range(n):
        speed = rng.standard_normal()
        for c in range(nu):
            w[c] += speed * M[c, i]
    return w


@njit(cache=True, error_model="numpy", nogil=True)
def _until(starts: NDArray, v: NDArray, w: NDArray, left: float) -> tuple[float, int]:
    """How far along w from v until a bound is met, and whose; -1 if none before."""
    reach, wall = left, -1
    for k in range(len(starts) - 1):
        ww, vw, vv = 0.0, 0.0, 0.0
        for c in range(starts[k], starts[k + 1]):
            ww += w[c] * w[c]
            vw += v[c] * w[c]
            vv += v[c] * v[c]
        if not ww > 1e-300:
            continue
        # a point on the boundary may lie outside by rounding
        root = np.sqrt(vw * vw + ww * max(0.0, 1.0 - vv))
        if root - vw < reach * ww:
            reach, wall = (root - vw) / ww, k
    return reach, wall


@njit(cache=True, error_model="numpy", nogil=True)
def is_mixed(trace: NDArray) -> bool:
    """Whether every component (chains, kept, components) that moves is mixed."""
    for a in range(trace.shape[2]):
        x = np.ascontiguousarray(trace[:, :, a])
        if x.std() <= _STILL:
            continue
        r_hat, effective = diagnose(x)
        # written so that what is not a number fails
        if not (r_hat <= R_HAT and effective >= EFFECTIVE):
            return False
    return True


@njit(cache=True, error_model="numpy", nogil=True)
def diagnose(x: NDArray) -> tuple[float, float]:
    """Split R-hat and effective sample size of one component.

    Args:
        x: (chains, 2 k) values along each chain; the halves count as chains.

    Returns:
        Both; R-hat nears 1 as the chains forget where they began.
    """
    k = x.shape[1] // 2
    halves = np.empty((2 * len(x), k))
    for c in range(len(x)):
        halves[2 * c], halves[2 * c + 1] = x[c, :k], x[c, k : 2 * k]
    m = len(halves)
    means = np.empty(m)
    for c in range(m):
        means[c] = halves[c].mean()
        halves[c] -= means[c]
    within = (halves**2).sum() / (m * (k - 1))
    whole = within * (k - 1) / k + means.var() * m / (m - 1)
    r_hat = np.sqrt(whole / within)
    # Geyer: sums of neighbouring correlations, until one is not positive, not rising
    time, before = -1.0, np.inf
    for lag in range(0, k - 1, 2):
        pair = 0.0
        for t in (lag, lag + 1):
            cov = 0.0
            for c in range(m):
                for i in range(k - t):
                    cov += halves[c, i] * halves[c, i + t]
            pair += 1.0 - (within - cov / (m * (k - 1))) / whole
        pair = min(pair, before)
        if not pair > 0.0:
            break
        time, before = time + 2.0 * pair, pair
    return r_hat, m * k / max(time, 1.0 / np.log10(m * k))
