"""Compute K_E of the round links of ``meshes/`` by Fourier modes.

``python benchmarks/evidence/stiffness_round_references.py`` requires NGSolve (``pip
install ngsolve``).

The displacements of a body of revolution in the Fourier mode m are

    u_r = U cos(m a), u_t = V sin(m a), u_z = W cos(m a).

Mode 0 contains tension and torsion, and mode 1 contains bending and shear.  Each mode
is a problem in the plane (r, z).  NGSolve solves it with elements whose size decreases
towards singular corners, and with increasing polynomial order.  In mode 1, the unknowns
are U + V, U - V and W, and U + V and W are zero on the axis.

K of the highest order and its difference from the previous order are written to
``stiffness_references.json``.  The program does not use the finite elements of
forcefit.
"""

import argparse
import json

import netgen.geom2d as plane
import ngsolve as ng
import numpy as np
from stiffness_references import HERE, LAM, MU, scaled

AXIS, FREE, BASE, TIP = "axis", "side", "base", "tip"
# corners (r, z) [m] of half sections, and the kind of the edge to the next corner
LINKS = {
    "distal_plain": (
        [(0, 0), (0.040, 0), (0.040, 0.452), (0, 0.452)], [BASE, FREE, TIP, AXIS]
    ),
    "tube": (
        [(0.026, 0), (0.030, 0), (0.030, 0.4), (0.026, 0.4)], [BASE, FREE, TIP, FREE]
    ),
    "tapered_arm": (
        [(0, 0), (0.045, 0), (0.025, 0.35), (0, 0.35)], [BASE, FREE, TIP, AXIS]
    ),
    "delta_forearm": (
        [(0, 0), (0.012, 0), (0.012, 0.03), (0.007, 0.03), (0.007, 0.37), (0.012, 0.37),
         (0.012, 0.4), (0, 0.4), (0, 0.37), (0.005, 0.37), (0.005, 0.03), (0, 0.03)],
        [BASE, FREE, FREE, FREE, FREE, FREE, TIP, AXIS, FREE, FREE, FREE, AXIS],
    ),
}  # fmt: skip


def half_section(corners, lines, size, layers=8):
    """Return a mesh of a half section with small elements at the corners."""
    geometry = plane.SplineGeometry()
    points = [geometry.AppendPoint(r, z, hpref=float(r > 0)) for r, z in corners]
    for k, name in enumerate(lines):
        ends = ["line", points[k], points[(k + 1) % len(points)]]
        geometry.Append(ends, bc=name)
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=size))
    mesh.RefineHP(layers, factor=0.15)
    return mesh


def energy(u, v, m, lame=(LAM, MU)):
    """Return the work of the stresses of one field on the strains of a second field."""
    r, (lam, mu) = ng.x, lame
    (U, V, W, dU, dV, dW), (S, T, X, dS, dT, dX) = u, v
    e, f = (
        [d[0][0], (a + m * b) / r, d[2][1], d[0][1] + d[2][0],
         -(m * a + b) / r + d[1][0], d[1][1] - m * c / r]
        for a, b, c, d in ((U, V, W, (dU, dV, dW)), (S, T, X, (dS, dT, dX)))
    )  # fmt: skip
    normal = lam * sum(e[:3]) * sum(f[:3]) + 2 * mu * sum(
        a * b for a, b in zip(e[:3], f[:3], strict=True)
    )
    return normal + mu * sum(a * b for a, b in zip(e[3:], f[3:], strict=True))


def mode_stiffness(mesh, order, m, motions, lame=(LAM, MU)):
    """Return the stiffness for motions (U, V, W) of the tip in mode m."""
    held = f"{BASE}|{TIP}"
    one = ng.H1(mesh, order=order, dirichlet=held)
    zero = ng.H1(mesh, order=order, dirichlet=f"{held}|{AXIS}")
    # unknowns U, V, W of mode 0, and U + V, U - V, W of mode 1
    space = zero * zero * one if m == 0 else zero * one * zero

    def parts(p, q, w):
        if m == 0:
            return p, q, w, ng.Grad(p), ng.Grad(q), ng.Grad(w)
        U, V = (p + q) / 2, (p - q) / 2
        return (
            U, V, w, (ng.Grad(p) + ng.Grad(q)) / 2, (ng.Grad(p) - ng.Grad(q)) / 2,
            ng.Grad(w),
        )  # fmt: skip

    trial, test = space.TnT()
    a = ng.BilinearForm(space, symmetric=True)
    form = energy(parts(*trial), parts(*test), m, lame) * ng.x
    a += form * ng.dx(bonus_intorder=6)
    a.Assemble()
    inverse = a.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    fields = []
    for U, V, W in motions:
        field = ng.GridFunction(space)
        given = (U, V, W) if m == 0 else (U + V, U - V, W)
        for part, value in zip(field.components, given, strict=True):
            part.Set(ng.CF(value), definedon=mesh.Boundaries(TIP))
        r = field.vec.CreateVector()
        r.data = -a.mat * field.vec
        field.vec.data += inverse * r
        fields.append(field.vec)
    image = fields[0].CreateVector()
    K = np.empty((len(fields), len(fields)))
    for i, field in enumerate(fields):
        image.data = a.mat * field
        K[i] = [ng.InnerProduct(image, other) for other in fields]
    return (2 * np.pi if m == 0 else np.pi) * (K + K.T) / 2


def stiffness(mesh, order, lame=(LAM, MU)):
    """Return K_E at the centre of the tip with a fixed base, (6, 6)."""
    turned, stretched = (
        mode_stiffness(mesh, order, 0, [motion], lame)[0, 0]
        for motion in ((0, ng.x, 0), (0, 0, 1))
    )
    # a unit rotation about y moves points by -r cos(a) along z; a unit translation
    # along x is (cos a, -sin a, 0) in the directions r, a, z
    bent = mode_stiffness(mesh, order, 1, [(0, 0, -ng.x), (1, -1, 0)], lame)
    K = np.diag([bent[0, 0], bent[0, 0], turned, bent[1, 1], bent[1, 1], stretched])
    K[1, 3] = K[3, 1] = bent[0, 1]
    K[0, 4] = K[4, 0] = -bent[0, 1]
    return K


def reference(name, orders):
    """Return K of the highest order, and its difference from the previous order."""
    corners, lines = LINKS[name]
    wall = min(abs(a - b) for a, _ in corners for b, _ in corners if a != b)
    mesh = half_section(corners, lines, max(wall, 0.004))
    last = None
    for order in orders:
        K = stiffness(mesh, order)
        step = np.nan if last is None else np.abs(scaled(last - K, K)).max()
        print(f"{name} order {order}: {mesh.ne} elements, step {step:.1e}, "
              f"K_RX {K[0, 0]:.9g} K_RZ {K[2, 2]:.9g}", flush=True)  # fmt: skip
        last = K
    return K, step


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("links", nargs="*", default=list(LINKS))
    parser.add_argument("--orders", default="6,8,10")
    asked = parser.parse_args()
    path = HERE / "stiffness_references.json"
    for name in asked.links:
        K, step = reference(name, [int(p) for p in asked.orders.split(",")])
        stored = json.loads(path.read_text()) if path.exists() else {}
        stored[name] = {"stiffness": K.tolist(), "last_step": step}
        path.write_text(json.dumps(stored, indent=1) + "\n")
