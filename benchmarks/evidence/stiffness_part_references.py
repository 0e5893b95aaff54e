"""Compute K_E of the L-bracket and of the link with forks by NGSolve.

``python benchmarks/evidence/stiffness_part_references.py [link ...]`` requires NGSolve
(``pip install ngsolve``).

Because of symmetry, a half of the bracket and an eighth of the link with forks are
sufficient.  The bracket has bricks whose size decreases towards clamped and re-entrant
edges.  The link with forks has curved tetrahedra, with layers of prisms along these
edges.  The polynomial order is increased.  K of the highest order and its difference
from the previous order are written to ``stiffness_references.json``.  The program does
not use the finite elements of forcefit.
"""

import argparse
import json
import time

import netgen.meshing as netgen
import ngsolve as ng
import numpy as np
from netgen.occ import Box, OCCGeometry, Pnt
from stiffness_references import HERE, LAM, MU, L, bar, fork, scaled

PLANES = {"x": "x0", "y": "y0", "z": "z0"}  # names of the faces at symmetry planes
SHRINK, EPS = 0.15, 1e-9


def mode_stiffness(mesh, order, even, motions, held="", lame=(LAM, MU)):
    """Return the stiffness for tip motions that are even or odd about each plane.

    Args:
        mesh: mesh of the part, with faces named tip, x0, y0 and z0.
        order: polynomial order.
        even: (x, y, z) whether the motions are symmetric about the plane.
        motions: motions of the tip.
        held: name of a face that is fixed.
        lame: Lame constants [Pa].

    Returns:
        Work of the forces due to each motion on each other motion, and number of
        unknowns.
    """
    (lam, mu), fixed = lame, {c: ["tip", held] if held else ["tip"] for c in "xyz"}
    for cut, same in zip("xyz", even, strict=True):
        for c in "xyz":
            # On a symmetry plane, even fields have no normal displacement, and odd
            # fields have no tangential displacement.
            if (c == cut) == same:
                fixed[c].append(PLANES[cut])
    x, y, z = ("|".join(fixed[c]) for c in "xyz")
    space = ng.VectorH1(mesh, order=order, dirichletx=x, dirichlety=y, dirichletz=z)
    u, v = space.TnT()
    e, f = ng.Sym(ng.Grad(u)), ng.Sym(ng.Grad(v))
    form = 2 * mu * ng.InnerProduct(e, f) + lam * ng.Trace(e) * ng.Trace(f)
    a = ng.BilinearForm(space, symmetric=True, condense=True)
    a += form * ng.dx
    a.Assemble()
    inverse = a.mat.Inverse(space.FreeDofs(True), inverse="sparsecholesky")
    fields = []
    for motion in motions:
        field = ng.GridFunction(space)
        field.Set(ng.CF(motion), definedon=mesh.Boundaries("tip"))
        r = field.vec.CreateVector()
        r.data = -a.mat * field.vec
        r.data += a.harmonic_extension_trans * r
        field.vec.data += inverse * r
        field.vec.data += a.harmonic_extension * field.vec
        fields.append(field)
    full = ng.BilinearForm(space, symmetric=True)
    full += form * ng.dx
    image = fields[0].vec.CreateVector()
    work = np.empty((len(fields), len(fields)))
    for i, field in enumerate(fields):
        full.Apply(field.vec, image)
        work[i] = [ng.InnerProduct(image, other.vec) for other in fields]
    return (work + work.T) / 2, space.ndof


