"""Evaluate the estimated error of peak stresses on notched shafts.

``python benchmarks/evidence/stress_of_notches.py [--accuracy 0.02] [--parts 0:20]``

Twenty random shafts with shoulders, grooves or bores are loaded in tension, torsion or
bending.  They are solved as by ``forcefit stiffness stress``, and stresses at a
distance of one radius or more from the ends are evaluated.  The references were
computed with quadratic axisymmetric elements of scikit-fem and rigid ends, and are
accurate to 0.25 %.

The program prints the true error and the estimated error of each part, and the number
of parts whose estimated error is at least the true error.  Each part takes 20 to 100 s.
"""

import argparse
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.fem.fea import FemOptions, solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.stress import peak_stress
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import Surface, check_surface

# number of facets around the axis, number of rings of a fillet, and [m] largest
# distance between rings
AROUND, ROWS, APART = 48, 8, 0.005
COMPONENTS = {"tension": 5, "torsion": 2, "bending": 1}


class Part(NamedTuple):
    """Shaft along z, with lengths in mm.

    Attributes:
        kind: ``"shoulder"`` or ``"groove"``.
        large: diameter at the base, or at both ends of a shaft with a groove.
        small: diameter beyond the shoulder, or at the bottom of the groove.
        radius: radius of the fillet or of the groove.
        bore: diameter of the bore, or 0.
        place: position of the shoulder or of the middle of the groove along z.
        length: length from base to tip.
        load: kind of load at the tip, 1 N or 1 N m.
        peak: [Pa] largest von Mises stress, except near both ends.
    """

    kind: str
    large: float
    small: float
    radius: float
    bore: float
    place: float
    length: float
    load: str
    peak: float


PARTS = (
    Part("shoulder", 26.863, 20, 2.402, 0, 32.2355, 77.2355, "tension", 5576.7),
    Part("shoulder", 31.4763, 20, 2.3633, 0, 37.7716, 82.7716, "torsion", 1.4763e6),
    Part("shoulder", 29.6787, 20, 3.3875, 0, 35.6144, 80.6144, "bending", 1.8018e6),
    Part("shoulder", 38.4823, 20, 1.8611, 0, 46.1788, 91.1788, "tension", 6524.6),
    Part("shoulder", 34.4446, 20, 2.1756, 0, 41.3335, 86.3335, "torsion", 1.5052e6),
    Part("shoulder", 39.4714, 20, 3.7916, 0, 47.3657, 92.3657, "bending", 1.7525e6),
    Part("shoulder", 34.1739, 20, 3.3571, 0, 41.0087, 86.0087, "tension", 5306.2),
    Part("shoulder", 32.2425, 20, 3.5473, 0, 38.691, 83.691, "torsion", 1.3766e6),
    Part("shoulder", 31.1741, 20, 2.2809, 0, 37.4089, 82.4089, "bending", 2.0076e6),
    Part("groove", 20, 15.2389, 1.8446, 0, 35, 70, "tension", 11190),
    Part("groove", 20, 13.8482, 2.2413, 0, 35, 70, "torsion", 4.5775e6),
    Part("groove", 20, 14.0681, 2.4611, 0, 35, 70, "bending", 5.5558e6),
    Part("groove", 20, 14.3026, 2.1163, 0, 35, 70, "tension", 11958),
    Part("groove", 20, 15.0746, 1.7126, 0, 35, 70, "torsion", 3.821e6),
    Part("groove", 20, 14.4653, 2.0965, 0, 35, 70, "bending", 5.4229e6),
    Part("shoulder", 27.3507, 20, 2.5727, 10.7848, 32.8208, 77.8208, "tension", 7440.3),
    Part("shoulder", 32, 20, 2.2973, 11.6809, 40.4488, 85.4488, "torsion", 1.6241e6),
    Part("shoulder", 32, 20, 2.5252, 11.4027, 39.6168, 84.6168, "bending", 2.2221e6),
    Part("shoulder", 29.1095, 20, 3.1883, 7.8829, 34.9314, 79.9314, "tension", 6096.9),
    Part("shoulder", 28.1848, 20, 2.8647, 7.3674, 33.8218, 78.8218, "torsion",
         1.4371e6),
)  # fmt: skip


