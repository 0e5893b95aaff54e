"""Print the true and the estimated error of K_E for each mesh.

``python benchmarks/evidence/stiffness_accuracy.py [link ...] [--kind rigid]``

Each link of ``meshes/`` is refined up to 430 000 unknowns or seven meshes, which takes
about two minutes.  The program prints the errors of the K of each mesh, and the ratio
of true to estimated error [%] for each significant entry of the last K.

For rigid interfaces, the true K is the result of NGSolve in
``stiffness_references.json``, if this result is sufficiently accurate. For other
interfaces, it is extrapolated from the finest mesh.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from forcefit.stiffness.fem.adaptive_step import (
    estimated_error,
    refine_level,
    solve_level,
)
from forcefit.stiffness.fem.condensation import KINDS
from forcefit.stiffness.fem.fea import Budget, first_mesh, interface_center
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.link import scaled
from forcefit.stiffness.report.compare import entries_that_matter
from forcefit.stiffness.screws import SCREW
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import read_surface

REFERENCES = Path(__file__).with_name("stiffness_references.json")
MESHES = Path(__file__).parents[2] / "meshes"
BORE = "bore=0,0,{}/0,1,0/0.011"
LINKS = {
    "distal_plain": ("z=0", "z=0.452"),
    "tube": ("z=0", "z=0.4"),
    "tapered_arm": ("z=0", "z=0.35"),
    "l_bracket": ("z=0", "x=0.15"),
    "delta_forearm": ("z=0", "z=0.4"),
    "distal_forks": (BORE.format(0), BORE.format(0.452)),
}


def levels(name, kind, most):
    """Return stiffness, two estimated errors, unknowns and time [s] of each mesh."""
    surface = read_surface(MESHES / f"{name}.stl")
    faces = [parse_interface(text) for text in LINKS[name]]
    centers = np.array([interface_center(surface, f, "face") for f in faces])
    solid = first_mesh(surface, *faces, Budget())
    meshes = []
    while True:
        start = time.perf_counter()
        level = solve_level(solid, [Material(60e9, 0.3)], centers, kind)
        unknowns, seconds = level.solution.unknowns, time.perf_counter() - start
        meshes.append((*level.totals(), unknowns, seconds))
        solid = refine_level(level, 1.15)
        if len(meshes) == 6 or unknowns * len(solid.cells) > most * len(
            level.solid.cells
        ):
            return meshes


def report(name, kind, most):
    """Print a row of the table for each mesh."""
    meshes = levels(name, kind, most)
    history = [totals for *totals, _, _ in meshes]
    if kind == "rigid":
        stored = json.loads(REFERENCES.read_text())[name]
        truth, unsure = np.array(stored["stiffness"]), stored["last_step"]
    else:
        error, _ = estimated_error(history)
        truth, unsure = history[-1][0] - 0.65 * error, 0.0
        meshes = meshes[:-1]
    for count, (K, _, geometry, unknowns, seconds) in enumerate(meshes, start=1):
        gap = np.abs(scaled(K - truth, truth))
        error = estimated_error(history[:count])[0] + np.abs(geometry)
        told = np.abs(scaled(error, K))
        if gap.max() < 3 * unsure:
            continue
        true, estimate = gap.max(), told.max()
        print(
            f"{name:14} {kind:17} {unknowns:8d} {100 * true:9.4f} % "
            f"{100 * estimate:9.4f} % {estimate / true:6.2f} {seconds:7.1f} s",
            flush=True,
        )
    entries = entries_that_matter(truth)
    print("  last:", *(
        f"{' '.join(SCREW[i] for i in dict.fromkeys(e))} "
        f"{100 * gap[e]:.4f}/{100 * told[e]:.4f}" for e in entries
    ), sep="  ")  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("links", nargs="*", default=list(LINKS))
    parser.add_argument("--kind", choices=KINDS, default="rigid")
    parser.add_argument(
        "--most", type=float, default=430e3, help="largest number of unknowns"
    )
    asked = parser.parse_args()
    print(
        "link           interfaces        unknowns  true error   estimate"
        "    ratio    time"
    )
    for link in asked.links:
        report(link, asked.kind, asked.most)
