"""Evaluate the error estimate of K_E on random parts, compared with other solvers.

``python benchmarks/evidence/stiffness_random_parts.py [--set test] [--parts 0:33]``
requires NGSolve (``pip install ngsolve``) for parts without a stored reference.

There are eleven kinds of parts: plate, bar, box, channel, L-bracket, fork, rod, tube,
cone, stepped rod, and eye with a bore.  Poisson's ratio is between 0 and 0.45.  Each
part is solved with the default accuracy of ``forcefit stiffness fea`` and compared with
the K of ``stiffness_random_references.py``.

For each part, the program prints the true error with the uncertainty of the reference,
the estimated error, and their ratio (effectivity).  Errors are the largest errors of an
entry, relative to sqrt(K_ii K_jj).  A part is covered if the estimated error is at
least the true error.

References and results are stored in JSON files, so that an interrupted run can be
continued.  Delete the file of results after a change of the code.
"""

import argparse
import json
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.stiffness.fem.fea import solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.link import scaled
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import Surface, check_surface

YOUNG = 60e9  # [Pa] Young's modulus
# seed of each set of parts; the error estimate was calibrated with the set "training"
SEEDS = {"training": 1, "test": 2, "middle": 1142}
KINDS = ("plate", "bar", "box", "channel", "bracket", "fork",
         "rod", "tube", "cone", "stepped", "eye")  # fmt: skip
FACETS = 64
REFERENCES = Path(__file__).with_suffix(".json")


@dataclass(frozen=True, eq=False)
class Part:
    """Part that consists of bricks, body of revolution, or bar with a bore.

    Attributes:
        kind: one of ``KINDS``.
        nu: [-] Poisson's ratio.
        base: definition of the fixed interface.
        tip: definition of the moving interface.
        planes: [m] positions of the faces of bricks along x, y and z.
        full: (nx, ny, nz) bool, True for bricks that belong to the part.
        profile: (k, 2) [m] coordinates r and z of the corners of a half section.
        eye: [m] width, thickness, length to the axis of the bore, radius of the bore.
    """

    kind: str
    nu: float
    base: str
    tip: str
    planes: tuple[list[float], ...] = ()
    full: NDArray = field(default_factory=lambda: np.zeros((0, 0, 0), dtype=bool))
    profile: tuple[tuple[float, float], ...] = ()
    eye: tuple[float, ...] = ()


def draw_part(seed: int, number: int) -> Part:
    """Return the part with a given number.

    Args:
        seed: seed of the set of parts.
        number: number of the part, which determines its kind and its dimensions.

    Returns:
        The part.
    """
    rng = np.random.default_rng([seed, number])
    kind = KINDS[number % len(KINDS)]
    nu = float(rng.uniform(0, 0.45))
    L = between(rng, 0.05, 0.3)
    base, tip = "z=0", f"z={L!r}"
    bricks = {"plate": plate, "bar": bar, "box": box, "channel": channel, "fork": fork}
    if kind in bricks:
        planes, full = bricks[kind](rng, L)
        return Part(kind, nu, base, tip, planes, np.array(full, dtype=bool))
    if kind == "bracket":
        planes, full = bracket(rng, L)
        return Part(kind, nu, base, f"x={planes[0][-1]!r}", planes, full)
    if kind == "eye":
        W = L * between(rng, 0.15, 0.6)
        T, r = W * between(rng, 0.1, 1.0), W * between(rng, 0.15, 0.35)
        tip = f"bore=0,0,{L!r}/0,1,0/{r!r}"
        return Part(kind, nu, base, tip, eye=(W, T, L, r))
    r = L / between(rng, 2.0, 15.0)
    inner = r * (1 - between(rng, 0.08, 0.5))
    other = r * between(rng, 0.4, 0.85)
    step = L * float(rng.uniform(0.25, 0.75))
    profile: tuple[tuple[float, float], ...] = {
        "rod": ((0, 0), (r, 0), (r, L), (0, L)),
        "tube": ((inner, 0), (r, 0), (r, L), (inner, L)),
        "cone": ((0, 0), (r, 0), (other, L), (0, L)),
        "stepped": ((0, 0), (r, 0), (r, step), (other, step), (other, L), (0, L)),
    }[kind]
    return Part(kind, nu, base, tip, profile=profile)


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a random number with a uniformly distributed logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def symmetric(*places: float) -> list[float]:
    """Return positions and their mirror images in ascending order."""
    return sorted([*(-p for p in places), *places])


def plate(rng: np.random.Generator, L: float) -> tuple:
    """Return a wide, thin plate."""
    W = L * between(rng, 0.3, 1.2)
    T = max(W * between(rng, 0.02, 0.12), np.hypot(L, W) / 60)
    return (symmetric(W / 2), symmetric(T / 2), [0, L]), [[[1]]]


