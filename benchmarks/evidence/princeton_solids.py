"""Compute the Princeton beam as a finite-element solid with large rotations.

``python -m benchmarks.evidence.princeton_solids`` takes half an hour.

The published results of beam elements and of solid elements differ by up to 3.5 %.
This program computes a third solution with high-order bricks, Saint Venant-Kirchhoff
material and the total Lagrangian formulation.  One end face is clamped, and the other
is loaded uniformly.  The program does not use the elements of forcefit.  It prints the
differences [%] of published results and of links with 8 beam elements from this
solution.

Sources:
    Dowell, Traybar (1975), the experiment; Obrezkov et al., Nonlinear Dynamics (2022),
    ANSYS beams and solids (4 x 12 x 500 bricks).
"""

import sys
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, Robot
from forcefit.stiffness.screws import screw_map
from forcefit.validation.assumptions.solid_links import solid_link

LENGTH, HEIGHT, WIDTH = 0.508, 12.3777e-3, 3.2024e-3  # [m]
E, NU = 71.7e9, 0.31
BAR = BeamLink({"width": WIDTH, "height": HEIGHT}, E, NU, up=(0, 1, 0))
ANGLES = (0, 15, 30, 45, 60, 75, 90)  # [deg] angles of the force from the height
# published deflections [m] of beams and solids along the height and the width
PUBLISHED = {
    8.896: (
        ((1.071417630e-2, 1.061328706e-2, 1.011169630e-2, 8.837226265e-3,
          6.604665004e-3, 3.538889001e-3, 0.0),
         (0.0, 4.208232124e-2, 7.939482948e-2, 0.108987937, 0.129887616,
          0.142194370, 0.146245978)),
        ((1.069752828e-2, 1.057180106e-2, 9.938278402e-3, 8.686786771e-3,
          6.500006282e-3, 3.481999513e-3, 0.0),
         (0.0, 4.101165651e-2, 7.696749069e-2, 0.105976311, 0.127251299,
          0.139594740, 0.143848652)),
    ),
    13.345: (
        ((1.606423724e-2, 1.645825752e-2, 1.665873206e-2, 1.518618440e-2,
          1.157837500e-2, 6.248967384e-3, 0.0),
         (0.0, 6.435812858e-2, 0.117735994, 0.156467239, 0.181861627,
          0.196097131, 0.200677707)),
        ((1.603700622e-2, 1.637026068e-2, 1.640440775e-2, 1.485055210e-2,
          1.127173264e-2, 6.062461977e-3, 0.0),
         (0.0, 6.270699533e-2, 0.113752002, 0.153554457, 0.179978534,
          0.192972233, 0.197669499)),
    ),
}  # fmt: skip
_STEPS = 4  # number of load steps
_ITERATIONS = 30


def line(order: int) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return Lagrange polynomials for the Lobatto points between -1 and 1.

    Args:
        order: order of the polynomials, at least 2.

    Returns:
        Values (order + 1 Gauss points, nodes) and derivatives of the polynomials, the
        weights of the Gauss points, and the integrals of the polynomials.
    """
    inner = Legendre.basis(order).deriv().roots()
    nodes = np.concatenate([[-1.0], inner, [1.0]])
    points, weights = leggauss(order + 1)
    shapes = [Polynomial.fromroots(np.delete(nodes, i)) for i in range(order + 1)]
    shapes = [p / p(x) for p, x in zip(shapes, nodes, strict=True)]
    values = np.array([p(points) for p in shapes]).T
    slopes = np.array([p.deriv()(points) for p in shapes]).T
    return values, slopes, weights, weights @ values


@dataclass(frozen=True, eq=False)
class Box:
    """Box of equal bricks.

    Attributes:
        elements: (e, m) nodes of the bricks.
        gradients: (q, m, 3) [1/m] gradients of shape functions at Gauss points.
        weights: (q,) [m^3] weights of Gauss points.
        clamped: nodes of the first face.
        pulled: (nodes,) fraction of the force on the last face that acts on each node.
    """

    elements: NDArray
    gradients: NDArray
    weights: NDArray
    clamped: NDArray
    pulled: NDArray


def box(counts: tuple[int, int, int], orders: tuple[int, int, int]) -> Box:
    """Return a box with given numbers of bricks, clamped at x = 0."""
    sides = np.array([LENGTH, HEIGHT, WIDTH]) / counts
    nodes = [order * n + 1 for order, n in zip(orders, counts, strict=True)]
    number = np.arange(np.prod(nodes)).reshape(nodes)
    cells = [
        tuple(
            slice(order * i, order * i + order + 1)
            for order, i in zip(orders, cell, strict=True)
        )
        for cell in np.ndindex(*counts)
    ]
    values, slopes, weights, means = zip(*map(line, orders), strict=True)
    points = np.prod(np.array(orders) + 1)
    gradients = []
    for axis, side in enumerate(sides):
        three = [slopes[k] if k == axis else values[k] for k in range(3)]
        product = np.einsum("ai,bj,ck->abcijk", *three).reshape(points, points)
        gradients.append(product * 2 / side)
    pulled = np.zeros(nodes)
    for _, along, across in cells[: counts[1] * counts[2]]:
        share = np.outer(means[1], means[2]) / 4 / counts[1] / counts[2]
        pulled[-1, along, across] += share
    return Box(
        np.array([number[cell].ravel() for cell in cells]),
        np.stack(gradients, axis=2),
        np.einsum("a,b,c->abc", *weights).ravel() * np.prod(sides) / 8,
        number[0].ravel(), pulled.ravel(),
    )  # fmt: skip


def equations(solid: Box, u: NDArray) -> tuple[NDArray, csc_matrix]:
    """Return the internal forces (nodes, 3), and their derivative."""
    lame, shear = E * NU / (1 + NU) / (1 - 2 * NU), E / 2 / (1 + NU)
    eye, G = np.eye(3), solid.gradients
    F = eye + np.einsum("eni,qnj->eqij", u[solid.elements], G, optimize=True)
    green = (np.swapaxes(F, -1, -2) @ F - eye) / 2
    trace = np.trace(green, axis1=-2, axis2=-1)[..., None, None]
    S = lame * trace * eye + 2 * shear * green
    weighted = solid.weights[:, None, None] * (F @ S)
    forces = np.einsum("eqij,qnj->eni", weighted, G, optimize=True)
    # dP_ij / dF_kl
    A = np.einsum("ik,eqjl->eqijkl", eye, S)
    A += lame * np.einsum("eqij,eqkl->eqijkl", F, F)
    A += shear * np.einsum("eqil,eqkj->eqijkl", F, F)
    A += shear * np.einsum("eqim,eqkm,jl->eqijkl", F, F, eye, optimize=True)
    A *= solid.weights[:, None, None, None, None]
    count, nodes = solid.elements.shape
    flat = G.transpose(0, 2, 1).reshape(-1, nodes)  # shape (Gauss points x axes, nodes)
    K = np.empty((count, nodes, 3, nodes, 3))
    for e in range(count):
        for i, k in np.ndindex(3, 3):
            right = np.einsum("qjl,qml->qjm", A[e, :, i, :, k], G)
            K[e, :, i, :, k] = flat.T @ right.reshape(len(flat), nodes)
    dofs = (3 * solid.elements[:, :, None] + np.arange(3)).reshape(count, -1)
    rows = np.repeat(dofs, 3 * nodes, axis=1).ravel()
    columns = np.tile(dofs, (1, 3 * nodes)).ravel()
    out = np.zeros_like(u)
    np.add.at(out, solid.elements, forces)
    return out, csc_matrix((K.ravel(), (rows, columns)), shape=(u.size, u.size))


def bent(solid: Box, force: NDArray, u: NDArray, start: NDArray) -> NDArray:
    """Return the displacements under a uniform dead load on the end face.

    Args:
        solid: the box.
        force: (3,) [N] load.
        u: (nodes, 3) [m] equilibrium under the load ``start``.
        start: (3,) [N] load with a known equilibrium.

    Returns:
        (nodes, 3) [m] displacements at equilibrium, computed in steps of the load.
    """
    free = np.ones(u.shape, dtype=bool)
    free[solid.clamped] = False
    free = np.flatnonzero(free.ravel())
    for share in np.arange(1, _STEPS + 1) / _STEPS:
        load = np.outer(solid.pulled, start + share * (force - start)).ravel()
        for _ in range(_ITERATIONS):
            inner, K = equations(solid, u)
            change = np.zeros(u.size)
            change[free] = splu(K[free][:, free]).solve((load - inner.ravel())[free])
            u = u + change.reshape(u.shape)
            if np.abs(change).max() < (1e-9 if share == 1.0 else 1e-3) * LENGTH:
                break
        else:
            raise RuntimeError(f"found no equilibrium at {share:g} times {force} N")
    return u


def solid_rows(
    counts: tuple[int, int, int], orders: tuple[int, int, int], angle: float
) -> dict[float, NDArray]:
    """Return the end face displacements along height and width by force, (2,) [m]."""
    solid = box(counts, orders)
    u, start, rows = np.zeros((len(solid.pulled), 3)), np.zeros(3), {}
    for size in PUBLISHED:
        force = size * np.array([0.0, np.cos(angle), np.sin(angle)])
        u, start = bent(solid, force, u, start), force
        rows[size] = solid.pulled @ u[:, 1:]
    return rows


def root_link() -> MatrixLink:
    """Return the first of 8 beam elements with a clamped end that cannot warp.

    A solid with two rigid end faces is stiffer than a beam.  Half of the difference is
    added to the stiffness of the first element.
    """
    piece = LENGTH / 8
    frame = Frame("tip", translation=[piece, 0, 0], link=BAR)
    beam, solid = link_compliance(frame), solid_link(frame)
    assert solid is not None
    held = np.diag(beam - np.linalg.inv(solid.condensed)) / 2 * [1, 1, 1, 1, 0, 0]
    from_root = screw_map([-piece, 0, 0])
    stiffer = beam - from_root @ np.diag(held) @ from_root.T
    return MatrixLink(np.linalg.inv(stiffer))


def in_pieces(
    size: float, angle: float, root: MatrixLink | None = None, link: BeamLink = BAR
) -> NDArray:
    """Return the tip displacements of 8 beam elements, (2,) [m]."""
    piece = LENGTH / 8
    if root is None:
        whole = replace(link, pieces=8)
        frames = (Frame("tip", translation=[LENGTH, 0, 0], link=whole),)
    else:
        rest = replace(link, pieces=7)
        frames = (
            Frame("root", translation=[piece, 0, 0], link=root),
            Frame("tip", "root", [LENGTH - piece, 0, 0], link=rest),
        )
    load = [0, 0, 0, 0, size * np.cos(angle), size * np.sin(angle)]
    posture = home_posture(Robot("cantilever", "tip", frames))
    return solve_exact(posture, load).platform_screw[4:]


def main() -> None:
    """Print the table for given numbers and orders of the bricks."""
    numbers = tuple(int(n) for n in sys.argv[1:7]) or (40, 2, 1, 4, 4, 3)
    counts, orders = numbers[:3], numbers[3:]
    print(f"{counts} bricks of orders {orders}; differences [%], height and width")
    print(
        "    F  beta      solid [mm]       8 elements      with rigid root "
        "  published beam   solid"
    )
    root = root_link()
    for k, degrees in enumerate(ANGLES):
        angle = np.radians(degrees)
        for size, solid in solid_rows(counts, orders, angle).items():
            ours, rooted = in_pieces(size, angle), in_pieces(size, angle, root)
            beam, brick = (np.array([v[k] for v in rows]) for rows in PUBLISHED[size])
            others = "  ".join(off(v, solid) for v in (ours, rooted, beam, brick))
            moved = f"{1e3 * solid[0]:9.4f}{1e3 * solid[1]:10.4f}"
            print(f"{size:7.3f}{degrees:4d} {moved}{others}", flush=True)


def off(values: NDArray, arbiter: NDArray) -> str:
    """Return the differences in per cent."""
    return "".join(
        f"{100 * (v / a - 1):8.2f}" if abs(a) > 1e-6 else f"{'-':>8s}"
        for v, a in zip(values, arbiter, strict=True)
    )


if __name__ == "__main__":
    main()
