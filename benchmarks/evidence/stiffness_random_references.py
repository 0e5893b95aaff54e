"""Compute K_E of the parts of ``stiffness_random_parts.py`` by NGSolve.

Bodies of revolution are solved by Fourier modes in their half section, with polynomial
order 8.  Parts that consist of bricks have a mesh of bricks whose size decreases
towards each edge.  Because of symmetry, a half or a quarter of them is sufficient.  A
quarter of the eye has a mesh of curved tetrahedra, with layers of prisms along the
edges of its interfaces.  The program does not use the finite elements, meshes and error
estimates of forcefit.
"""

import netgen.meshing as netgen
import ngsolve as ng
import numpy as np
from netgen.occ import Box, Cylinder, OCCGeometry, Pnt, Y
from stiffness_part_references import corners_of, unit_screws
from stiffness_references import scaled
from stiffness_round_references import AXIS, BASE, FREE, TIP, half_section
from stiffness_round_references import stiffness as round_stiffness

SHRINK = 0.15
MOST = 50e3  # maximum number of unknowns
# whether the motions RX .. TZ are symmetric about the planes x = 0 and y = 0
EVEN = {"x": (1, 0, 0, 0, 1, 1), "y": (0, 1, 0, 1, 0, 1)}


def independent_stiffness(part, young):
    """Return K_E of a part at the centre of its tip, with a fixed base.

    Args:
        part: part of ``stiffness_random_parts``.
        young: [Pa] Young's modulus.

    Returns:
        ``stiffness`` (6, 6), extrapolated from the last two orders, and its relative
        uncertainty ``unsure``.
    """
    nu = part.nu
    lame = young * nu / ((1 + nu) * (1 - 2 * nu)), young / (2 * (1 + nu))
    if part.profile:
        coarse, fine, more = round_part(part, lame)
    elif part.eye:
        coarse, fine, more = eye(part, lame)
    else:
        coarse, fine, more = bricks(part, lame)
    step = more * (fine - coarse)
    K = fine + step
    return {"stiffness": K.tolist(), "unsure": np.abs(scaled(step, K)).max()}


def round_part(part, lame):
    """Return K_E of a body of revolution from the Fourier modes 0 and 1."""
    corners = list(part.profile)
    L = max(z for _, z in corners)
    kinds = []
    for (r, z), (s, y) in zip(corners, corners[1:] + corners[:1], strict=True):
        if r == s == 0:
            kinds.append(AXIS)
        else:
            kinds.append(BASE if z == y == 0 else TIP if z == y == L else FREE)
    radii = sorted({r for r, _ in corners})
    wall = min(b - a for a, b in zip(radii, radii[1:], strict=False))
    mesh = half_section(corners, kinds, max(wall, L / 40), layers=6)
    return *(round_stiffness(mesh, order, lame) for order in (6, 8)), 0.3


def bricks(part, lame):
    """Return K_E of a part of bricks from a half or a quarter of it."""
    x, y, z = part.planes
    mirrors = "xy" if np.allclose(x, -np.array(x[::-1])) else "y"
    thin = min(np.diff(p).min() for p in part.planes)
    # slender arms are divided into elements of limited length
    arm = x[1] - x[0]
    wide = max(arm if part.kind == "fork" else x[-1] - x[0], y[-1] - y[0])
    wide = 2 * arm if part.kind == "bracket" else wide
    # an additional layer of elements is used at the re-entrant edge of a bracket
    least = 2 if part.kind == "bracket" else 1
    lines, kept = [], part.full
    for axis, places in zip("xyz", part.planes, strict=True):
        cut = axis in mirrors
        if cut:
            half = len(places) // 2
            kept = np.take(
                kept, np.arange(half - 1, len(places) - 1), "xyz".index(axis)
            )
            places = [0.0, *places[half:]]
        lines.append(graded(places, thin, wide, cut, least))
    owner = [np.repeat(np.arange(len(parts)), parts) for _, parts in lines]
    full = kept[np.ix_(*owner)]
    places = [p for p, _ in lines]
    across = part.kind == "bracket"  # the tip of a bracket is at the largest x
    mesh = brick_mesh(places, full, 0 if across else 2, mirrors)
    tip = (x[-1], 0, (z[-2] + z[-1]) / 2) if across else center_of_tip(part)
    cells = int(full.sum())
    order = next((p for p in (5, 4) if 3 * cells * p**3 < MOST), 4)
    matrices = [by_symmetry(mesh, p, mirrors, tip, lame) for p in (order - 1, order)]
    return *matrices, 0.3


