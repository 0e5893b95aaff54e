"""Measure the time of K_E for random parts with many surface triangles.

    python -m benchmarks.evidence.stiffness_seconds OUT.json [--count 50] [--seed 3]
        [--accuracy 0.005]

The parts are those of ``stiffness_random_parts.py`` with another seed.  The triangles
of their surfaces are divided until there are 10 000 to 40 000 triangles.  The parts are
solved as by ``forcefit stiffness fea``, without stored meshes.  The table contains the
numbers of triangles and unknowns, the estimated error, and the wall and processor times
including the mesher.  An interrupted run can be continued.
"""

import argparse
import json
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.evidence.stiffness_random_parts import YOUNG, draw_part, surface_of
from forcefit.inputs.writing import write_json
from forcefit.stiffness.fem.fea import FemOptions, solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import Surface, check_surface

FEWEST = 10_000  # minimum number of triangles of a surface
WHO = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN


def finer(surface: Surface) -> Surface:
    """Return a surface whose triangles are repeatedly divided into four triangles."""
    points, triangles = surface.points, surface.triangles
    while len(triangles) < FEWEST:
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
        own, place = np.unique(edges, axis=0, return_inverse=True)
        a, b, c = (len(points) + place.reshape(-1, 3)).T
        i, j, k = triangles.T
        points = np.vstack([points, points[own].mean(axis=1)])
        parts = ([i, a, c], [a, j, b], [c, b, k], [a, b, c])
        triangles = np.vstack([np.column_stack(part) for part in parts])
    return check_surface(points, triangles, surface.name)


def spent() -> float:
    """Return the processor time [s] of this process and its children."""
    used = [resource.getrusage(who) for who in WHO]
    return sum(one.ru_utime + one.ru_stime for one in used)


def run_part(seed: int, number: int, accuracy: float) -> dict[str, float | str]:
    """Return the numbers of triangles and unknowns, the error and the times [s]."""
    part = draw_part(seed, number)
    surface = finer(surface_of(part))
    faces = [parse_interface(text) for text in (part.base, part.tip)]
    began, used = time.monotonic(), spent()
    with tempfile.TemporaryDirectory() as empty:
        options = FemOptions(accuracy=accuracy, cache=empty)
        material = Material(YOUNG, part.nu)
        link = solve_link(surface, *faces, [material], options=options).link
    return {
        "kind": part.kind, "triangles": len(surface.triangles),
        "unknowns": int(link.mesh["unknowns"]),
        "told": float(np.abs(link.relative_errors).max()),
        "wall": time.monotonic() - began, "processor": spent() - used,
    }  # fmt: skip


def main() -> None:
    """Print a row of the table for each part, and quantiles of the times."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--accuracy", type=float, default=0.005)
    given = parser.parse_args()
    answers = json.loads(given.out.read_text()) if given.out.exists() else {}
    for number in range(given.count):
        if str(number) not in answers:
            answers[str(number)] = run_part(given.seed, number, given.accuracy)
            write_json(answers, str(given.out))
        one = answers[str(number)]
        seconds = f"{one['wall']:6.1f} s, processor {one['processor']:6.1f} s"
        print(f"{number:3} {one['kind']:8} {one['triangles']:6} triangles, "
              f"{one['unknowns']:7} unknowns, estimated {one['told']:.2%}, {seconds}",
              flush=True)  # fmt: skip
    for what in ("wall", "processor"):
        seconds = np.array([one[what] for one in answers.values()])
        print(f"{what}: median {np.median(seconds):.1f}, 90 % "
              f"{np.quantile(seconds, 0.9):.1f}, longest {seconds.max():.1f} s, "
              f"{np.mean(seconds <= 60):.0%} within 60")  # fmt: skip


if __name__ == "__main__":
    main()
