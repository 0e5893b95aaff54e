"""Problem (22) for many right sides h at one posture, compiled.

The reduction is shared: only h differs from draw to draw.  The certificate is that of
:mod:`assembly.linear.compiled_energy`, from matrices made once of the columns before
any elimination: y proves ``f gain - f^2 cost / 2`` for every factor f.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.linear.compiled_energy import limits_of, small_answer
from assembly.linear.compiled_zone import farthest, turn_first
from assembly.linear.thresholds import MARGIN_GAP
from assembly.solvers.compiled import kernel, part
from assembly.solvers.conic import GAP, GAP_WITHOUT_CLEARANCE
from assembly.solvers.layouts import Indices, Matrix, Vector
from assembly.solvers.vectors import copy, divide, fill, inner, matrix, vector

SOLVED, UNCERTIFIED = range(2)
_STOP = 1e-2  # the solvers stop at this fraction of the accepted gap
_PROJECTIONS, _INWARDS = 30, 0.8


class Reduced(NamedTuple):
    """What all draws at a posture share; writable arrays.

    Attributes:
        Gt: (nu, r) columns of G as rows [sqrt(2 J)].
        starts: (cones + 1,) first clearance of each cone, and nu.
        inverse: (nu, r) pseudoinverse of G.
        cones: (nu, r) generalised force of y on each clearance, before elimination.
        gram: (r, r) the springs' complementary energy is y.gram y / 2.
        d: (nu,) [J] what each clearance carries in the tight robot under its loads.
        slip: [per size of y] how much the free motions may gain by rounding ..
        slack: [J] .. whatever y is.
        stored: [J] energy that loads alone bend.
        loaded: whether there are loads.
    """

    Gt: NDArray
    starts: NDArray
    inverse: NDArray
    cones: NDArray
    gram: NDArray
    d: NDArray
    slip: float
    slack: float
    stored: float
    loaded: bool


class Energies(NamedTuple):
    """Arrays filled by :func:`least_energies`, one row a draw.

    Attributes:
        u: (k, nu) clearances in units of their cones.
        y: (k, r) multipliers, scaled to the best proof.
        energy: (k,) [J].
        bound: (k,) [J], certified lower bound.
        outcome: (k,) SOLVED or UNCERTIFIED.
    """

    u: NDArray
    y: NDArray
    energy: NDArray
    bound: NDArray
    outcome: NDArray


@kernel
def least_energies(reduced: Reduced, h: NDArray, out: Energies) -> None:
    """Minimise |G u + h|^2 / 2 - d.u for every row of h.

    Args:
        reduced: of the posture.
        h: (k, r) [sqrt(2 J)].
        out: arrays to fill.
    """
    Gt, starts, inverse, cones, gram, loads, slip, slack, stored, loaded = reduced
    u, y, energy, bound, outcome = out
    nu, r = Gt.shape
    norm = 0.0
    for c in range(nu):
        squares = 0.0
        for i in range(r):
            squares += Gt[c, i] * Gt[c, i]
        norm = max(norm, np.sqrt(squares))
        norm = max(norm, np.sqrt(abs(loads[c])))
    own, right = vector(nu), vector(r)
    G = matrix(nu, r)
    own_y = vector(r)
    for point in range(len(h)):
        size = 0.0
        for i in range(r):
            size += h[point, i] * h[point, i]
        without = 0.5 * size
        size = max(np.sqrt(size), norm)
        fill(own, 0.0)
        copy(h[point], own_y)
        some = nu > 0 and (without > 0.0 or loaded)
        if some and not loaded and _within(Gt, starts, h[point], inverse, own):
            fill(own_y, 0.0)
        elif some and size > 0.0:
            fill(own, 0.0)
            for i in range(r):
                right[i] = h[point, i] / size
                for c in range(nu):
                    G[c, i] = Gt[c, i] / size
            joule = size * size
            limits = limits_of(_STOP, without / joule, stored / joule)
            small_answer(G, right, divide(loads, joule), starts, limits, own, own_y)
            for i in range(r):
                own_y[i] *= size
        total, along = 0.0, 0.0
        for i in range(r):
            v = h[point, i]
            for c in range(nu):
                v += Gt[c, i] * own[c]
            total += v * v
            along += v * own_y[i]
        for c in range(nu):
            u[point, c] = own[c]
        worth, cost, y_size = 0.0, 0.0, 0.0
        for i in range(r):
            worth += h[point, i] * own_y[i]
            y_size += own_y[i] * own_y[i]
            for l in range(r):
                cost += own_y[i] * gram[i, l] * own_y[l]
        moved = slip * np.sqrt(y_size) + slack
        gains = 0.0
        for c in range(len(starts) - 1):
            size_of_cone, work = 0.0, 0.0
            for a in range(starts[c], starts[c + 1]):
                component = loads[a]
                for i in range(r):
                    component += cones[a, i] * own_y[i]
                size_of_cone += component * component
                work += component * own[a]
            worth -= np.sqrt(size_of_cone)
            gains += max(0.0, np.sqrt(size_of_cone) - work)
        energy[point] = 0.5 * total + stored
        factor = 1.0
        if loaded:
            # strains that balance y, and what clearances could still gain
            off = max(0.0, 0.5 * total - along + 0.5 * cost)
            bound[point] = energy[point] - off - gains - moved
        else:
            worth -= moved
            # any multiple of y proves a bound: the best one, zero inside a zone
            factor = max(0.0, worth) / cost if cost > 0.0 else 0.0
            bound[point] = 0.5 * factor * factor * cost
        for i in range(r):
            y[point, i] = factor * own_y[i]
        allowed = GAP * energy[point] + GAP_WITHOUT_CLEARANCE * (without + stored)
        # written so that NaN fails
        certified = energy[point] - bound[point] <= allowed
        outcome[point] = SOLVED if certified else UNCERTIFIED


@part
def _within(Gt: Matrix, starts: Indices, h: Vector, inverse: Matrix, u: Vector) -> bool:
    """Look for clearances within their cones with G u = -h: zero energy."""
    # y = h may prove that there are none; else alternating projections
    nu, r = Gt.shape
    worth = 0.0
    for i in range(r):
        worth += h[i] * h[i]
    for c in range(len(starts) - 1):
        size_of_cone = 0.0
        for a in range(starts[c], starts[c + 1]):
            component = 0.0
            for i in range(r):
                component += Gt[a, i] * h[i]
            size_of_cone += component * component
        worth -= np.sqrt(size_of_cone)
    if worth > 0.0:
        return False
    left = vector(r)
    for _ in range(_PROJECTIONS):
        for i in range(r):
            left[i] = h[i]
            for c in range(nu):
                left[i] += Gt[c, i] * u[c]
        for c in range(nu):
            for i in range(r):
                u[c] -= inverse[c, i] * left[i]
        outside = False
        for c in range(len(starts) - 1):
            size = 0.0
            for a in range(starts[c], starts[c + 1]):
                size += u[a] * u[a]
            if size > 1.0:
                outside = True
                # a little further inside, so that the projections end
                size = _INWARDS / np.sqrt(size)
                for a in range(starts[c], starts[c + 1]):
                    u[a] *= size
        if not outside:
            return True
    return False


@kernel
def least_margins(
    B: NDArray, starts: NDArray, right: NDArray, margin: NDArray,
    bound: NDArray, multipliers: NDArray,
) -> None:  # fmt: skip
    """Least t with B u = right, |u_k| <= t, for every row of right.

    Args:
        B: (p, nu) orthonormal rows.
        starts: (cones + 1,) first clearance of each cone, and nu.
        right: (k, p).
        margin: (k,) to fill; NaN where the certificate falls short.
        bound: (k,) to fill, certified lower bound.
        multipliers: (k, p) to fill: multipliers q that prove it, q.right = bound.
    """
    p = len(B)
    for point in range(len(right)):
        w = right[point].copy()
        size = np.sqrt(inner(w, w))
        fill(multipliers[point], 0.0)
        if not size > 0.0:
            margin[point], bound[point] = 0.0, 0.0
            continue
        own = B.copy()
        turn_first(own, w, size)
        u, gradient = farthest(own, starts)
        reach, most = inner(own[0], u), 0.0
        for c in range(len(starts) - 1):
            part = 0.0
            for i in range(starts[c], starts[c + 1]):
                part += gradient[i] * gradient[i]
            most += np.sqrt(part)
        margin[point], bound[point] = size / reach, size / most
        for i in range(p):
            multipliers[point, i] = inner(B[i], gradient) / most
        if not (
            reach > 0.0 and margin[point] - bound[point] <= MARGIN_GAP * margin[point]
        ):
            margin[point] = np.nan
