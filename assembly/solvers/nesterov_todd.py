"""The Nesterov-Todd scaling of second-order cones, compiled; columns are in layers.

Sources:
    Nesterov, Todd (1997), Self-scaled barriers and interior-point methods for convex
    programming; Andersen, Roos, Terlaky (2003), On implementing a primal-dual
    interior-point method for conic quadratic optimization.
"""

from typing import NamedTuple

import numpy as np

from assembly.solvers.compiled import part
from assembly.solvers.layers import FAST, cone_sums
from assembly.solvers.layouts import Indices, Matrix, Vector


class Point(NamedTuple):
    """An iterate (u, z) of all cones, s = (1, u), or a step of it.

    Attributes:
        u: (width,).
        z0: (cones,) heads of z.
        z1: (width,) the rest of z.
    """

    u: Vector
    z0: Vector
    z1: Vector


class Sides(NamedTuple):
    """Right sides of the scaled complementarity.

    Attributes:
        t0: (cones,) heads of t, l o t = r.
        t1: (width,) the rest of t.
        r0: (cones,) heads of r.
    """

    t0: Vector
    t1: Vector
    r0: Vector


class Scaling(NamedTuple):
    """Nesterov-Todd points of all cones, W = eta (w), and the scaled point l = W z.

    D^-1 = W^2 is ``across`` across w and ``along`` along it; w grows without bound, so
    the two are kept apart.

    Attributes:
        layers: of the columns.
        eta: (cones,).
        w0: (cones,) heads of w.
        w1: (width,) the rest of w.
        l0: (cones,) heads of l.
        l1: (width,) the rest of l.
        across: (cones,).
        along: (cones,).
        sums: (6, cones) for sums within cones; the last is the scaling's, 1 / w.w.
    """

    layers: Indices
    eta: Vector
    w0: Vector
    w1: Vector
    l0: Vector
    l1: Vector
    across: Vector
    along: Vector
    sums: Matrix


@part(fastmath=FAST)
def scale(point: Point, scaling: Scaling) -> bool:
    """Overwrite the scaling with that of a point.

    Returns:
        Whether all cones have Nesterov-Todd points.
    """
    u, z0, z1 = point.u, point.z0, point.z1
    layers, sums = scaling.layers, scaling.sums
    eta, w0, w1 = scaling.eta, scaling.w0, scaling.w1
    l0, l1, across, along = scaling.l0, scaling.l1, scaling.across, scaling.along
    ss, zz, sz, s_part, z_part, inverse = (
        sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    )  # fmt: skip
    cone_sums(layers, u, u, ss)
    cone_sums(layers, z1, z1, zz)
    cone_sums(layers, u, z1, sz)
    outside = 0
    for c in range(len(z0)):
        s_norm, z_norm = np.sqrt(ss[c]), np.sqrt(zz[c])
        s_size = (1.0 - s_norm) * (1.0 + s_norm)
        z_size = (z0[c] - z_norm) * (z0[c] + z_norm)
        outside += not (s_size > 0.0)
        outside += not (z_size > 0.0)
        s_size, z_size = np.sqrt(s_size), np.sqrt(z_size)
        inner = (z0[c] + sz[c]) / (s_size * z_size)
        double = np.sqrt(2.0 + 2.0 * inner)
        eta[c] = np.sqrt(s_size / z_size)
        w0[c] = (1.0 / s_size + z0[c] / z_size) / double
        s_part[c] = 1.0 / (s_size * double)
        z_part[c] = 1.0 / (z_size * double)
    if outside:
        return False
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        own, dual, w = u[a:b], z1[a:b], w1[a:b]
        for c in range(len(own)):
            w[c] = s_part[c] * own[c] - z_part[c] * dual[c]
    ww, wz = ss, zz
    cone_sums(layers, w1, w1, ww)
    cone_sums(layers, w1, z1, wz)
    for c in range(len(z0)):
        l0[c] = eta[c] * (w0[c] * z0[c] + wz[c])
        wz[c] = z0[c] + wz[c] / (1.0 + w0[c])
        across[c] = eta[c] * eta[c]
        along[c] = across[c] / (1.0 + 2.0 * ww[c])
        inverse[c] = 1.0 / (ww[c] if ww[c] > 0.0 else 1.0)
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        dual, w, scaled = z1[a:b], w1[a:b], l1[a:b]
        for c in range(len(w)):
            scaled[c] = eta[c] * (dual[c] + wz[c] * w[c])
    return True


@part(fastmath=FAST)
def square_scaled(scaling: Scaling, x: Vector, out: Vector) -> None:
    """D^-1 x."""
    layers, w1, sums = scaling.layers, scaling.w1, scaling.sums
    across, along = scaling.across, scaling.along
    part, inverse = sums[0], sums[5]
    cone_sums(layers, x, w1, part)
    for c in range(len(part)):
        part[c] *= inverse[c]
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        own, w, product = x[a:b], w1[a:b], out[a:b]
        for c in range(len(w)):
            lengthwise = part[c] * w[c]
            product[c] = across[c] * (own[c] - lengthwise) + along[c] * lengthwise


@part(fastmath=FAST)
def correct(scaling: Scaling, step: Point, target: float, sides: Sides) -> None:
    """Solve l o t = r = target e - l o l - (W^-1 ds) o (W dz) for t."""
    du, dz0, dz1 = step.u, step.z0, step.z1
    t0, t1, r0 = sides.t0, sides.t1, sides.r0
    layers, eta, w0, w1 = scaling.layers, scaling.eta, scaling.w0, scaling.w1
    l0, l1, sums = scaling.l0, scaling.l1, scaling.sums
    ds, dz, ll, lt = sums[0], sums[1], sums[2], sums[3]
    cone_sums(layers, w1, du, ds)
    cone_sums(layers, w1, dz1, dz)
    for c in range(len(eta)):
        ll[c], lt[c] = 0.0, 0.0
        s0 = -ds[c] / eta[c]
        y0 = eta[c] * (w0[c] * dz0[c] + dz[c])
        r0[c] = target - s0 * y0 - l0[c] * l0[c]
        ds[c] = ds[c] / (1.0 + w0[c])
        dz[c] = dz0[c] + dz[c] / (1.0 + w0[c])
        # kept for the columns
        sums[4, c], t0[c] = s0, y0
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        w, scaled, t = w1[a:b], l1[a:b], t1[a:b]
        s_step, z_step = du[a:b], dz1[a:b]
        for c in range(len(w)):
            s1 = (s_step[c] + ds[c] * w[c]) / eta[c]
            y1 = eta[c] * (z_step[c] + dz[c] * w[c])
            r0[c] -= s1 * y1 + scaled[c] * scaled[c]
            t[c] = -(sums[4, c] * y1 + t0[c] * s1) - 2.0 * l0[c] * scaled[c]
            ll[c] += scaled[c] * scaled[c]
            lt[c] += scaled[c] * t[c]
    for c in range(len(eta)):
        size = np.sqrt(ll[c])
        t0[c] = (l0[c] * r0[c] - lt[c]) / ((l0[c] - size) * (l0[c] + size))
        ll[c] = 1.0 / l0[c]
    for layer in range(len(layers) - 1):
        a, b = layers[layer], layers[layer + 1]
        scaled, t = l1[a:b], t1[a:b]
        for c in range(len(t)):
            t[c] = (t[c] - t0[c] * scaled[c]) * ll[c]
