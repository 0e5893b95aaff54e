"""The wrench of a bent spring as the gradient of its energy.

A link that is a spring has the energy s.K s / 2, s the logarithm of the motion between
its ends.  Exudyn applies K s half-way between the ends, which is the gradient only to
first order in the bending: as a potential it is off by the square of the turn, and so
is the stiffness of a robot whose springs are bent.  Here the gradient is exact, by the
inverse of the exponential's derivative.

Exudyn calls it some hundred thousand times, so vectors are tuples of floats here.

Sources:
    Selig (2005), Geometric fundamentals of robotics, section 4.5 (the series in
    Bernoulli's numbers, [ad s]^2k B_2k / (2k)!).
"""

import math
from collections.abc import Sequence

_Vector = tuple[float, float, float]
_BERNOULLI = (1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6,
              -3617 / 510, 43867 / 798, -174611 / 330)  # fmt: skip
# turns are below a radian: what is left out is below (1 / 2 pi)^22
_SERIES = tuple(B / math.factorial(2 * k) for k, B in enumerate(_BERNOULLI, 1))
_NEGLIGIBLE = 1e-17  # of the wrench, the next term of its series


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
    Ks = [sum(k * s for k, s in zip(row, screw, strict=True)) for row in K]
    m, f = (Ks[0], Ks[1], Ks[2]), (Ks[3], Ks[4], Ks[5])
    # at the near end: J^-T K s, J the derivative of the exponential from the left
    term = _bracket(w, v, m, f)
    moment, force = _sum(m, 0.5, term[0]), _sum(f, 0.5, term[1])
    term = _bracket(w, v, *term)
    turn = math.hypot(*w)
    for k, factor in enumerate(_SERIES):
        moment, force = _sum(moment, factor, term[0]), _sum(force, factor, term[1])
        if k and (turn / 6.0) ** (2 * k) < _NEGLIGIBLE:
            break
        term = _bracket(w, v, *_bracket(w, v, *term))
    moment, force = _turned_back(w, turn, moment), _turned_back(w, turn, force)
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


def _bracket(w: _Vector, v: _Vector, m: _Vector, f: _Vector) -> tuple[_Vector, _Vector]:
    """-[ad s]' of a wrench."""
    return _sum(_cross(w, m), 1.0, _cross(v, f)), _cross(w, f)


def _turned_back(w: _Vector, turn: float, vector: _Vector) -> _Vector:
    """A vector seen from axes turned by half of w."""
    half = turn / 2
    first = math.sin(half) / turn if turn else 0.5
    second = 2 * (math.sin(half / 2) / turn) ** 2 if turn else 0.125
    across = _cross(w, vector)
    return _sum(_sum(vector, -first, across), second, _cross(w, across))


def _sum(a: _Vector, factor: float, b: _Vector) -> _Vector:
    """A + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


def _cross(a: _Vector, b: _Vector) -> _Vector:
    """A x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )
