"""Compute K_E of the links of ``meshes/`` by NGSolve from their exact geometry.

``python benchmarks/evidence/stiffness_references.py [link ...]`` requires NGSolve
(``pip install ngsolve``).

The links are modelled as solids with the dimensions in ``meshes/make.py``.  Netgen
creates curved meshes with thin layers of elements along the edges of the interfaces.
The polynomial order is increased.  For each K, the program prints the difference from
``stiffness_references.json``, which ``stiffness_round_references.py`` and
``stiffness_part_references.py`` compute with higher accuracy.  The program does not use
the finite elements of forcefit.
"""

import argparse
import json
import time
from pathlib import Path

import ngsolve as ng
import numpy as np
from netgen.occ import Axis, Box, Cone, Cylinder, OCCGeometry, Pnt, X, Y, Z, gp_Ax2

HERE = Path(__file__).parent
E, NU = 60e9, 0.3
LAM, MU = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
L = 0.452  # [m] length of the distal link


def bar(radius, z0, z1):
    """Return a round bar along z."""
    return Cylinder(Pnt(0, 0, z0), Z, radius, z1 - z0)


def ends(solid, base, tip):
    """Return a solid whose base and tip interfaces have names."""
    solid.faces.name = "side"
    for name, (axis, place) in {"base": base, "tip": tip}.items():
        face = solid.faces.Max(axis) if place > 0 else solid.faces.Min(axis)
        face.name = name
    return solid


def fork():
    """Return a fork with two bores, whose faces are named ``bore``."""
    solid = bar(0.040, 0.042, 0.060) - bar(0.015, 0.03, 0.07)
    for y0, y1 in ((0.016, 0.030), (-0.030, -0.016)):
        lug = Box(Pnt(-0.025, y0, 0), Pnt(0.025, y1, 0.045))
        lug += Cylinder(Pnt(0, y0, 0), Y, 0.025, y1 - y0)
        solid += lug - bar(0.015, 0.03, 0.07)
    return solid - Cylinder(Pnt(0, -0.05, 0), Y, 0.011, 0.1)


def distal_forks():
    """Return a tube with a fork at each end."""
    tube = bar(0.040, 0.060, L - 0.060) - bar(0.034, 0.0, L)
    upper = fork().Rotate(Axis((0, 0, 0), X), 180).Move((0, 0, L))
    solid = fork() + tube + upper
    solid.faces.name = "side"
    for face in solid.faces:
        box = face.bounding_box
        low, high = (np.array([p[0], p[1], p[2]]) for p in box)
        for name, z in (("base", 0.0), ("tip", L)):
            middle = (low + high) / 2
            wide = np.abs(high - low - [0.022, 0.014, 0.022]).max() < 1e-4
            half = np.abs(middle[2] - z) < 0.012 and (high - low)[0] < 0.0221
            if wide or (half and np.abs((high - low)[1] - 0.014) < 1e-4):
                if np.abs(middle[2] - z) < 0.012:
                    face.name = name
    return solid


def head_and_rod():
    """Return a tube with solid heads."""
    rod = bar(0.007, 0.030, 0.370) - bar(0.005, 0.030, 0.370)
    return bar(0.012, 0.0, 0.030) + rod + bar(0.012, 0.370, 0.4)


def l_bracket():
    """Return an L-bracket."""
    leg = Box(Pnt(-0.02, -0.02, 0), Pnt(0.02, 0.02, 0.22))
    return leg + Box(Pnt(-0.02, -0.02, 0.18), Pnt(0.15, 0.02, 0.22))


def tapered_arm():
    """Return a conical arm."""
    return Cone(gp_Ax2(Pnt(0, 0, 0), Z), 0.045, 0.025, 0.35, 2 * np.pi)


BOTH = ((Z, -1), (Z, 1))
# solid, tip centre [m], element size [m]
LINKS = {
    "distal_plain": (lambda: ends(bar(0.040, 0, L), *BOTH), (0, 0, L), 0.04),
    "tube": (
        lambda: ends(bar(0.030, 0, 0.4) - bar(0.026, 0, 0.4), *BOTH), (0, 0, 0.4), 0.02
    ),
    "tapered_arm": (lambda: ends(tapered_arm(), *BOTH), (0, 0, 0.35), 0.035),
    "l_bracket": (lambda: ends(l_bracket(), (Z, -1), (X, 1)), (0.15, 0, 0.2), 0.03),
    "delta_forearm": (lambda: ends(head_and_rod(), *BOTH), (0, 0, 0.4), 0.012),
    "distal_forks": (distal_forks, (0, 0, L), 0.02),
}  # fmt: skip


