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
    of a quadratic on a sphere; Golub, Van Loan, Matrix Computations, 4th ed., section
    8.5 (Jacobi's method).
"""

import numpy as np

from assembly.solvers.compiled import part
from assembly.solvers.layouts import GivenVector, Indices, Matrix, Vector
from assembly.solvers.vectors import matrix, vector

_LEAST_SIZE = 1e-9  # of a cone with zero gradient, relative to the largest
_SWEEPS, _STEPS = 12, 60


@part(fastmath={"contract", "reassoc"})
def majorant_bound(
    centre: Vector, X: Matrix, H: Matrix, start: Vector, starts: Indices, w: GivenVector
) -> float:
    """Upper bound of |centre + X (v - start)| over unit cones with H (v - start) = 0.

    Args:
        centre: (3,).
        X: (3, nv).
        H: (p, nv) orthonormal rows.
        start: (nv,).
        starts: (cones + 1,) first column of each cone, and nv.
        w: (nv,) gradient X^T d - H^T n at some direction d.

    Returns:
        The bound; infinite where the gradient is zero, or rounding dominates.
    """
    p, nv = H.shape
    sizes, largest, total = vector(nv), 0.0, 0.0
    for c in range(len(starts) - 1):
        size = 0.0
        for j in range(starts[c], starts[c + 1]):
            size += w[j] * w[j]
        sizes[starts[c]] = np.sqrt(size)
        largest = max(largest, np.sqrt(size))
    if not largest > 1e-150:
        return np.inf  # a zero gradient bounds no other direction
    for c in range(len(starts) - 1):
        size = max(sizes[starts[c]], _LEAST_SIZE * largest)
        total += size
        for j in range(starts[c], starts[c + 1]):
            sizes[j] = size
    # n minimises w.w/(2s) - w.start:  H (w/s - start) = 0, w = A d + fixed
    A, fixed = matrix(nv, 3), vector(nv)
    for j in range(nv):
        for a in range(3):
            A[j, a] = X[a, j]
    if p and not _follow_rows(H, X, start, sizes, A, fixed):
        return np.inf
    Q, linear, constant = matrix(3, 3), centre.copy(), total / 2
    for j in range(nv):
        slope = fixed[j] / sizes[j] - start[j]
        constant += fixed[j] * (fixed[j] / (2 * sizes[j]) - start[j])
        for a in range(3):
            linear[a] += A[j, a] * slope
            for b in range(3):
                Q[a, b] += A[j, a] * A[j, b] / sizes[j]
    return constant + largest_on_sphere(Q, linear)


@part(fastmath={"contract", "reassoc"})
def _follow_rows(
    H: Matrix, X: Matrix, start: Vector, sizes: Vector, A: Matrix, fixed: Vector
) -> bool:
    """Subtract the terms of the best n from A and fixed; whether that succeeded."""
    p, nv = H.shape
    S, right = matrix(p, p), matrix(p, 4)
    scaled = vector(nv)
    for i in range(p):
        for j in range(nv):
            scaled[j] = H[i, j] / sizes[j]
            right[i, 3] += H[i, j] * start[j]
        for l in range(i + 1):
            for j in range(nv):
                S[i, l] += scaled[j] * H[l, j]
        for a in range(3):
            for j in range(nv):
                right[i, a] += scaled[j] * X[a, j]
    for i in range(p):
        for l in range(i + 1):
            for j in range(l):
                S[i, l] -= S[i, j] * S[l, j]
            if l < i:
                S[i, l] /= S[l, l]
            elif S[i, i] > 0.0:
                S[i, i] = np.sqrt(S[i, i])
            else:
                return False
    for a in range(4):
        for i in range(p):
            for j in range(i):
                right[i, a] -= S[i, j] * right[j, a]
            right[i, a] /= S[i, i]
        for i in range(p - 1, -1, -1):
            for j in range(i + 1, p):
                right[i, a] -= S[j, i] * right[j, a]
            right[i, a] /= S[i, i]
    for i in range(p):
        for j in range(nv):
            fixed[j] += H[i, j] * right[i, 3]
            for a in range(3):
                A[j, a] -= H[i, j] * right[i, a]
    return True


@part
def largest_on_sphere(Q: Matrix, g: Vector) -> float:
    """Largest value of d.Q d/2 + g.d over unit vectors d.

    Args:
        Q: (3, 3) symmetric.
        g: (3,).

    Returns:
        The value, from above by at most rounding.
    """
    values, vectors = eigenvectors(Q)
    along, length = vector(3), 0.0
    for i in range(3):
        for a in range(3):
            along[i] += vectors[a, i] * g[a]
        length += g[i] * g[i]
    top, length = max(values[0], values[1], values[2]), np.sqrt(length)
    size = max(length, abs(values[0]), abs(values[1]), abs(values[2]), 1e-300)
    # any multiplier m > top gives an upper bound, m/2 + sum g_i^2 / (2 (m - q_i)); the
    # least of them has |g / (m - q)| = 1, or m = top
    low, high = 1e-15 * size, length + 1e-15 * size
    shift = low
    for _ in range(_STEPS):
        first, second = 0.0, 0.0
        for i in range(3):
            part = along[i] / (top + shift - values[i])
            first += part * part
            second += part * part / (top + shift - values[i])
        first = np.sqrt(first)
        if not first > 1.0 + 1e-14:
            break
        # Newton's method on 1/|.|, concave: it comes from the left and stays there
        shift = min(high, shift + first * first / second * (first - 1.0))
    m = top + shift
    total = m / 2
    for i in range(3):
        total += along[i] * along[i] / (2 * (m - values[i]))
    return total


@part
def eigenvectors(Q: Matrix) -> tuple[Vector, Matrix]:
    """Eigenvalues (3,) of a symmetric matrix, and vectors as columns (3, 3)."""
    D, V, values = Q.copy(), matrix(3, 3), vector(3)
    for i in range(3):
        V[i, i] = 1.0
    for _ in range(_SWEEPS):
        off = D[0, 1] ** 2 + D[0, 2] ** 2 + D[1, 2] ** 2
        if off <= 1e-34 * (D[0, 0] ** 2 + D[1, 1] ** 2 + D[2, 2] ** 2):
            break
        for a in range(2):
            for b in range(a + 1, 3):
                if D[a, b] == 0.0:
                    continue
                theta = (D[b, b] - D[a, a]) / (2.0 * D[a, b])
                sign = 1.0 if theta >= 0.0 else -1.0
                t = sign / (abs(theta) + np.sqrt(theta * theta + 1.0))
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                for i in range(3):
                    D[i, a], D[i, b] = (
                        c * D[i, a] - s * D[i, b],
                        s * D[i, a] + c * D[i, b],
                    )
                for i in range(3):
                    D[a, i], D[b, i] = (
                        c * D[a, i] - s * D[b, i],
                        s * D[a, i] + c * D[b, i],
                    )
                for i in range(3):
                    V[i, a], V[i, b] = (
                        c * V[i, a] - s * V[i, b],
                        s * V[i, a] + c * V[i, b],
                    )
    for i in range(3):
        values[i] = D[i, i]
    return values, V