def graded(places, thin, wide, cut, least):
    """Return positions whose spacing decreases towards each plane, and their counts."""
    found, counts = [places[0]], []
    for k, (a, b) in enumerate(zip(places, places[1:], strict=False)):
        whole = cut and k == 0  # the fields are smooth at a symmetry plane
        size = (b - a) / (1 if whole else 2)
        # edge effects decay as exp(-pi s / thin) and require several elements
        layers = max(least, round(np.log(size / (SHRINK * thin)) / np.log(4)))
        ends = [size * (0.25 if layers > 2 else SHRINK) ** n
                for n in range(layers, 0, -1)]  # fmt: skip
        low, high = a + (0 if whole else ends[-1]), b - ends[-1]
        parts = max(1, int(np.ceil((high - low) / (1.3 * max(wide, thin)))))
        inside = np.linspace(low, high, parts + 1)
        row = [*([] if whole else [a + e for e in ends[:-1]]),
               *(inside[1:] if whole else inside),
               *(b - e for e in ends[-2::-1]), b]  # fmt: skip
        found += [float(v) for v in row]
        counts.append(len(row))
    return found, counts


def center_of_tip(part):
    """Return the centroid of the end face at the largest z."""
    x, y, z = (np.array(p) for p in part.planes)
    area = np.outer(np.diff(x), np.diff(y)) * part.full[:, :, -1]
    middle = (x[1:] + x[:-1]) / 2
    return float((area.sum(axis=1) @ middle) / area.sum()), 0.0, float(z[-1])


def brick_mesh(places, full, axis, mirrors):
    """Return a mesh of bricks with named faces at the base and the tip."""
    mesh = netgen.Mesh()
    mesh.dim = 3
    names = ["base", "tip", "x0", "y0", "side"]
    for n, name in enumerate(names, start=1):
        mesh.Add(netgen.FaceDescriptor(bc=n, domin=1, surfnr=n))
        mesh.SetBCName(n - 1, name)
    mesh.SetMaterial(1, "solid")
    ids = {}

    def node(*index):
        if index not in ids:
            point = netgen.Pnt(*(p[i] for p, i in zip(places, index, strict=True)))
            ids[index] = mesh.Add(netgen.MeshPoint(point))
        return ids[index]

    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    faces = [([0, 3, 2, 1], (0, 0, -1)), ([4, 5, 6, 7], (0, 0, 1)),
             ([0, 1, 5, 4], (0, -1, 0)), ([2, 3, 7, 6], (0, 1, 0)),
             ([1, 2, 6, 5], (1, 0, 0)), ([3, 0, 4, 7], (-1, 0, 0))]  # fmt: skip
    around, last = np.pad(full, 1), full.shape[axis] - 1
    for i, j, k in np.argwhere(full):
        corners = [node(i + a, j + b, k + c) for c in (0, 1) for a, b in square]
        mesh.Add(netgen.Element3D(1, corners))
        for members, step in faces:
            if around[i + 1 + step[0], j + 1 + step[1], k + 1 + step[2]]:
                continue
            name = "side"
            if step[2] < 0 and k == 0:
                name = "base"
            elif step[axis] > 0 and (i, j, k)[axis] == last:
                name = "tip"
            elif step[0] < 0 and i == 0 and "x" in mirrors:
                name = "x0"
            elif step[1] < 0 and j == 0:
                name = "y0"
            number = names.index(name) + 1
            mesh.Add(netgen.Element2D(number, [corners[m] for m in members]))
    return ng.Mesh(mesh)