def outline(part: Part) -> NDArray:
    """Return the radius and z of rings on the surface of a shaft, (k, 2) [m]."""
    R, q, r, place, end = (
        v / 1e3 for v in (part.large / 2, part.small / 2, part.radius, part.place,
                          part.length)
    )  # fmt: skip
    if part.kind == "shoulder":
        turn = np.linspace(0, np.pi / 2, ROWS + 1)
        arc = np.column_stack([q + r - r * np.sin(turn), place + r - r * np.cos(turn)])
        corners = [[R, 0], [R, place], *arc, [q, end]]
    else:
        turn = np.linspace(0, np.pi, 2 * ROWS + 1)
        arc = np.column_stack([q + r - r * np.sin(turn), place - r * np.cos(turn)])
        corners = [[R, 0], [R, place - r], *arc, [R, place + r], [R, end]]
    if part.bore:
        corners += [[part.bore / 2e3, end], [part.bore / 2e3, 0], [R, 0]]
    rings = [np.array(corners[:1])]
    for a, b in zip(np.array(corners[:-1]), np.array(corners[1:]), strict=True):
        count = max(1, round(float(np.linalg.norm(b - a)) / APART))
        rings.append(a + np.linspace(0, 1, count + 1)[1:, None] * (b - a))
    return np.concatenate(rings)


def surface_of(part: Part) -> Surface:
    """Return the triangulated surface of a shaft."""
    profile = outline(part)
    if part.bore:  # an even number of rings, so that the last one matches the first
        profile = profile[:-1]
        if len(profile) % 2:
            profile = np.insert(profile, 1, (profile[0] + profile[1]) / 2, axis=0)
    count, number = len(profile), np.arange(AROUND)
    angle = 2 * np.pi / AROUND * (number + 0.5 * (np.arange(count)[:, None] % 2))
    points = np.stack([
        profile[:, :1] * np.cos(angle), profile[:, :1] * np.sin(angle),
        np.broadcast_to(profile[:, 1:], angle.shape),
    ], axis=-1).reshape(-1, 3)  # fmt: skip
    following, triangles = (number + 1) % AROUND, []
    for k in range(count if part.bore else count - 1):
        a, b = k * AROUND + number, k * AROUND + following
        c, d = ((k + 1) % count * AROUND + n for n in (number, following))
        pair = ((a, b, c), (b, d, c)) if k % 2 == 0 else ((a, b, d), (a, d, c))
        triangles += [np.column_stack(corners) for corners in pair]
    if not part.bore:
        ends = [[0, 0, profile[0, 1]], [0, 0, profile[-1, 1]]]
        last = (count - 1) * AROUND
        low, high = (np.full(AROUND, len(points) + k) for k in (0, 1))
        triangles.append(np.column_stack([low, following, number]))
        triangles.append(np.column_stack([high, last + number, last + following]))
        points = np.concatenate([points, ends])
    return check_surface(points, np.concatenate(triangles), part.kind)


def main() -> None:
    """Print the errors of each part, and count parts with a sufficient estimate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--accuracy", type=float, default=0.02)
    parser.add_argument("--parts", default="0:20")
    asked = parser.parse_args()
    first, last = map(int, asked.parts.split(":"))
    covered = 0
    for part in PARTS[first:last]:
        solved = solve_link(
            surface_of(part),
            parse_interface("z=0"),
            parse_interface(f"z={part.length / 1e3}"),
            [Material(2.1e11, 0.3)],
            options=FemOptions(asked.accuracy),
        )
        load = np.eye(6)[COMPONENTS[part.load]]
        peak = peak_stress(solved, load, away=part.large / 2e3)
        error = peak.von_mises / part.peak - 1
        inside = abs(peak.von_mises - part.peak) <= peak.error
        covered += inside
        print(
            f"{part.kind:9s}{part.load:8s} error {100 * error:6.2f} %, estimated "
            f"{100 * peak.error / peak.von_mises:5.1f} %{'' if inside else ' MISSED'}",
            flush=True,
        )
    print(f"{covered} of {len(PARTS[first:last])} covered")


if __name__ == "__main__":
    main()
