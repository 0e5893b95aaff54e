"""Evaluate the error estimate of K_E for random filleted, layered and thin parts.

First run ``python benchmarks/evidence/stiffness_fresh_references.py FOLDER``, which
requires NGSolve.  It writes the STEP files, and the reference K to a JSON file with the
name of this file.  Then run ``python benchmarks/evidence/stiffness_fresh_parts.py
FOLDER [--parts 0:40]``.

Each part is solved from its STEP file with the default accuracy of ``forcefit stiffness
fea``.  The program prints the true error with the uncertainty of the reference, the
estimated error, and other properties.  The error is the largest error of an entry,
relative to sqrt(K_ii K_jj).

A part is covered if its estimated error is at least the true error minus the
uncertainty of the reference.  It is strictly covered if its estimated error is at least
the true error.  A part without a mesh is not covered.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from forcefit.inputs.table import BadInput
from forcefit.stiffness.fem.fea import solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.part_text import parse_part
from forcefit.stiffness.link import scaled
from forcefit.stiffness.mesh.fit_to_patches import MeshFailed
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import read_surface

REFERENCES = Path(__file__).with_suffix(".json")


def solved(path: Path, known: dict) -> tuple[np.ndarray, float, dict]:
    """Return K of a part in a STEP file, its estimated error, and the mesh report."""
    base, tip = (parse_interface(f"z={z!r}") for z in (0.0, known["length"]))
    materials = [Material(known["young"], known["poisson"])]
    materials += [parse_part("--part", text) for text in known["parts"]]
    link = solve_link(read_surface(path), base, tip, materials).link
    return link.stiffness, float(np.abs(link.relative_errors).max()), dict(link.mesh)


def judge(number: int, known: dict, folder: Path) -> tuple[float, float, float]:
    """Print and return the true error, its uncertainty and the estimated error."""
    start, truth = time.process_time(), np.array(known["stiffness"])
    head = f"{number:2d} {known['kind']:6} {known['note']:28} {known['poisson']:5.3f}"
    try:
        K, told, mesh = solved(folder / f"{number}.step", known)
    except (BadInput, MeshFailed) as error:
        print(f"{head} no result: {error}", flush=True)
        return np.inf, known["unsure"], 0.0
    true = float(np.abs(scaled(K - truth, truth)).max())
    print(
        f"{head} {mesh['unknowns']:7d} {mesh['meshes']:2d} {100 * true:8.4f} +- "
        f"{100 * known['unsure']:.4f} % {100 * told:8.4f} % {told / true:6.2f} "
        f"{time.process_time() - start:6.1f} s",
        flush=True,
    )
    return true, known["unsure"], told


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path, help="folder of the STEP files")
    parser.add_argument(
        "--parts", default="0:40", help="numbers of the parts, FIRST:END"
    )
    asked = parser.parse_args()
    references = json.loads(REFERENCES.read_text())
    numbers = [n for n in range(*(int(n) for n in asked.parts.split(":")))
               if str(n) in references]  # fmt: skip
    if not numbers:
        raise SystemExit(f"{REFERENCES.name} contains none of the requested parts")
    rows = [judge(n, references[str(n)], asked.folder) for n in numbers]
    true, unsure, told = np.array(rows).T
    ratio = told / true
    print(
        f"covered {(told >= true - unsure).sum()} of {len(rows)}, strictly "
        f"{(told >= true).sum()}; estimated / true: least {ratio.min():.2f}, median "
        f"{np.median(ratio):.2f}, largest {ratio.max():.2f}; largest true error "
        f"{100 * true.max():.2f} %"
    )
