"""Random parts of ``stiffness_fresh_parts.py``.

There are four kinds: plates with a filleted step or filleted ribs, blocks and rods with
layers of two or three materials, shafts with filleted shoulders, and thin walls.  The
shapes are modelled with the OCC kernel of NGSolve.
"""

from dataclasses import dataclass, field

import numpy as np
from netgen.occ import Box, Cylinder, Pnt, Z
from stiffness_part_references import corners_of

SEED = 20261126
KINDS = ("plate", "layers", "shaft", "thin")
EPS = 1e-4  # [mm] tolerance of equal positions


@dataclass
class Part:
    """A random part, with lengths in mm and stresses in N/mm^2.

    Attributes:
        note: description of the part for the table.
        solid: shape with its base at z = 0.
        L: [mm] position of the tip along z.
        mirrors: axes that are normal to a plane of symmetry of the part.
        size: [mm] size of elements along the edges, about the smallest thickness.
        maxh: [mm] size of all other elements.
        layers: (axis, from, to, Young's modulus, Poisson's ratio) of each layer.  A
            layer without an axis is the whole part.
        simple: [m] geometry for ``stiffness_random_references.independent_stiffness``,
            if it can be used.
        orders: polynomial orders of the reference solution.
    """

    note: str
    solid: object
    L: float
    mirrors: str
    size: float
    maxh: float
    layers: list
    simple: dict = field(default_factory=dict)
    orders: tuple = (4, 5)


def between(rng, low, high):
    """Return a random number with a uniformly distributed logarithm."""
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")


def block(low, high):
    """Return a box between two corners."""
    return Box(Pnt(*low), Pnt(*high))


def rounded(solid, radius, chosen):
    """Return a solid with fillets on selected edges."""
    return solid.MakeFillet([e for e in solid.edges if chosen(*corners_of(e))], radius)


def along(axis, low, high):
    """Return whether an edge is parallel to an axis."""
    extent = high - low
    return np.all(np.delete(extent, axis) < EPS) and extent[axis] > EPS


def plate(rng):
    """Return a plate with rounded corners, and with a step or with ribs."""
    L = between(rng, 60, 140)
    W = L * between(rng, 0.3, 0.8)
    T = W * between(rng, 0.07, 0.16)
    corner = W * between(rng, 0.08, 0.2)
    height = T * between(rng, 0.6, 1.5)
    fillet = height * between(rng, 0.25, 0.6)
    body = block((-W / 2, 0, 0), (W / 2, T, L))

    def corners(low, high):
        return along(1, low, high) and (low[2] < EPS or low[2] > L - EPS)

    count = int(rng.integers(3))  # number of ribs, or 0 for a step
    if count == 0:
        step = L * float(rng.uniform(0.3, 0.6))
        body = body + block((-W / 2, 0, 0), (W / 2, T + height, step))
        body = rounded(body, corner, corners)
        body = rounded(body, fillet, lambda a, b: along(0, a, b)
                       and abs(a[1] - T) < EPS and abs(a[2] - step) < EPS)  # fmt: skip
        note = "step"
    else:
        body = rounded(body, corner, corners)
        width = W * float(rng.uniform(0.12, 0.2))
        start, end = L * float(rng.uniform(0.1, 0.2)), L * float(rng.uniform(0.7, 0.88))
        for x in (0,) if count == 1 else (-W / 4, W / 4):
            rib = block((x - width / 2, T / 2, start), (x + width / 2, T + height, end))
            rib = rounded(rib, 0.3 * width, lambda a, b: along(1, a, b))
            body = body + rib
        body = rounded(body, fillet, lambda a, b: b[1] - a[1] < EPS
                       and abs(a[1] - T) < EPS and a[2] > start - EPS
                       and b[2] < end + EPS and a[0] > EPS - W / 2
                       and b[0] < W / 2 - EPS)  # fmt: skip
        note = f"{count} rib{'s' * (count - 1)}"
    return Part(note, body, L, "x", 0.8 * T, max(1.2 * T, W / 7), [])


def layers(rng):
    """Return a block or rod with layers normal to z, or a sandwich along z."""
    L = between(rng, 25, 60)
    W = L * between(rng, 0.4, 1.1)
    D = W * between(rng, 0.6, 1)
    young, contrast = 2.1e5, between(rng, 3, 1000)
    nu = [round(float(n), 2) for n in rng.uniform(0.2, 0.4, size=3)]
    form = ("soft layer", "two layers", "sandwich", "rod of three")[rng.integers(4)]
    first = (None, 0, 0, young, nu[0])
    low, high = sorted(round(L * float(u), 1) for u in rng.uniform(0.15, 0.85, size=2))
    high = max(high, round(low + 0.08 * L, 1))
    mirrors, solid = "xy", block((-W / 2, -D / 2, 0), (W / 2, D / 2, L))
    rows = [first, (2, low, high, young / contrast, nu[1])]
    if form == "two layers":
        rows[1] = (2, low, L, young / contrast, nu[1])
    elif form == "sandwich":
        core = round(W * float(rng.uniform(0.2, 0.4)), 2)
        rows[1] = (0, -core, core, young / contrast, nu[1])
    elif form == "rod of three":
        solid, D = Cylinder(Pnt(0, 0, 0), Z, W / 2, L), W
        rows.append((2, high, L, young / contrast**0.5, nu[2]))
    size = min(D / 4, W / 4, high - low if rows[1][0] == 2 else W / 2 - core)
    note = f"{form} 1:{contrast:g}"
    return Part(note, solid, L, mirrors, size, W / 3, rows, orders=(3, 4))