def bar(rng: np.random.Generator, L: float) -> tuple:
    """Return a bar with a rectangular section."""
    W = L / between(rng, 1.5, 12)
    T = W * between(rng, 0.3, 1)
    return (symmetric(W / 2), symmetric(T / 2), [0, L]), [[[1]]]


def box(rng: np.random.Generator, L: float) -> tuple:
    """Return a bar with a hollow rectangular section."""
    W = L / between(rng, 2, 8)
    H = W * between(rng, 0.5, 1)
    t = H * between(rng, 0.07, 0.25)
    ring = [[[1]] * 3, [[1], [0], [1]], [[1]] * 3]
    return (symmetric(W / 2, W / 2 - t), symmetric(H / 2, H / 2 - t), [0, L]), ring


def channel(rng: np.random.Generator, L: float) -> tuple:
    """Return a channel with a web at the smallest x and two flanges."""
    H = L / between(rng, 2, 7)
    W = H * between(rng, 0.4, 0.9)
    t = H * between(rng, 0.08, 0.2)
    open_ring = [[[1]] * 3, [[1], [0], [1]]]
    return ([0, t, W], symmetric(H / 2, H / 2 - t), [0, L]), open_ring


def fork(rng: np.random.Generator, L: float) -> tuple:
    """Return a block with two prongs, whose ends are the tip."""
    W = L / between(rng, 1, 4)
    w, T = W * between(rng, 0.1, 0.35), W * between(rng, 0.15, 1)
    block = L * between(rng, 0.15, 0.6)
    full = [[[1, 1]], [[1, 0]], [[1, 1]]]
    return (symmetric(W / 2, W / 2 - w), symmetric(T / 2), [0, block, L]), full


def bracket(rng: np.random.Generator, L: float) -> tuple:
    """Return an L-bracket whose arms have equal thickness."""
    t = L * between(rng, 0.07, 0.35)
    D = t * between(rng, 0.5, 4)
    arm = t + (L - t) * between(rng, 0.4, 1)
    full = np.array([[[1, 1]], [[0, 1]]], dtype=bool)
    return ([-t / 2, t / 2, arm - t / 2], symmetric(D / 2), [0, L - t, L]), full


def surface_of(part: Part) -> Surface:
    """Return the triangulated surface of a part.

    Args:
        part: part of any kind.

    Returns:
        The closed surface.
    """
    if part.profile:
        points, triangles = revolved(part.profile)
    elif part.eye:
        points, triangles = eye_surface(*part.eye)
    else:
        points, triangles = brick_surface(part.planes, part.full)
    used, triangles = np.unique(triangles, return_inverse=True)
    return check_surface(points[used], triangles.reshape(-1, 3), part.kind)


def brick_surface(
    planes: tuple[list[float], ...], full: NDArray
) -> tuple[NDArray, NDArray]:
    """Return the faces between full and empty bricks as triangles."""
    counts = [len(p) for p in planes]
    points = np.stack(np.meshgrid(*planes, indexing="ij"), axis=-1).reshape(-1, 3)
    around = np.pad(full, 1)
    triangles = []
    for i, j, k in np.argwhere(full):
        for axis in range(3):
            u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
            for side in (0, 1):
                step = np.eye(3, dtype=int)[axis]
                place = np.array([i, j, k])
                if around[tuple(place + 1 + (2 * side - 1) * step)]:
                    continue
                a = place + side * step
                ring = [a, a + u, a + u + v, a + v][:: 2 * side - 1]
                a, b, c, d = (np.ravel_multi_index(tuple(p), counts) for p in ring)
                triangles += [(a, b, c), (a, c, d)]
    return points, np.array(triangles)


def revolved(profile: tuple[tuple[float, float], ...]) -> tuple[NDArray, NDArray]:
    """Return the surface of revolution of a half section about z."""
    angle = 2 * np.pi * np.arange(FACETS) / FACETS
    rings, points = [], []
    for r, z in profile:
        around = np.column_stack([r * np.cos(angle), r * np.sin(angle), 0 * angle + z])
        rings.append(len(points) + (np.arange(FACETS) if r > 0 else np.zeros(FACETS)))
        points += list(around if r > 0 else around[:1])
    triangles = []
    for one, other in zip(rings, rings[1:] + rings[:1], strict=True):
        next_one, next_other = np.roll(one, -1), np.roll(other, -1)
        quads = np.column_stack([one, next_one, next_other, other]).astype(int)
        triangles += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    all_ = np.concatenate(triangles)
    proper = (all_ != np.roll(all_, 1, axis=1)).all(axis=1)
    return np.array(points), all_[proper]


