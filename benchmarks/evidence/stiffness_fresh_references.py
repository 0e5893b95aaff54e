"""Compute K_E of the parts of ``stiffness_fresh_parts.py`` by NGSolve.

``python benchmarks/evidence/stiffness_fresh_references.py FOLDER [--parts 0:40]``
requires NGSolve (``pip install ngsolve``).

Each part is written to FOLDER as a STEP file in millimetres. K is computed on a half or
a quarter of the part because of its symmetry. The mesh consists of curved tetrahedra,
with layers of prisms along the edges of interfaces and material layers. The result is
extrapolated from two polynomial orders. Its uncertainty is the change due to the
extrapolation, or the difference from a coarser mesh if that is larger.

Walls with sharp edges and round tubes use the references of
``stiffness_random_references.py``.  Results that the JSON file already contains are not
computed again.
"""

import argparse
import json
import time
from pathlib import Path
from types import SimpleNamespace

import ngsolve as ng
import numpy as np
from netgen.occ import Glue, OCCGeometry
from stiffness_fresh_shapes import EPS, block, draw_part
from stiffness_part_references import corners_of
from stiffness_random_references import by_symmetry, independent_stiffness
from stiffness_references import scaled

REFERENCES = Path(__file__).with_name("stiffness_fresh_parts.json")
FAR = 1e3  # [mm] length that exceeds all dimensions
MORE = 0.3  # [-] fraction of the difference between two orders that is added to K


def cut_shape(part):
    """Return a half or a quarter of a part with layers and named faces."""
    low = [0 if axis in part.mirrors else -FAR for axis in "xyz"]
    shape = part.solid * block(low, (FAR, FAR, FAR))
    pieces = []
    for axis, a, b, _, _ in part.layers[1:]:
        ends = np.full((2, 3), [[-FAR], [FAR]])
        ends[:, axis] = a, b
        pieces.append(shape * block(*ends))
        shape = shape - block(*ends)
    shape = Glue([shape, *pieces])
    for solid, name in zip(shape.solids, solid_names(shape, part), strict=True):
        solid.name = name
    return shape


def solid_names(shape, part):
    """Return the layer to which each solid belongs."""
    found = []
    for solid in shape.solids:
        center, name = np.array([*solid.center]), "m0"
        for number, (axis, a, b, _, _) in enumerate(part.layers):
            if axis is not None and a < center[axis] < b:
                name = f"m{number}"
        found.append(name)
    return found


def mesh_of(part, factor, rows):
    """Return a mesh of curved tetrahedra with prisms along the singular edges."""
    shape = cut_shape(part)
    shape.faces.name = "side"
    for face in shape.faces:
        low, high = corners_of(face)
        for axis in part.mirrors:
            if abs(high["xyz".index(axis)]) < EPS:
                face.name = f"{axis}0"
        if high[2] < EPS:
            face.name = "base"
        elif low[2] > part.L - EPS:
            face.name = "tip"
    places = [(2, 0), (2, part.L)]
    places += [(axis, v) for axis, a, b, _, _ in part.layers if axis is not None
               for v in (a, b)]  # fmt: skip
    for edge in shape.edges:
        low, high = corners_of(edge)
        cut = any(abs(high["xyz".index(axis)]) < EPS for axis in part.mirrors)
        on = (abs(low[k] - v) < EPS and abs(high[k] - v) < EPS for k, v in places)
        if not cut and any(on):
            edge.hpref, edge.maxh = 1, factor * part.size
    made = OCCGeometry(shape).GenerateMesh(
        maxh=factor * part.maxh, grading=0.5, curvaturesafety=1.0
    )
    mesh = ng.Mesh(made)
    mesh.RefineHP(rows, factor=0.17)
    return mesh


def lame(mesh, part):
    """Return the Lame constants of each material [N/mm^2]."""
    lam = {f"m{n}": E * nu / ((1 + nu) * (1 - 2 * nu))
           for n, (*_, E, nu) in enumerate(part.layers)}  # fmt: skip
    mu = {f"m{n}": E / (2 * (1 + nu)) for n, (*_, E, nu) in enumerate(part.layers)}
    return mesh.MaterialCF(lam), mesh.MaterialCF(mu)


def stiffness(part, mesh, order):
    """Return K at the centre of the tip, (6, 6) [N m/rad .. N/m]."""
    mesh.Curve(order)
    tips = [f for f in part.solid.faces if corners_of(f)[0][2] > part.L - EPS]
    center = np.average(
        [[*f.center] for f in tips], axis=0, weights=[f.mass for f in tips]
    )
    K = by_symmetry(mesh, order, part.mirrors, tuple(center), lame(mesh, part))
    units = np.repeat([10**-1.5, 10**1.5], 3)
    return units[:, None] * K * units


def reference(part):
    """Return K and its uncertainty."""
    if part.simple:
        empty = {"kind": part.note.split(",")[0], "profile": (), "eye": ()}
        known = SimpleNamespace(**empty | part.simple, nu=part.layers[0][4])
        found = independent_stiffness(known, 1e6 * part.layers[0][3])
        return np.array(found["stiffness"]), found["unsure"]
    # the stress is singular if an interface ends tangentially at a fillet
    rows = 3 if part.mirrors == "x" else 2
    mesh = mesh_of(part, 1.0, rows)
    low, high = (stiffness(part, mesh, order) for order in part.orders)
    other = stiffness(part, mesh_of(part, 1.4, rows - 1), part.orders[1])
    K = high + MORE * (high - low)
    steps = [np.abs(scaled(d, K)).max() for d in (high - low, high - other)]
    return K, max(MORE * steps[0], steps[1])


def part_texts(part):
    """Return the arguments of the option ``--part`` for all layers except the first."""
    return [f"{'xyz'[axis]}={a / 1e3!r}..{b / 1e3!r}/young={1e6 * E!r},poisson={nu!r}"
            for axis, a, b, E, nu in part.layers[1:]]  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--parts", default="0:40", help="numbers of the parts, FIRST:END"
    )
    parser.add_argument("--dry", action="store_true", help="write STEP files only")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    for number in range(*(int(n) for n in asked.parts.split(":"))):
        start, (kind, part) = time.process_time(), draw_part(number)
        part.solid.WriteStep(str(asked.folder / f"{number}.step"))
        known = json.loads(REFERENCES.read_text()) if REFERENCES.exists() else {}
        if asked.dry or str(number) in known:
            continue
        K, unsure = reference(part)
        known[str(number)] = {
            "kind": kind, "note": part.note, "length": part.L / 1e3,
            "young": 1e6 * part.layers[0][3], "poisson": part.layers[0][4],
            "parts": part_texts(part), "unsure": float(f"{unsure:.2g}"),
            "stiffness": [[float(f"{v:.9g}") for v in row] for row in K],
        }  # fmt: skip
        REFERENCES.write_text(json.dumps(known, indent=0) + "\n")
        print(f"{number} {kind} {part.note}: uncertainty {unsure:.1e}, "
              f"{time.process_time() - start:.0f} s", flush=True)  # fmt: skip