def shaft(rng):
    """Return a shaft with one or two filleted shoulders, with or without a bore."""
    r = between(rng, 8, 20)
    L = r * between(rng, 3.5, 9)
    radii = [r, r * float(rng.uniform(0.55, 0.85))]
    places = [0, L * float(rng.uniform(0.25, 0.5)), L]
    if rng.random() < 0.5:
        radii.append(radii[1] * float(rng.uniform(0.6, 0.85)))
        places.insert(2, L * float(rng.uniform(0.6, 0.8)))
    body = Cylinder(Pnt(0, 0, 0), Z, radii[0], places[1])
    for radius, start, end in zip(radii[1:], places[1:], places[2:], strict=False):
        body = body + Cylinder(Pnt(0, 0, start), Z, radius, end - start)
    for one, other, place in zip(radii, radii[1:], places[1:], strict=False):
        fillet = (one - other) * float(rng.uniform(0.3, 0.85))
        body = rounded(body, fillet, lambda a, b, p=place, r=other: abs(a[2] - p) < EPS
                       and abs(b[2] - p) < EPS and b[0] < r + EPS)  # fmt: skip
    size, note = radii[-1] / 2, f"{len(radii) - 1} shoulder"
    if rng.random() < 0.4:
        bore = radii[-1] * float(rng.uniform(0.3, 0.65))
        body = body - Cylinder(Pnt(0, 0, -1), Z, bore, L + 2)
        size, note = (radii[-1] - bore) / 1.5, note + ", bore"
    return Part(note, body, L, "xy", 0.7 * size, 0.5 * r, [])


def thin(rng):
    """Return a thin-walled tube of square or round section, or a channel."""
    W = between(rng, 25, 50)
    H = W * between(rng, 0.6, 1)
    L = W * between(rng, 1.2, 2.6)
    ratio = between(rng, 10, 40)
    t = W / ratio
    form = ("box", "rounded box", "channel", "tube")[rng.integers(4)]
    note, mirrors = f"{form}, wall 1/{ratio:g}", "y" if form == "channel" else "xy"
    simple = {}
    if form == "tube":
        ends = ((W / 2 - t, 0), (W / 2, 0), (W / 2, L), (W / 2 - t, L))
        simple = {"profile": tuple((r / 1e3, z / 1e3) for r, z in ends)}
        solid = Cylinder(Pnt(0, 0, 0), Z, W / 2, L)
        solid = solid - Cylinder(Pnt(0, 0, -1), Z, W / 2 - t, L + 2)
    else:
        solid = block((-W / 2, -H / 2, 0), (W / 2, H / 2, L))
        end = W if form == "channel" else W / 2 - t
        inside = block((t - W / 2, t - H / 2, -1), (end, H / 2 - t, L + 2))
        if form == "rounded box":
            solid, inside = (rounded(s, r, lambda a, b: along(2, a, b))
                             for s, r in ((solid, 2 * t), (inside, t)))  # fmt: skip
        else:
            xs = [-W / 2, t - W / 2, W / 2 - t, W / 2]
            ys = [-H / 2, t - H / 2, H / 2 - t, H / 2]
            full = np.ones((3, 3, 1), dtype=bool)
            full[1, 1] = False
            if form == "channel":
                xs, full = [xs[0], xs[1], xs[3]], full[:2]
            planes = [[v / 1e3 for v in axis] for axis in (xs, ys, [0, L])]
            simple = {"planes": planes, "full": full}
        solid = solid - inside
    return Part(note, solid, L, mirrors, t, max(W / 8, 2.5 * t), [], simple, (3, 4))


def draw_part(number):
    """Return the part with a given number."""
    rng = np.random.default_rng([SEED, number])
    nu = round(float(rng.uniform(0.2, 0.4)), 3)
    kind = KINDS[number % len(KINDS)]
    part = {"plate": plate, "layers": layers, "shaft": shaft, "thin": thin}[kind](rng)
    part.layers = part.layers or [(None, 0, 0, 2.1e5, nu)]
    return kind, part
