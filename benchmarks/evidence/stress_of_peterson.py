"""Compare peak stresses with published stress concentration factors (Peterson).

``python -m benchmarks.evidence.stress_of_peterson [--parts 0:10] [--accuracy 0.02]``

The ten random parts are shafts with shoulder fillets in tension, bending and torsion,
shafts with grooves in torsion, and plates with a hole in tension.  The largest
principal stress is compared.  The published formulas are accurate to 1 to 3 %.
"""

import argparse

import numpy as np
from numpy.typing import NDArray

from benchmarks.evidence.stress_of_notches import COMPONENTS, Part, surface_of
from forcefit.stiffness.fem.fea import FemOptions, solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.stress import stress_influence
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import Surface, check_surface

SEED = 20261126
# coefficients of 1, sqrt(h / r) and h / r in C_1 to C_4, where the stress concentration
# factor is the sum of C_k (2 h / D)^(k - 1), from Pilkey & Pilkey (2008), Peterson's
# Stress Concentration Factors, charts 2.47 and 3.12
FITS = {
    "shoulder": [
        [0.905, 0.783, -0.075],
        [-0.437, -1.969, 0.553],
        [1.557, 1.073, -0.578],
        [-1.061, 0.171, 0.086],
    ],
    "groove": [
        [0.966, 1.056, -0.022],
        [-0.192, -4.037, 0.674],
        [0.808, 5.321, -1.231],
        [-0.567, -2.364, 0.566],
    ],
}


def shoulder_factor(load: str, wide: float, radius: float) -> float:
    """Return the stress concentration factor of a shoulder fillet.

    The formulas are from Tipton, Sorem & Rolovic (1996).

    Args:
        load: tension or bending.
        wide: [-] D / d.
        radius: [-] r / d.

    Returns:
        [-] factor that refers to the nominal stress at the smaller diameter.
    """
    square = wide**2
    if load == "tension":
        above = 3.43 - 3.41 * square + 0.0232 * square**2
        below = 1 - 8.85 * square - 0.078 * square**2
        return float(
            0.493 + 0.48 * wide**-2.43 + radius**-0.48 * np.sqrt(above / below)
        )
    above = -0.14 - 0.363 * square + 0.503 * square**2
    below = 1 - 2.39 * square + 3.368 * square**2
    return float(0.632 + 0.377 * wide**-4.4 + radius**-0.5 * np.sqrt(above / below))


KINDS = [("shoulder", "tension"), ("shoulder", "bending"), ("shoulder", "torsion"),
         ("groove", "torsion"), ("hole", "tension")]  # fmt: skip


def draw(number: int) -> tuple[Part, float]:
    """Return a random part with lengths in mm, and its thickness if it is a plate."""
    rng = np.random.default_rng([SEED, number])
    kind, load = KINDS[number % len(KINDS)]
    if kind == "hole":
        width, hole = 40.0, float(rng.uniform(8, 16))
        part = Part(kind, width, hole, hole / 2, 0, 60, 120, load, 0.0)
        return part, float(rng.uniform(3, 6))
    small = 20.0
    radius = small * float(rng.uniform(0.1, 0.16))
    if kind == "groove":
        part = Part(kind, small + 2 * radius, small, radius, 0, 40, 80, load, 0.0)
    else:
        large = small + 2 * radius * float(rng.uniform(0.8, 1.9))
        place = 1.2 * large
        part = Part(kind, large, small, radius, 0, place, place + 45, load, 0.0)
    return part, 0.0


def expected(part: Part, thick: float) -> float:
    """Return the largest principal stress [Pa] under a load of 1 N or 1 N m."""
    D, d = part.large / 1e3, part.small / 1e3
    if part.kind == "hole":
        share = d / D
        factor = 3 - 3.14 * share + 3.667 * share**2 - 1.527 * share**3
        return factor / ((D - d) * thick / 1e3)
    h = (D - d) / 2
    if part.load == "torsion":
        ratio = h / (part.radius / 1e3)
        C = np.array(FITS[part.kind]) @ [1, np.sqrt(ratio), ratio]
        factor = float(C @ (2 * h / D) ** np.arange(4))
    else:
        factor = shoulder_factor(part.load, D / d, part.radius / 1e3 / d)
    nominal = {"tension": 4 / (np.pi * d**2), "bending": 32 / (np.pi * d**3),
               "torsion": 16 / (np.pi * d**3)}  # fmt: skip
    return factor * nominal[part.load]


def plate(part: Part, thick: float) -> Surface:
    """Return a plate with a hole, normal to x."""
    half, end, r = part.large / 2e3, part.length / 1e3, part.small / 2e3
    corner = np.arctan2(half, end / 2)
    quarter = np.r_[np.linspace(0, corner, 7), np.linspace(corner, np.pi / 2, 11)[1:]]
    angle = np.concatenate([quarter[:-1], np.pi - quarter[::-1][:-1]])
    angle = np.concatenate([angle, angle + np.pi])
    y, z = np.sin(angle), np.cos(angle)
    reach = np.minimum(half / np.maximum(np.abs(y), 1e-12),
                       end / 2 / np.maximum(np.abs(z), 1e-12))  # fmt: skip
    count = len(angle)
    rings = [
        np.column_stack([np.full(count, x), size * y, size * z + end / 2])
        for x in (0, thick / 1e3)
        for size in (reach, np.full(count, r))
    ]
    following = (np.arange(count) + 1) % count
    triangles = []
    for one, other in ((0, 1), (2, 3), (0, 2), (1, 3)):
        a, b = one * count + np.arange(count), one * count + following
        c, d = other * count + np.arange(count), other * count + following
        triangles += [np.column_stack([a, b, d]), np.column_stack([a, d, c])]
    return check_surface(np.concatenate(rings), np.concatenate(triangles), "plate")


def largest_principal(stresses: NDArray) -> float:
    """Return the largest principal stress [Pa] of p points, with xx yy zz yz xz xy."""
    x, y, z, yz, xz, xy = stresses.T
    rows = [[x, xy, xz], [xy, y, yz], [xz, yz, z]]
    tensors = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    return float(np.linalg.eigvalsh(tensors).max())


def main() -> None:
    """Print the errors of each part, and count parts with a sufficient estimate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--accuracy", type=float, default=0.02)
    parser.add_argument("--parts", default="0:10")
    asked = parser.parse_args()
    covered = []
    for number in range(*map(int, asked.parts.split(":"))):
        part, thick = draw(number)
        solved = solve_link(
            plate(part, thick) if thick else surface_of(part),
            parse_interface("z=0"),
            parse_interface(f"z={part.length / 1e3}"),
            [Material(2.1e11, 0.3)],
            options=FemOptions(asked.accuracy),
        )
        field = stress_influence(solved, away=part.large / 2e3)
        load = np.eye(6)[COMPONENTS[part.load]]
        told = field.peak_error(load) / field.peak(load)[0]
        found = largest_principal(field.stresses(load))
        error = found / expected(part, thick) - 1
        covered.append(abs(error) <= told)
        print(
            f"{part.kind:9s}{part.load:8s} error {100 * error:6.2f} %, estimated "
            f"{100 * told:5.1f} %{'' if covered[-1] else ' MISSED'}",
            flush=True,
        )
    print(f"{sum(covered)} of {len(covered)} covered")


if __name__ == "__main__":
    main()
