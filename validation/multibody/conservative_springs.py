"""The wrench of a bent spring as the gradient of its energy.

A link that is a spring has the energy s.K s / 2, s the logarithm of the motion between
its ends.  Exudyn applies K s half-way between the ends, which is the gradient only to
first order in the bending: as a potential it is off by the square of the turn, and so
is the stiffness of a robot whose springs are bent.  Here the gradient is exact, by the
inverse of the exponential's derivative; its half for shifts is the derivative of its
half for turns, along the shift (a screw is a dual vector).

Exudyn calls it some hundred thousand times, so vectors are tuples of floats here.

Sources:
    Selig (2005), Geometric fundamentals of robotics, section 4.5 (the series in
    Bernoulli's numbers), section 9.6 (dual vectors).
"""

import math
from collections.abc import Sequence

_Vector = tuple[float, float, float]
_BERNOULLI = (1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6,
              -3617 / 510, 43867 / 798, -174611 / 330)  # fmt: skip
# of 1 - t/2 cot(t/2) over t^2 in t^2; turns are below a radian: what is left out is
# below (1 / 2 pi)^22
_SERIES = tuple(
    abs(B) / math.factorial(2 * k) for k, B in enumerate(_BERNOULLI, 1)
)  # fmt: skip
_SLOPES = tuple(2 * k * factor for k, factor in enumerate(_SERIES))[1:]


def middle_wrench(K: Sequence[Sequence[float]], screw: Sequence[float]) -> list[float]:
    """What a spring resists with, read half-way between its ends.

    Args:
        K: (6, 6) [N m/rad .. N/m] in the near end's axes.
        screw: (6,) [rad, m] logarithm of the far end seen from the near one.

    Returns:
        (6,) [N m, N] in the ends' mean axes, half the screw's shift along them from
        the near end, where Exudyn applies it: the gradient of screw.K screw / 2.  At
        the far end :func:`far_couple` has to be added.
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
    # at the near end: J^-T K s, J the derivative of the exponential from the left; a
    # turn of it by half of w is symmetric
    short = (1 - turn / 2 / math.sin(turn / 2)) / square
    force = _sum(f, short, twice_f)
    by_shift = _cross(v, f)
    mixed = _sum(_cross(w, by_shift), 1.0, _cross(v, across_f))
    along = a * d + b * e + c * g
    lever = _sum(by_shift, 2 * factor, mixed)  # twice what the force adds
    lever = _turned_back(w, turn, _sum(lever, 2 * slope * along, twice_f))
    moment = _sum(_sum(m, short, _cross(w, across_m)), 0.5, lever)
    return [*_sum(moment, -0.5, _cross(v, force)), *force]


def far_couple(screw: Sequence[float], force: Sequence[float]) -> list[float]:
    """What Exudyn leaves out at a spring's far end.

    It applies the wrench half the screw's shift from either end.  These two points are
    one only without a turn: a chord is shorter than its arc, across the turn's axis by
    sin(t/2) / (t/2), so that the wrenches on the two ends are not opposite ones.

    Args:
        screw: (6,) [rad, m] logarithm of the far end seen from the near one.
        force: (3,) [N] of :func:`middle_wrench`, in the ends' mean axes.

    Returns:
        (3,) [N m] a moment on the far end, in its own axes.
    """
    a, b, c, *_ = screw
    w, v = (a, b, c), (screw[3], screw[4], screw[5])
    turn = math.hypot(*w)
    if not turn:
        return [0.0] * 3
    # cancellation: sin x / x - 1 by its series, x below half a radian or so
    x = turn * turn / 4
    short = -x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110))))
    along = sum(p * q for p, q in zip(w, v, strict=True)) / (turn * turn)
    across = _sum(v, -along, w)
    couple = _cross(across, (force[0], force[1], force[2]))
    return [short * m for m in _turned_back(w, turn, couple)]


def _power_series(factors: Sequence[float], x: float) -> float:
    """Sum of factors times powers of x."""
    value = 0.0
    for factor in reversed(factors):
        value = factor + x * value
    return value


def _turned_back(w: _Vector, turn: float, vector: _Vector) -> _Vector:
    """Return a vector seen from axes turned by half of w."""
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
