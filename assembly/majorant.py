"""A second upper bound for (27): exact where outer approximation is slow.

A round body takes outer approximation about 1/gap cuts, since all directions are nearly
as good.  The support function is h(d) = min over n of linear terms + sum_k |w_k|, with
w = X^T d - H^T n.  For any sizes s_k > 0,

    |w_k|  <=  |w_k|^2 / (2 s_k)  +  s_k / 2,

equal where s_k = |w_k|.  With s taken from one direction, the minimum over n is a
quadratic in d, above h everywhere and equal to it there; its largest value on the unit
sphere is known by an eigenvalue problem.  Where the direction is the farthest point's,
the bound usually closes at once: a disc's or an ellipsoid's always does.

Sources:
    Conn, Gould, Toint (2000), Trust-Region Methods, section 7.3, for the largest value
    of a quadratic on a sphere.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import brentq

from assembly.conic import cone_sizes

_LEAST_SIZE = 1e-9  # of a cone that does not pull, relative to the largest


def majorant_bound(
    centre: NDArray, X: NDArray, H: NDArray, start: NDArray, group: NDArray, w: NDArray
) -> float:
    """Upper bound of |centre + X (v - start)| over unit cones with H (v - start) = 0.

    Args:
        centre: (3,).
        X: (3, nv).
        H: (p, nv) orthonormal rows.
        start: (nv,).
        group: (nv,) cone of each column.
        w: (nv,) pulls X^T d - H^T n at some direction d.

    Returns:
        The bound; infinite where nothing pulls.
    """
    sizes = cone_sizes(w, group)
    if sizes.max(initial=0.0) < 1e-150:
        return np.inf  # nothing pulls in this direction: it says nothing of others
    sizes = np.maximum(sizes, _LEAST_SIZE * sizes.max())
    inverse = 1.0 / sizes[group]
    # n minimises w.w/(2s) - w.start:  H (w/s - start) = 0
    S = cho_factor((H * inverse) @ H.T) if len(H) else None

    def solve(right: NDArray) -> NDArray:
        return right if S is None else cho_solve(S, right)

    N = solve((H * inverse) @ X.T)
    offset = solve(H @ start)
    A = X.T - H.T @ N  # w = A d + H^T offset, the minimiser's
    fixed = H.T @ offset
    Q = (A * inverse[:, None]).T @ A
    linear = centre + (A * inverse[:, None]).T @ fixed - A.T @ start
    constant = sizes.sum() / 2 + float(fixed @ (inverse * fixed)) / 2
    constant -= float(fixed @ start)
    return constant + largest_on_sphere(Q, linear)


def largest_on_sphere(Q: NDArray, g: NDArray) -> float:
    """Largest value of d.Q d/2 + g.d over unit vectors d.

    Args:
        Q: (3, 3) symmetric.
        g: (3,).

    Returns:
        The value, from above by at most rounding.
    """
    values, vectors = np.linalg.eigh(Q)
    g = vectors.T @ g
    top = values[-1]
    size = max(float(np.linalg.norm(g)), float(np.abs(values).max()), 1e-300)

    def excess(shift: float) -> float:
        return float(np.sum((g / (top + shift - values)) ** 2)) - 1.0

    # any multiplier m >= top gives an upper bound, m/2 + sum g_i^2 / (2 (m - q_i))
    low, high = 1e-15 * size, float(np.linalg.norm(g)) + 1e-15 * size
    if high <= low * (1 + 1e-9) or excess(low) <= 0:
        shift = low
    else:
        shift = brentq(excess, low, high, xtol=1e-300, rtol=1e-14)
    m = top + shift
    return float(m / 2 + np.sum(g**2 / (m - values)) / 2)
