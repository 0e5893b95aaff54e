"""Rest-to-rest motion profiles: traversed fraction s of the path at relative time t.

Both s and t range from 0 to 1.  The columns "speed" and "acceleration" contain the
peaks of ds/dt and d^2s/dt^2.

==========  ========================  ======  ============  =======================
name        s                         speed   acceleration  discontinuity
==========  ========================  ======  ============  =======================
quintic     10 t^3 - 15 t^4 + 6 t^5   1.875   5.774         jerk
seventh     35 t^4 - 84 t^5 + 70 t^6  2.1875  7.513         derivative of the jerk
            - 20 t^7
trapezoid   constant acceleration,    1.5     4.5           acceleration
            speed and deceleration
==========  ========================  ======  ============  =======================

Sources:
    Biagiotti & Melchiorri (2008), Trajectory Planning for Automatic Machines and
    Robots, chapters 2 and 3.
"""

from collections.abc import Callable

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

Law = Callable[[NDArray], tuple[NDArray, NDArray, NDArray]]


def _polynomial(*coefficients: float) -> Law:
    """Return a polynomial profile, with coefficients in ascending order."""
    s = Polynomial(coefficients)
    return lambda t: (s(t), s.deriv()(t), s.deriv(2)(t))


def _trapezoid(t: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return s, s' and s'' of the trapezoidal profile."""
    left = np.minimum(t, 1 - t)  # time from the start or to the end, if shorter
    ramp = left < 1 / 3
    way = np.where(ramp, 2.25 * left**2, 1.5 * left - 0.25)
    speed = np.where(ramp, 4.5 * left, 1.5)
    # at the jumps t = 1/3 and 2/3, return the acceleration of the first or last third
    size = np.where(left <= 1 / 3, 4.5, 0.0)
    return np.where(t <= 0.5, way, 1 - way), speed, np.where(t <= 0.5, size, -size)


PROFILES: dict[str, Law] = {
    "quintic": _polynomial(0, 0, 0, 10, -15, 6),
    "seventh": _polynomial(0, 0, 0, 0, 35, -84, 70, -20),
    "trapezoid": _trapezoid,
}
JUMPING = frozenset({"trapezoid"})  # profiles with discontinuous acceleration
