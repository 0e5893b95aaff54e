"""The billiard walk through the set of clearance positions; compiled.

Sources:
    Gryazina, Polyak (2014), Random sampling: billiard walk algorithm.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.solvers.compiled import kernel
from assembly.solvers.vectors import vector

FLIGHT = 2.0  # mean time; Dikin's ellipsoid is crossed in about one
REFLECTIONS = 20  # of a trajectory at most, for each dimension
_FRACTION = 0.9  # of the way to the boundary


@kernel
def start_chains(
    M: NDArray, starts: NDArray, u: NDArray, rng: np.random.Generator, walks: NDArray
) -> None:
    """Starts of the chains: close to the boundary in random directions.

    Args:
        M: (nu, n) axes of Dikin's ellipsoid.
        starts: (cones + 1,) first column of each cone, and nu.
        u: (nu,) its centre.
        rng: of random numbers.
        walks: (chains, nu) overwritten.
    """
    for chain in range(len(walks)):
        direction = _direction(M, rng)
        reach, _ = _distance_to_bound(starts, u, direction, np.inf)
        for c in range(len(u)):
            walks[chain, c] = u[c] + _FRACTION * reach * direction[c]


class Positions(NamedTuple):
    """The set of clearance positions.

    Attributes:
        M: (nu, n) axes of Dikin's ellipsoid.
        gram: (nu, nu) M M^T.
        starts: (cones + 1,) first column of each cone, and nu.
        to_screw: (6, nu) [rad, m] from u to the platform's screw.
    """

    M: NDArray
    gram: NDArray
    starts: NDArray
    to_screw: NDArray


@kernel
def walk(
    positions: Positions, u: NDArray, every: int, rng: np.random.Generator,
    trace: NDArray,
) -> None:  # fmt: skip
    """Continue a chain; its platform screw is kept every so many trajectories.

    Args:
        positions: the set.
        u: (nu,) the chain's point, overwritten.
        every: number of trajectories between two screws.
        rng: of random numbers.
        trace: (kept, 6) [rad, m] overwritten with the screws.
    """
    M, gram, starts, to_screw = positions
    for k in range(len(trace)):
        for _ in range(every):
            _move(M, gram, starts, u, rng)
        for a in range(6):
            trace[k, a] = 0.0
            for c in range(len(u)):
                trace[k, a] += to_screw[a, c] * u[c]


@kernel
def _move(
    M: NDArray, gram: NDArray, starts: NDArray, u: NDArray, rng: np.random.Generator
) -> None:
    """A trajectory in a random direction, reflected at every bound it meets.

    In coordinates y, u = M y, the ellipsoid is a ball; the reflection at the normals
    M_k^T u_k of y needs M M^T only.
    """
    w, left = _direction(M, rng), FLIGHT * rng.standard_exponential()
    v = u.copy()
    for _ in range(REFLECTIONS * (M.shape[1] + 1)):
        reach, wall = _distance_to_bound(starts, v, w, left)
        for c in range(len(v)):
            v[c] += reach * w[c]
        if wall < 0:
            for c in range(len(v)):
                u[c] = v[c]
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
    # too many reflections, as in a corner: u is kept, which preserves reversibility


@kernel
def _direction(M: NDArray, rng: np.random.Generator) -> NDArray:
    """(nu,) random direction, normal with the covariance of Dikin's ellipsoid."""
    nu, n = M.shape
    w = vector(nu)
    for i in range(n):
        speed = rng.standard_normal()
        for c in range(nu):
            w[c] += speed * M[c, i]
    return w


@kernel
def _distance_to_bound(
    starts: NDArray, v: NDArray, w: NDArray, left: float
) -> tuple[float, int]:
    """Distance along w from v to the nearest bound, and its cone; -1 if none."""
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
