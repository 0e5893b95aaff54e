"""Compute the wrench of a deformed spring as the gradient of its energy.

The energy of a spring is s.K s / 2, where s is the logarithm of the motion between its
ends.  Exudyn applies the wrench K s half-way between the ends.  This wrench equals the
gradient of the energy only to first order in the deformation.  This module computes the
exact gradient with the inverse of the derivative of the exponential map.  A screw is a
dual vector. The translational part of this inverse is therefore the derivative of the
rotational part along the translation.

Vectors are tuples for speed, because Exudyn calls these functions about 100 000 times.

Sources:
    Selig (2005), Geometric fundamentals of robotics, section 4.5 (the series in
    Bernoulli's numbers), section 9.6 (dual vectors).
"""

import math
from collections.abc import Sequence

_Vector = tuple[float, float, float]
_BERNOULLI = (1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6,
              -3617 / 510, 43867 / 798, -174611 / 330)  # fmt: skip
# Coefficients of the power series of (1 - t/2 cot(t/2)) / t^2 in t^2.  For rotations
# below one radian, the relative error is below (1 / 2 pi)^22.
_SERIES = tuple(
    abs(B) / math.factorial(2 * k) for k, B in enumerate(_BERNOULLI, 1)
)  # fmt: skip
_SLOPES = tuple(2 * k * factor for k, factor in enumerate(_SERIES))[1:]


def middle_wrench(K: Sequence[Sequence[float]], screw: Sequence[float]) -> list[float]:
    """Return the wrench that resists a deformation, half-way between the ends.

    Args:
        K: (6, 6) [N m/rad .. N/m] stiffness in the axes of the near end.
        screw: (6,) [rad, m] logarithm of the motion from the near end to the far end.

    Returns:
        Wrench in the mean axes of both ends, (6,) [N m, N], the gradient of screw.K
        screw / 2.  The point of application is the near end plus half of the screw's
        translation along these axes. At the far end, the couple :func:`far_couple` must
        be added.
    """
    a, b, c, d, e, g = screw
    w, v = (a, b, c), (d, e, g)
    x, y, z, p, q, r = (
        k[0] * a + k[1] * b + k[2] * c + k[3] * d + k[4] * e + k[5] * g for k in K
    )
    m, f = (x, y, z), (p, q, r)
    square = a * a + b * b + c * c
    if not square:
        return [x, y, z, p, q, r]
    turn = math.sqrt(square)
    factor, slope = _power_series(_SERIES, square), _power_series(_SLOPES, square)
    across_f, across_m = _cross(w, f), _cross(w, m)
    twice_f = _cross(w, across_f)
    # The wrench at the near end is J^-T K s, where J is the left derivative of the
    # exponential.  In axes rotated by half of w, this expression is symmetric.
    short = (1 - turn / 2 / math.sin(turn / 2)) / square
    force = _sum(f, short, twice_f)
    by_shift = _cross(v, f)
    mixed = _sum(_cross(w, by_shift), 1.0, _cross(v, across_f))
    along = a * d + b * e + c * g
    lever = _sum(by_shift, 2 * factor, mixed)  # twice the moment due to the force
    lever = _turned_back(w, turn, _sum(lever, 2 * slope * along, twice_f))
    moment = _sum(_sum(m, short, _cross(w, across_m)), 0.5, lever)
    return [*_sum(moment, -0.5, _cross(v, force)), *force]


def far_couple(screw: Sequence[float], force: Sequence[float]) -> list[float]:
    """Return the couple that Exudyn omits at the far end of a spring.

    Exudyn applies the wrench at half of the screw's translation from each end. If the
    ends rotate by t relative to each other, the points of application at both ends
    differ, because the chord of an arc is shorter than the arc by the factor sin(t/2) /
    (t/2). This difference causes a couple.

    Args:
        screw: (6,) [rad, m] logarithm of the motion from the near end to the far end.
        force: (3,) [N] force of :func:`middle_wrench`, in the mean axes of the ends.

    Returns:
        Moment on the far end, in the axes of this end, (3,) [N m].
    """
    a, b, c, *_ = screw
    w, v = (a, b, c), (screw[3], screw[4], screw[5])
    turn = math.hypot(*w)
    if not turn:
        return [0.0] * 3
    # The difference sin(t/2) / (t/2) - 1 is computed by its series in x = (t/2)^2 to
    # avoid cancellation.
    x = turn * turn / 4
    short = -x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110))))
    along = sum(p * q for p, q in zip(w, v, strict=True)) / (turn * turn)
    across = _sum(v, -along, w)
    couple = _cross(across, (force[0], force[1], force[2]))
    return [short * m for m in _turned_back(w, turn, couple)]


def _power_series(factors: Sequence[float], x: float) -> float:
    """Return the value of a polynomial in x with given coefficients."""
    value = 0.0
    for factor in reversed(factors):
        value = factor + x * value
    return value


def _turned_back(w: _Vector, turn: float, vector: _Vector) -> _Vector:
    """Return the components of a vector in axes rotated by half of w."""
    half = turn / 2
    first = math.sin(half) / turn if turn else 0.5
    second = 2 * (math.sin(half / 2) / turn) ** 2 if turn else 0.125
    across = _cross(w, vector)
    return _sum(_sum(vector, -first, across), second, _cross(w, across))


def _sum(a: _Vector, factor: float, b: _Vector) -> _Vector:
    """Return a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def _cross(a: _Vector, b: _Vector) -> _Vector:
    """Return a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )
