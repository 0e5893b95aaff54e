r"""How wrong is a finite element stiffness, and where?

With the exact stress s of unit case i, and s_h its finite element value, the error of
the stiffness is the energy of the difference,

    K_h[i, j] - K[i, j] = integral (s_h - s)_i : D^-1 : (s_h - s)_j,

exactly, whether or not i = j.  The exact stress is unknown; a smoothed one stands for
it: around every corner a quadratic polynomial is fitted to the stresses of the elements
there, and the polynomials of an element's four corners are blended linearly
(Zienkiewicz & Zhu 1992, superconvergent patch recovery; the blending as in partition of
unity).  Element by element the same integral says where to refine.
"""

import numpy as np
from numpy.typing import NDArray

from stiffness.elements import Quadratic, integration

_BLEND_CHUNK = 1024
PAIRS = np.array([[0, 0], [1, 1], [2, 2], [1, 2], [0, 2], [0, 1]])


def stresses(
    mesh: Quadratic, fields: NDArray, lam: NDArray, mu: NDArray
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Stresses at four points of each element.

    Args:
        mesh: the tetrahedra.
        fields: (n, 3, k) [m] displacements.
        lam: (t,) [Pa].
        mu: (t,) [Pa].

    Returns:
        Barycentric points (4, 4), places (t, 4, 3) [m], weights (t, 4) [m^3], and
        stresses (t, 4, k, 6) [Pa] ordered xx yy zz yz xz xy.
    """
    count, cases = len(mesh.cells), fields.shape[2]
    where, weight = np.zeros((count, 4, 3)), np.zeros((count, 4))
    stress = np.zeros((count, 4, cases, 6))
    for part, N, G, w in integration(mesh, degree=2):
        nodes = mesh.cells[part]
        where[part] = np.einsum("qa,tax->tqx", N, mesh.nodes[nodes])
        weight[part] = w
        u = fields[nodes].transpose(0, 3, 2, 1).reshape(len(part), 1, cases * 3, 10)
        slope = (u @ G).reshape(len(part), 4, cases, 3, 3)
        e = slope + slope.swapaxes(-1, -2)
        m = mu[part, None, None]
        pressure = lam[part, None, None] * np.trace(slope, axis1=-2, axis2=-1)
        for k, (i, j) in enumerate(PAIRS):
            stress[part, ..., k] = m * e[..., i, j] + (i == j) * pressure
    return _corner_weights(), where, weight, stress


def _corner_weights() -> NDArray:
    """(4, 4) barycentric coordinates of the points of the rule of degree 2."""
    a = (5 - np.sqrt(5)) / 20
    return np.full((4, 4), a) + np.eye(4) * (1 - 4 * a)


def error_matrices(
    mesh: Quadratic, fields: NDArray, lam: NDArray, mu: NDArray, corners: int
) -> NDArray:
    """Estimated error of the stiffness, element by element.

    Args:
        mesh: the tetrahedra.
        fields: (n, 3, k) [m] displacements of the unit cases.
        lam: (t,) [Pa] Lame's first constant.
        mu: (t,) [Pa] shear modulus.
        corners: how many of the nodes are corners.

    Returns:
        (t, k, k) [unit of the stiffness]; their sum estimates K_h - K.
    """
    blend, where, weight, stress = stresses(mesh, fields, lam, mu)
    smooth = _smoothed(mesh.cells[:, :4], blend, where, stress, corners)
    gap = (smooth - stress) * np.sqrt(weight)[:, :, None, None]
    return complementary_work(gap, lam, mu).sum(axis=1)


def complementary_work(stress: NDArray, lam: NDArray, mu: NDArray) -> NDArray:
    """Work of each stress on the strains of each other.

    Args:
        stress: (t, q, k, 6) [Pa] xx yy zz yz xz xy.
        lam: (t,) [Pa] Lame's first constant.
        mu: (t,) [Pa] shear modulus.

    Returns:
        (t, q, k, k) [J/m^3] s_i : D^-1 : s_j.
    """
    trace = stress[..., :3].sum(axis=-1)
    double = np.array([1.0, 1, 1, 2, 2, 2])
    plain = (stress * double) @ stress.swapaxes(-1, -2)
    of_trace = trace[..., :, None] * trace[..., None, :]
    m, l = mu[:, None, None, None], lam[:, None, None, None]
    return (plain - l / (3 * l + 2 * m) * of_trace) / (2 * m)


def _smoothed(
    corners: NDArray, blend: NDArray, where: NDArray, stress: NDArray, count: int
) -> NDArray:
    """(t, 4, k, 6) stresses of the blended polynomials."""
    cells, cases = len(corners), stress.shape[2]
    members = np.repeat(corners, 4, axis=0).reshape(cells, 4, 4)  # (t, q, corner)
    share = np.bincount(members.ravel(), minlength=count)
    center = np.zeros((count, 3))
    spread = np.zeros(count)
    for k in range(3):
        total = np.bincount(
            members.ravel(), np.repeat(where[..., k].ravel(), 4), minlength=count
        )
        center[:, k] = total / np.maximum(share, 1)
    for c in range(4):
        gap = np.linalg.norm(where - center[corners[:, c], None], axis=2).max(axis=1)
        np.maximum.at(spread, corners[:, c], gap)
    normal = np.zeros((count, 10, 10))
    right = np.zeros((count, 10, cases * 6))
    flat = stress.reshape(cells, 4, cases * 6)
    for c in range(4):
        P = _polynomials(where, center, spread, corners[:, c])
        order = np.argsort(corners[:, c], kind="stable")
        _add_sorted(normal, corners[order, c], (P.swapaxes(1, 2) @ P)[order])
        _add_sorted(right, corners[order, c], (P.swapaxes(1, 2) @ flat)[order])
    # few elements around a corner: the ridge keeps what they do not determine small
    ridge = np.diag([1e-9, *[1e-7] * 3, *[1e-4] * 6])
    normal += ridge * np.maximum(normal[:, :1, :1], 1.0)
    fit = np.linalg.solve(normal, right)
    smooth = np.zeros_like(flat)
    for c in range(4):
        P = _polynomials(where, center, spread, corners[:, c])
        for first in range(0, cells, _BLEND_CHUNK):
            part = slice(first, first + _BLEND_CHUNK)
            smooth[part] += blend[None, :, c, None] * (P[part] @ fit[corners[part, c]])
    return smooth.reshape(stress.shape)


def _polynomials(
    where: NDArray, center: NDArray, spread: NDArray, corner: NDArray
) -> NDArray:
    """(t, 4, 10) monomials up to degree 2 about each element's chosen corner."""
    x = (where - center[corner, None]) / spread[corner, None, None]
    squares = x[..., [0, 1, 2, 1, 0, 0]] * x[..., [0, 1, 2, 2, 2, 1]]
    return np.concatenate([np.ones((*x.shape[:2], 1)), x, squares], axis=2)


def _add_sorted(total: NDArray, index: NDArray, values: NDArray) -> None:
    """Add values to rows of a total; the index is sorted."""
    starts = np.flatnonzero(np.r_[True, index[1:] != index[:-1]])
    total[index[starts]] += np.add.reduceat(values, starts, axis=0)