def eye_surface(W: float, T: float, L: float, r: float) -> tuple[NDArray, NDArray]:
    """Return the surface of a bar with a round end and a bore along y."""
    angle = 2 * np.pi * np.arange(FACETS) / FACETS
    hole = r * np.column_stack([np.cos(angle), np.sin(angle)])
    rim = W / 2 * np.column_stack([np.cos(angle), np.sin(angle)])
    # below the bore, the outline consists of the sides and the end of the bar
    low = np.arange(FACETS) > FACETS // 2
    way = np.minimum(W / 2 / np.maximum(np.abs(hole[:, 0] / r), 1e-9),
                     L / np.maximum(np.abs(hole[:, 1] / r), 1e-9))  # fmt: skip
    rim[low] = hole[low] / r * way[low, None]
    for x in (-1, 1):  # move the nearest points to the corners of the bar
        corner = np.array([x * W / 2, -L])
        toward = (hole / r) @ corner
        rim[np.where(low, toward, -np.inf).argmax()] = corner
    layers = [(hole, -T / 2), (rim, -T / 2), (rim, T / 2), (hole, T / 2)]
    points = np.concatenate([
        np.column_stack([ring[:, 0], 0 * angle + y, L + ring[:, 1]])
        for ring, y in layers
    ])
    i, j = np.arange(FACETS), np.roll(np.arange(FACETS), -1)
    triangles = []
    for k in range(4):
        one, other = k * FACETS, (k + 1) % 4 * FACETS
        triangles.append(np.column_stack([i + one, j + one, j + other]))
        triangles.append(np.column_stack([i + one, j + other, i + other]))
    return points, np.concatenate(triangles)


def answer(part: Part) -> dict:
    """Return K by the command ``stiffness fea``, and its error estimates."""
    start = time.process_time()
    faces = [parse_interface(text) for text in (part.base, part.tip)]
    solved = solve_link(surface_of(part), *faces, [Material(YOUNG, part.nu)])
    link = solved.link
    return {
        "mesh_stiffness": solved.level.solution.stiffness.tolist(),
        "stiffness": link.stiffness.tolist(),
        "told": np.abs(link.relative_errors).max(),
        "unknowns": link.mesh["unknowns"],
        "meshes": link.mesh["meshes"],
        "seconds": time.process_time() - start,
    }


def kept(path: Path, key: str, make) -> dict:
    """Return a value stored in a JSON file, or compute and store it."""
    stored = json.loads(path.read_text()) if path.exists() else {}
    if key not in stored:
        made = make()
        stored = json.loads(path.read_text()) if path.exists() else {}
        stored[key] = made
        path.write_text(json.dumps(stored, indent=0) + "\n")
    return stored[key]


def reference(part: Part) -> dict:
    """Return the K that a second solver computes, and its uncertainty."""
    from stiffness_random_references import independent_stiffness

    return independent_stiffness(part, YOUNG)


def judge(
    name: str, number: int, references: Path, answers: Path
) -> tuple[float, float, float]:
    """Print a row of the table for a part."""
    part = draw_part(SEEDS[name], number)
    known = kept(references, f"{name}-{number}", lambda: reference(part))
    kept_rows = kept(answers, f"{name}-{number}",
                 lambda: answer(part))  # fmt: skip
    truth = np.array(known["stiffness"])
    true, own = (
        np.abs(scaled(np.array(kept_rows[name]) - truth, truth)).max()
        for name in ("stiffness", "mesh_stiffness")
    )
    ratio = kept_rows["told"] / true
    print(
        f"{number:3d} {part.kind:8} {part.nu:5.2f} {kept_rows['unknowns']:8d} "
        f"{kept_rows['meshes']:2d} {100 * true:9.4f} +- {100 * known['unsure']:.4f} % "
        f"{100 * kept_rows['told']:9.4f} % {ratio:6.2f} {100 * own:9.4f} % "
        f"{kept_rows['seconds']:6.1f} s",
        flush=True,
    )
    return float(ratio), float(true), float(own)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--set", choices=list(SEEDS), default="test")
    parser.add_argument(
        "--parts", default="0:33", help="numbers of the parts, FIRST:END"
    )
    parser.add_argument("--references", type=Path, default=REFERENCES)
    parser.add_argument("--answers", type=Path, default=Path("random_parts.json"))
    asked = parser.parse_args()
    print("    part        nu unknowns meshes  true error      estimated  ratio  mesh")
    numbers = range(*(int(n) for n in asked.parts.split(":")))
    ratios, true, own = np.transpose([
        judge(asked.set, n, asked.references, asked.answers) for n in numbers
    ])
    low, five, half, most, high = np.quantile(ratios, [0, 0.05, 0.5, 0.95, 1])
    print(f"estimated / true: least {low:.2f}, 5 % {five:.2f}, median {half:.2f}, 95 % "
          f"{most:.2f}, largest {high:.2f}; covered {(ratios >= 1).sum()} of "
          f"{len(ratios)}; mean true error {100 * true.mean():.3f} %, of the "
          f"unextrapolated K {100 * own.mean():.3f} %")  # fmt: skip