def unit_screws(center):
    """Return the six rigid motions about a point."""
    x, y, z = (c - p for c, p in zip((ng.x, ng.y, ng.z), center, strict=True))
    return [(0, -z, y), (z, 0, -x), (-y, x, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]


# --- L-bracket: y > 0 ----------------------------------------------------------------


def toward(a, b, layers):
    """Return positions from a to b whose spacing decreases towards a."""
    return [a] + [a + (b - a) * SHRINK**k for k in range(layers, -1, -1)]


def half_bracket(layers):
    """Return a mesh of bricks of half the L-bracket in ``meshes/make.py``."""
    across = [*toward(-0.02, 0, layers), *toward(0.02, 0, layers)[-2::-1]]
    arm = toward(0.02, 0.05, layers)[1:] + [0.085, *toward(0.15, 0.12, layers)[::-1]]
    leg = toward(0, 0.03, layers) + [0.075, 0.12, *toward(0.18, 0.15, layers)[::-1]]
    x, y = across + arm, toward(0.02, 0, layers)[::-1]
    z = leg[:-1] + [0.2 + v for v in across]
    return brick_mesh(x, y, z, lambda i, k: x[i] > 0.02 - EPS and z[k] < 0.18 - EPS)


def brick_mesh(x, y, z, empty):
    """Return a mesh of bricks between given positions, without empty bricks."""
    mesh = netgen.Mesh()
    mesh.dim = 3
    for n, name in enumerate(("base", "tip", "y0", "side"), start=1):
        mesh.Add(netgen.FaceDescriptor(bc=n, domin=1, surfnr=n))
        mesh.SetBCName(n - 1, name)
    mesh.SetMaterial(1, "solid")
    ids = {}

    def node(i, j, k):
        if (i, j, k) not in ids:
            ids[i, j, k] = mesh.Add(netgen.MeshPoint(netgen.Pnt(x[i], y[j], z[k])))
        return ids[i, j, k]

    cells = {
        (i, j, k)
        for i, j, k in np.ndindex(len(x) - 1, len(y) - 1, len(z) - 1)
        if not empty(i, k)
    }
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    faces = [([0, 3, 2, 1], (0, 0, -1)), ([4, 5, 6, 7], (0, 0, 1)),
             ([0, 1, 5, 4], (0, -1, 0)), ([2, 3, 7, 6], (0, 1, 0)),
             ([1, 2, 6, 5], (1, 0, 0)), ([3, 0, 4, 7], (-1, 0, 0))]  # fmt: skip
    for i, j, k in sorted(cells):
        corners = [node(i + a, j + b, k + c) for c in (0, 1) for a, b in square]
        mesh.Add(netgen.Element3D(1, corners))
        for members, (a, b, c) in faces:
            if (i + a, j + b, k + c) in cells:
                continue
            number = 4
            if c < 0 and k == 0:
                number = 1
            elif a > 0 and i == len(x) - 2:
                number = 2
            elif b < 0:
                number = 3
            mesh.Add(netgen.Element2D(number, [corners[m] for m in members]))
    return ng.Mesh(mesh)


def bracket(order, layers):
    """Return K_E of the L-bracket, and the largest number of unknowns."""
    mesh, motions = half_bracket(layers), unit_screws((0.15, 0, 0.2))
    K = np.zeros((6, 6))
    for even, group in ((True, [1, 3, 5]), (False, [0, 2, 4])):
        # there are no symmetry planes normal to x and z
        work, unknowns = mode_stiffness(
            mesh, order, (True, even, True), [motions[i] for i in group], "base"
        )
        K[np.ix_(group, group)] = 2 * work
    return K, unknowns


# --- link with forks: x > 0, y > 0, the base's half ----------------------------------


def eighth_of_forks(layers, finer):
    """Return a mesh of an eighth of the link with forks."""
    tube = bar(0.040, 0.060, L / 2) - bar(0.034, 0, L)
    solid = (fork() + tube) * Box(Pnt(0, 0, -0.1), Pnt(0.1, 0.1, L / 2))
    solid.faces.name = "side"
    for face in solid.faces:
        low, high = corners_of(face)
        if high[0] < 1e-5:
            face.name = "x0"
        elif high[1] < 1e-5:
            face.name = "y0"
        elif low[2] > L / 2 - 1e-5:
            face.name = "z0"
        elif high[0] < 0.0111 and low[2] > -0.0112 and high[2] < 0.0112:
            face.name, face.maxh = "tip", 0.006 / finer
    for edge in solid.edges:
        low, high = corners_of(edge)
        flat = np.ptp([low, high], axis=0) < 1e-5
        cut = high[0] < 1e-5 or high[1] < 1e-5
        rim = high[0] < 0.0111 and -0.0112 < low[2] and high[2] < 0.0112 and flat[1]
        lug = abs(low[2] - 0.042) < 1e-5 and high[0] < 0.0251 and low[1] > 0.0159
        ring = abs(low[2] - 0.060) < 1e-5 and 0.033 < high[0] < 0.0341
        if not cut and (rim or (flat[2] and (lug or ring))):
            edge.hpref, edge.maxh = 1, (0.006 if rim else 0.01) / finer
    shape = OCCGeometry(solid).GenerateMesh(maxh=0.02 / finer, grading=0.4)
    mesh = ng.Mesh(shape)
    mesh.RefineHP(layers, factor=0.2)
    return mesh


def corners_of(shape):
    """Return two opposite corners of the bounding box of a shape."""
    low, high = shape.bounding_box
    return [np.array([p[0], p[1], p[2]]) for p in (low, high)]


def forks(order, layers, finer=1.5):
    """Return K_E of the link with forks, and the largest number of unknowns.

    The base and the tip move by half a unit screw in opposite directions.  K is
    diagonal at the middle of the link because of symmetry.
    """
    mesh = eighth_of_forks(layers, finer)
    mesh.Curve(order)
    motions = unit_screws((0, 0, L / 2))
    same, turned = True, False
    evens = [
        (same, turned, same),
        (turned, same, same),
        (turned, turned, turned),
        (turned, same, turned),
        (same, turned, turned),
        (same, same, same),
    ]
    middle = np.zeros(6)
    for i, even in enumerate(evens):
        work, unknowns = mode_stiffness(mesh, order, even, [motions[i]])
        middle[i] = 8 / 4 * work[0, 0]
    # transforms screws of the tip to the middle of the link
    A = np.eye(6)
    A[3, 1], A[4, 0] = -L / 2, L / 2
    return A.T @ np.diag(middle) @ A, unknowns


LINKS = {"l_bracket": bracket, "distal_forks": forks}


def reference(name, orders, layers):
    """Return K of the highest order, and its difference from the previous order."""
    last = None
    for order in orders:
        start = time.process_time()
        K, unknowns = LINKS[name](order, layers)
        step = np.nan if last is None else np.abs(scaled(last - K, K)).max()
        print(f"{name} order {order}: {unknowns} unknowns, step {step:.1e}, K "
              f"{' '.join(f'{v:.7g}' for v in np.diag(K))}, "
              f"{time.process_time() - start:.0f} s", flush=True)  # fmt: skip
        last = K
    return K, step


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("links", nargs="*", default=list(LINKS))
    parser.add_argument("--orders", default="3,4,5")
    parser.add_argument("--layers", type=int, default=2)
    parser.add_argument("--dry", action="store_true", help="only print the results")
    asked = parser.parse_args()
    path = HERE / "stiffness_references.json"
    for name in asked.links:
        orders = [int(p) for p in asked.orders.split(",")]
        K, step = reference(name, orders, asked.layers)
        if not asked.dry:
            stored = json.loads(path.read_text())
            stored[name] = {"stiffness": K.tolist(), "last_step": step}
            path.write_text(json.dumps(stored, indent=1) + "\n")
