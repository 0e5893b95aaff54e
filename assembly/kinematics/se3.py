r"""Finite motions on SE(3): exponential, logarithm, and their derivatives.

A constant velocity screw s during unit time produces the finite motion ``exp(s)``.  The
screw is expressed in the axes of the initial frame.  All functions are vectorised over
leading axes.

======  ======================  ============  ======================================
symbol  code                    shape         meaning
======  ======================  ============  ======================================
exp     ``exponential``         (..., 4, 4)   motion of a screw
log     ``logarithm``           (..., 6)      screw of a motion by less than pi
J(s)    ``left_jacobian``       (..., 6, 6)   exp(s + h) = exp(J h) exp(s) + O(h^2)
ad      ``bracket``             (..., 6, 6)   ad(a) b = [a, b], the screws' bracket
Omega   ``bracket_form``        (..., 6, 6)   a.Omega(w) b = w.[a, b]
======  ======================  ============  ======================================

Sources:
    Barfoot (2017), State Estimation for Robotics, section 7.1 (J of SE(3)).  The
    coefficients are expressed by Stumpff functions, which avoid cancellation at small
    angles.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.stiffness.screws import rotation_vector, skew, transform

# number of terms of the Stumpff series; its error is 1e-17 at an angle of 1 rad
_SERIES = 9
_STUMPFF = np.array([
    [1 / math.factorial(2 * j + k) for k in range(6)] for j in range(_SERIES)
])  # fmt: skip
_ROUNDING = 1e-16  # [-] smaller terms of the second derivative are omitted


def exponential(screw: ArrayLike) -> NDArray:
    """Return the finite motion that a constant screw produces in unit time.

    Args:
        screw: (..., 6) ``[RX RY RZ TX TY TZ]`` [rad, m].

    Returns:
        (..., 4, 4) transforms.
    """
    s = np.asarray(screw, dtype=float)
    W = skew(s[..., :3])
    _, c1, c2, c3, *_ = stumpff(s[..., :3])
    W2 = W @ W
    mean_turn = np.eye(3) + c2 * W + c3 * W2
    shift = (mean_turn @ s[..., 3:, None])[..., 0]
    return transform(shift, np.eye(3) + c1 * W + c2 * W2)


def logarithm(T: ArrayLike) -> NDArray:
    """Return the constant screw that produces a finite motion in unit time.

    Args:
        T: (..., 4, 4) transforms with rotations by less than pi.

    Returns:
        (..., 6) [rad, m] screws, the inverse of :func:`exponential`.
    """
    T = np.asarray(T, dtype=float)
    turn = rotation_vector(T[..., :3, :3])
    mean_turn = turn_jacobian(turn)
    shift = np.linalg.solve(mean_turn, T[..., :3, 3, None])[..., 0]
    return np.concatenate([turn, shift], axis=-1)


def inverse(T: NDArray) -> NDArray:
    """Return the inverse motions, (..., 4, 4)."""
    R_inverse = np.swapaxes(T[..., :3, :3], -1, -2)
    return transform(-(R_inverse @ T[..., :3, 3, None])[..., 0], R_inverse)


def turn_jacobian(turn: ArrayLike) -> NDArray:
    """Return the left Jacobian of SO(3), (..., 3, 3)."""
    W = skew(turn)
    _, _, c2, c3, *_ = stumpff(np.asarray(turn, dtype=float))
    return np.eye(3) + c2 * W + c3 * (W @ W)


def left_jacobian(screw: ArrayLike) -> NDArray:
    """Return the left Jacobian J of SE(3).

    Args:
        screw: (..., 6) [rad, m] screws.

    Returns:
        (..., 6, 6) J with ``exp(s + h) = exp(J h) exp(s)`` to first order in h.
    """
    s = np.asarray(screw, dtype=float)
    W, V = skew(s[..., :3]), skew(s[..., 3:])
    _, _, c2, c3, c4, c5 = stumpff(s[..., :3])
    WW, WV, VW = W @ W, W @ V, V @ W
    WVW = WV @ W
    J = np.zeros((*s.shape[:-1], 6, 6))
    J[..., :3, :3] = J[..., 3:, 3:] = np.eye(3) + c2 * W + c3 * WW
    J[..., 3:, :3] = (
        V / 2
        + c3 * (WV + VW + WVW)
        + c4 * (WW @ V + V @ WW - 3 * WVW)
        + (c4 - 3 * c5) / 2 * (WVW @ W + W @ WVW)
    )
    return J


def second_form(screw: ArrayLike, wrench: ArrayLike) -> NDArray:
    """Return the work of a wrench on the second-order term of the exponential.

    To second order, ``exp(s + h) = exp(J h + D(h, h) / 2) exp(s)``.  This function
    returns the matrix of the quadratic form ``w.D(h, h)``.

    Args:
        screw: (..., 6) s [rad, m].
        wrench: (..., 6) w [N m, N], in the axes before the motion.

    Returns:
        (..., 6, 6) symmetric matrices; zero at s = 0.
    """
    ad = bracket(screw)
    w = np.asarray(wrench, dtype=float)[..., None]
    orders = _orders(np.asarray(screw, dtype=float))
    powers = [np.broadcast_to(np.eye(6), ad.shape)]
    for _ in range(orders - 1):
        powers.append(powers[-1] @ ad)
    # sum of w.ad^k [h, ad^j h] / (k + j + 2)! over k + j < orders and j > 0
    factors = [
        [1 / math.factorial(k + j + 2) if 0 < j < orders - k else 0.0
         for j in range(orders)]
        for k in range(orders - 1)
    ]  # fmt: skip
    stacked = np.stack(powers[:orders])
    rests = np.tensordot(factors, stacked, axes=1)
    on_powers = (np.swapaxes(stacked[:-1], -1, -2) @ w)[..., 0]
    Z = (bracket_form(on_powers) @ rests).sum(axis=0)
    return (Z + np.swapaxes(Z, -1, -2)) / 2


def _orders(screws: NDArray) -> int:
    """Return the number of terms of the bracket series that exceed round-off."""
    most = float(np.linalg.norm(screws[..., :3], axis=-1).max(initial=0.0))
    order, size = 2, most
    while size > _ROUNDING:
        order += 1
        size *= most / (order + 1)
    return order


def bracket(screw: ArrayLike) -> NDArray:
    """Return the matrix of the Lie bracket, with ``bracket(a) @ b = [a, b]``."""
    s = np.asarray(screw, dtype=float)
    A = np.zeros((*s.shape[:-1], 6, 6))
    A[..., :3, :3] = A[..., 3:, 3:] = skew(s[..., :3])
    A[..., 3:, :3] = skew(s[..., 3:])
    return A


def bracket_form(wrench: ArrayLike) -> NDArray:
    """Return the antisymmetric form Omega: ``a @ Omega @ b = wrench @ [a, b]``."""
    w = np.asarray(wrench, dtype=float)
    form = np.zeros((*w.shape[:-1], 6, 6))
    form[..., :3, :3] = -skew(w[..., :3])
    form[..., :3, 3:] = form[..., 3:, :3] = -skew(w[..., 3:])
    return form


def stumpff(turn: NDArray) -> list[NDArray]:
    """Return the Stumpff functions c_0 .. c_5 of rotation angles a.

    They are defined by c_k = sum (-a^2)^j / (2j + k)! over j >= 0.

    Args:
        turn: (..., 3) [rad] rotation vectors.

    Returns:
        Six arrays (..., 1, 1), which can multiply matrices.
    """
    squared = np.sum(turn * turn, axis=-1)[..., None, None]
    large = squared > 1.0
    small = np.where(large, 0.0, squared)
    most, terms = float(small.max(initial=0.0)), 2
    while terms < _SERIES and most**terms / math.factorial(2 * terms) > 1e-18:
        terms += 1
    series = _STUMPFF[:terms].reshape(terms, 6, *(1,) * small.ndim)
    values = np.zeros((6, *small.shape))
    for factors in series[::-1]:
        values = factors - values * small
    functions = list(values)
    if large.any():
        a2 = np.where(large, squared, 1.0)
        a = np.sqrt(a2)
        closed = [np.cos(a), np.sin(a) / a]
        for k in range(4):  # c_(k+2) = (1/k! - c_k) / a^2
            closed.append((1 / math.factorial(k) - closed[k]) / a2)
        pairs = zip(closed, functions, strict=True)
        functions = [np.where(large, far, near) for far, near in pairs]
    return functions