# midpoints [m] of singular edges that do not belong to an interface, or None for all
INNER_EDGES = {"l_bracket": [(0.02, 0.0, 0.18)], "distal_forks": None}


def netgen_mesh(name, layers=2, finer=1.0):
    """Return a mesh of a link before its elements are curved, and the solid."""
    make, _, size = LINKS[name]
    solid = make()
    for face in solid.faces:
        if face.name in {"base", "tip"} and layers:
            for edge in face.edges:
                edge.hpref = 1
    inner = INNER_EDGES.get(name, [])
    for edge in solid.edges if layers else []:
        middle = np.mean([[p[0], p[1], p[2]] for p in edge.bounding_box], axis=0)
        if inner is None or any(np.abs(middle - p).max() < 1e-6 for p in inner):
            edge.hpref = 1
    mesh = ng.Mesh(OCCGeometry(solid).GenerateMesh(maxh=size / finer))
    if layers:
        mesh.RefineHP(layers, factor=0.2)
    return mesh, solid


def stiffness(mesh, order, tip):
    """Return K_E and the number of unknowns."""
    condense = order > 2
    space = ng.VectorH1(mesh, order=order, dirichlet="base|tip")
    u, v = space.TnT()
    e, f = ng.Sym(ng.Grad(u)), ng.Sym(ng.Grad(v))
    form = 2 * MU * ng.InnerProduct(e, f) + LAM * ng.Trace(e) * ng.Trace(f)
    a = ng.BilinearForm(space, symmetric=True, condense=condense)
    a += form * ng.dx
    a.Assemble()
    inverse = a.mat.Inverse(space.FreeDofs(condense), inverse="sparsecholesky")
    x, y, z = (c - p for c, p in zip((ng.x, ng.y, ng.z), tip, strict=True))
    motions = [(0, -z, y), (z, 0, -x), (-y, x, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    fields = []
    for motion in motions:
        field = ng.GridFunction(space)
        field.Set(ng.CoefficientFunction(motion), definedon=mesh.Boundaries("tip"))
        r = field.vec.CreateVector()
        r.data = -a.mat * field.vec
        if condense:
            r.data += a.harmonic_extension_trans * r
        field.vec.data += inverse * r
        if condense:
            field.vec.data += a.harmonic_extension * field.vec
        fields.append(field)
    # the error of the energy is quadratic in the error of the solution
    full = ng.BilinearForm(space, symmetric=True)
    full += form * ng.dx
    K = np.empty((6, 6))
    for i, field in enumerate(fields):
        image = field.vec.CreateVector()
        full.Apply(field.vec, image)
        K[i] = [ng.InnerProduct(image, other.vec) for other in fields]
    return (K + K.T) / 2, space.ndof


def scaled(difference, K):
    """Return a matrix whose entries are divided by sqrt(K_ii K_jj)."""
    size = np.sqrt(np.diag(K))
    return difference / np.outer(size, size)


def report(name, orders, finer):
    """Print K for each order, and its difference from the stored reference."""
    stored = json.loads((HERE / "stiffness_references.json").read_text())[name]
    mesh, solid = netgen_mesh(name, finer=finer)
    print(f"{name}: {mesh.ne} elements, {solid.mass:.9g} m^3", flush=True)
    for order in orders:
        start = time.process_time()
        mesh.Curve(order)
        K, unknowns = stiffness(mesh, order, LINKS[name][1])
        gap = np.abs(scaled(K - np.array(stored["stiffness"]), K)).max()
        print(
            f"  order {order}: {unknowns:8d} unknowns, difference {gap:.1e}, "
            f"K_RX {K[0, 0]:.9g}, {time.process_time() - start:.1f} s", flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("links", nargs="*", default=list(LINKS))
    parser.add_argument("--orders", default="3,4,5")
    parser.add_argument("--finer", type=float, default=1.0, help="factor of refinement")
    asked = parser.parse_args()
    for name in asked.links:
        report(name, [int(p) for p in asked.orders.split(",")], asked.finer)
