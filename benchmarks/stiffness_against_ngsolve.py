"""K_E of the paper's distal link by NGSolve, beside ours: answers and times.

``python benchmarks/stiffness_against_ngsolve.py`` (needs ``pip install ngsolve``)

1. The same straight tetrahedra in both codes: the answers must agree to rounding.
2. NGSolve with its own curved meshes, orders 2 to 4, and ours asked for 0.5 and 0.1 %:
   true error against the converged 1 032 277 N m/rad, and time from surface to K.
"""

import resource
import time
from pathlib import Path

import netgen.meshing as nm
import ngsolve as ng
import numpy as np
from netgen.occ import Cylinder, OCCGeometry, Pnt, Z

from stiffness import fea
from stiffness.condense import condense
from stiffness.elements import lame, quadratic
from stiffness.interface import parse_interface
from stiffness.link import scaled
from stiffness.mesh import Solid
from stiffness.surface import read_surface

SURFACE = Path(__file__).parents[1] / "meshes" / "distal_plain.stl"
PLANES = parse_interface("z=0"), parse_interface("z=0.452")
CENTERS = np.array([[0, 0, 0], [0, 0, 0.452]])
REFERENCE = 1032277.0  # [N m/rad] K_RX, converged with curved high-order elements
LAM, MU = lame(60e9, 0.3)


def ngsolve_stiffness(mesh, order):
    """K_E of an ngsolve mesh with boundaries base and tip, and its unknowns."""
    space = ng.VectorH1(mesh, order=order, dirichlet="base|tip")
    u, v = space.TnT()
    e, f = ng.Sym(ng.Grad(u)), ng.Sym(ng.Grad(v))
    form = 2 * MU * ng.InnerProduct(e, f) + LAM * ng.Trace(e) * ng.Trace(f)
    a = ng.BilinearForm(space, symmetric=True, condense=order > 2)
    a += form * ng.dx
    a.Assemble()
    free = space.FreeDofs(order > 2)
    inverse = a.mat.Inverse(free, inverse="sparsecholesky")
    x, y, z = ng.x, ng.y, ng.z - CENTERS[1, 2]
    motions = [(0, -z, y), (z, 0, -x), (-y, x, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    fields = []
    for motion in motions:
        field = ng.GridFunction(space)
        field.Set(ng.CoefficientFunction(motion), definedon=mesh.Boundaries("tip"))
        r = field.vec.CreateVector()
        r.data = -a.mat * field.vec
        if order > 2:
            r.data += a.harmonic_extension_trans * r
        field.vec.data += inverse * r
        if order > 2:
            field.vec.data += a.harmonic_extension * field.vec
        fields.append(field)
    full = ng.BilinearForm(space, symmetric=True)
    full += form * ng.dx
    products = []
    for field in fields:
        image = field.vec.CreateVector()
        full.Apply(field.vec, image)
        products.append([ng.InnerProduct(image, other.vec) for other in fields])
    return np.array(products), space.ndof


def as_netgen(solid):
    """The same straight tetrahedra as an ngsolve mesh."""
    mesh = nm.Mesh()
    points = [mesh.Add(nm.MeshPoint(nm.Pnt(*p))) for p in solid.points]
    mesh.SetMaterial(1, "solid")
    names = {0: "base", 1: "tip"}
    for number in range(3):
        mesh.Add(nm.FaceDescriptor(bc=number + 1, domin=1, surfnr=number + 1))
        mesh.SetBCName(number, names.get(number, "side"))
    for cell in solid.cells:
        mesh.Add(nm.Element3D(1, [points[i] for i in cell[[0, 2, 1, 3]]]))
    for face, patch in zip(solid.faces, solid.patch, strict=True):
        corners = [points[i] for i in face]
        mesh.Add(nm.Element2D(int(min(patch, 2)) + 1, corners))
    return ng.Mesh(mesh)


def same_mesh():
    """Both codes on the same straight tetrahedra."""
    surface = read_surface(SURFACE)
    solid = fea.first_mesh(surface, *PLANES, fea.Budget())
    none = (None,) * len(solid.shapes)
    straight = Solid(solid.points, solid.cells, solid.faces, solid.patch, none)
    start = time.perf_counter()
    mesh = quadratic(straight)
    lam, mu = (np.full(len(mesh.cells), value) for value in (LAM, MU))
    ours = condense(mesh, lam, mu, CENTERS)
    middle = time.perf_counter()
    theirs, unknowns = ngsolve_stiffness(as_netgen(straight), 2)
    end = time.perf_counter()
    gap = np.abs(scaled(theirs - ours.stiffness, ours.stiffness)).max()
    print(
        f"same mesh, {unknowns} unknowns: largest difference {gap:.1e}; "
        f"ours {middle - start:.2f} s, NGSolve {end - middle:.2f} s"
    )


def their_own(maxh, order):
    """NGSolve from the exact cylinder to K."""
    start = time.perf_counter()
    bar = Cylinder(Pnt(0, 0, 0), Z, 0.04, 0.452, "base", "tip", "side")
    mesh = ng.Mesh(OCCGeometry(bar).GenerateMesh(maxh=maxh))
    mesh.Curve(order)
    K, unknowns = ngsolve_stiffness(mesh, order)
    row(f"NGSolve order {order}, h {maxh:g}", K, unknowns, time.perf_counter() - start)


def ours(accuracy, cache):
    """From the surface to K, the mesher's time included or not."""
    start = time.perf_counter()
    link = fea.mesh_link(SURFACE, *PLANES, 60e9, 0.3, accuracy=accuracy, cache=cache)
    seconds = time.perf_counter() - start
    name = f"ours, asked {accuracy:g}"
    row(name, link.stiffness, link.mesh["unknowns"], seconds)


def row(name, K, unknowns, seconds):
    """One line of the table."""
    error = K[0, 0] / REFERENCE - 1
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(
        f"{name:26} {unknowns:8d} unknowns {100 * error:8.4f} % {seconds:7.1f} s "
        f"(peak so far {memory:.1f} GB)",
        flush=True,
    )


if __name__ == "__main__":
    import tempfile

    with ng.TaskManager():
        same_mesh()
        with tempfile.TemporaryDirectory() as folder:
            for asked in (0.005, 0.001):
                ours(asked, Path(folder) / str(asked))  # with the mesher
                ours(asked, Path(folder) / str(asked))  # from the cache
        for maxh, order in ((0.02, 2), (0.01, 2), (0.04, 3), (0.02, 3), (0.04, 4)):
            their_own(maxh, order)