def by_symmetry(mesh, order, mirrors, tip, lame):
    """Return K, computed separately for even and odd motions about symmetry planes."""
    (lam, mu), space = lame, ng.VectorH1(mesh, order=order)
    u, v = space.TnT()
    e, f = ng.Sym(ng.Grad(u)), ng.Sym(ng.Grad(v))
    a = ng.BilinearForm(space, symmetric=True, condense=True)
    a += (2 * mu * ng.InnerProduct(e, f) + lam * ng.Trace(e) * ng.Trace(f)) * ng.dx
    a.Assemble()
    motions, K = unit_screws(tip), np.zeros((6, 6))
    kinds = [tuple(EVEN[m][i] for m in mirrors) for i in range(6)]
    for kind in sorted(set(kinds)):
        group = [i for i in range(6) if kinds[i] == kind]
        free = free_unknowns(mesh, order, mirrors, kind)
        inverse = a.mat.Inverse(free, inverse="sparsecholesky")
        fields, forces = [], []
        for i in group:
            field = ng.GridFunction(space)
            field.Set(ng.CF(motions[i]), definedon=mesh.Boundaries("tip"))
            force = (a.mat * field.vec).Evaluate()
            field.vec.data -= inverse * force
            fields.append(field.vec)
            forces.append((a.mat * field.vec).Evaluate())
        work = [[ng.InnerProduct(force, field) for field in fields] for force in forces]
        K[np.ix_(group, group)] = 2 ** len(mirrors) * np.array(work)
    return K


def free_unknowns(mesh, order, mirrors, kind):
    """Return the unknowns that are not fixed at an interface or a symmetry plane."""
    held = {c: ["base", "tip"] for c in "xyz"}
    for cut, even in zip(mirrors, kind, strict=True):
        for c in "xyz":
            # On a symmetry plane, even fields have no normal displacement, and odd
            # fields have no tangential displacement.
            if (c == cut) == bool(even):
                held[c].append(f"{cut}0")
    names = {f"dirichlet{c}": "|".join(held[c]) for c in "xyz"}
    return ng.VectorH1(mesh, order=order, **names).FreeDofs(True)


def eye(part, lame):
    """Return K_E of an eye from a quarter of it."""
    W, T, L, r = part.eye
    solid = Box(Pnt(0, 0, 0), Pnt(W / 2, T / 2, L)) + Cylinder(
        Pnt(0, 0, L), Y, W / 2, T / 2
    ) * Box(Pnt(0, 0, L - W), Pnt(W, T, L + W))
    solid = solid - Cylinder(Pnt(0, -T, L), Y, r, 3 * T)
    solid.faces.name = "side"
    size = min(T, W / 2 - r, r)
    for face in solid.faces:
        low, high = corners_of(face)
        if high[2] < 1e-5:
            face.name = "base"
        elif high[0] < 1e-5:
            face.name = "x0"
        elif high[1] < 1e-5:
            face.name = "y0"
        elif high[0] < 1.001 * r and low[2] > L - 1.001 * r:
            face.name = "tip"
    for edge in solid.edges:
        low, high = corners_of(edge)
        rim = high[0] < 1.001 * r and low[2] > L - 1.001 * r and low[1] > 0.999 * T / 2
        foot = high[2] < 1e-5 and (low[0] > 0.499 * W or low[1] > 0.499 * T)
        if rim or foot:
            edge.hpref, edge.maxh = 1, min(0.7 * size, W / 6)
    shape = OCCGeometry(solid).GenerateMesh(maxh=min(0.8 * T, W / 4), grading=0.5)
    mesh = ng.Mesh(shape)
    mesh.RefineHP(2, factor=0.2)
    matrices = []
    for order in (3, 4):
        mesh.Curve(order)
        matrices.append(by_symmetry(mesh, order, "xy", (0, 0, L), lame))
    return *matrices, 0.3
