"""NAFEMS's standard tests LE1 and LE10, with our elements and a structured mesh.

The Standard NAFEMS Benchmarks (1990).  Both are quarters of an elliptic ring: inner
(x / 2)^2 + y^2 = 1, outer (x / 3.25)^2 + (y / 2.75)^2 = 1; E = 210 GPa, nu = 0.3.
"""

import numpy as np
import pytest

from stiffness.elements import (
    Quadratic,
    assemble,
    lame,
    node_gradients,
    quadratic,
    triangle_rule,
)
from stiffness.solver import solve
from tests.solids_for_tests import box_solid

LAM, MU = lame(210e9, 0.3)


def ring(counts, thickness):
    """Quadratic tetrahedra of the ring; nodes in the unit box come along."""
    flat = quadratic(box_solid(counts, (1.0, 1.0, 1.0)))
    s, t, height = flat.nodes.T
    # finer toward the inner edge and toward the x axis, where D is
    s, t = (np.expm1(1.5 * v) / np.expm1(1.5) for v in (s, t))
    angle = np.pi / 2 * t
    a, b = 2 + 1.25 * s, 1 + 1.75 * s
    places = np.column_stack([a * np.cos(angle), b * np.sin(angle), thickness * height])
    size = np.linalg.det(places[flat.cells[:, 1:4]] - places[flat.cells[:, :1]])
    # should the map turn the box inside out: corners 1 and 2 change places, and the
    # middles of edges 01 12 02 03 13 23 with them
    swapped = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
    cells = flat.cells if size.min() > 0 else flat.cells[:, swapped]
    curved = np.ones(len(cells), dtype=bool)
    return flat.nodes, Quadratic(places, cells, flat.faces, flat.patch, curved)


def pressed(mesh, faces, pressure):
    """(n, 3) nodal forces of a pressure [Pa] against faces."""
    N, dN, weights = triangle_rule()
    J = np.einsum("qai,tax->tqix", dN, mesh.nodes[faces])
    normal = np.cross(J[:, :, 0], J[:, :, 1])
    middle = mesh.nodes[faces].mean(axis=1) - mesh.nodes.mean(axis=0)
    flip = np.sign(np.einsum("tqx,tx->tq", normal, middle))
    force = np.einsum("q,qa,tq,tqx->tax", weights, N, -pressure * flip, normal)
    loads = np.zeros_like(mesh.nodes)
    np.add.at(loads, faces, force)
    return loads


def stress_at(mesh, held, loads, node):
    """sigma_yy [Pa] at a node, averaged over its elements."""
    ones = np.ones(len(mesh.cells))
    upper = assemble(mesh, LAM * ones, MU * ones)
    free = ~held.ravel()
    u = np.zeros(free.size)
    u[free] = solve(upper[free][:, free], loads.ravel()[free][:, None])[:, 0]
    u = u.reshape(-1, 3)
    found = []
    for part, G in node_gradients(mesh):
        nodes = mesh.cells[part]
        slope = np.einsum("cqax,cai->cqix", G, u[nodes])
        stress = LAM * np.trace(slope, axis1=2, axis2=3) + 2 * MU * slope[:, :, 1, 1]
        found.append(stress[nodes == node])
    return float(np.concatenate(found).mean())


def on(mesh, values, value):
    """Boundary faces whose nodes all have a coordinate of the unit box."""
    return mesh.faces[np.isclose(values[mesh.faces], value, atol=1e-9).all(axis=1)]


def test_le1_elliptic_membrane():
    """10 MPa outward on the outer edge; sigma_yy at D (2, 0) is 92.7 MPa.

    Plane stress by a free sheet of 0.02 m; printed to three digits, so 0.1 % of it.
    """
    unit, mesh = ring((16, 24, 1), 0.02)
    held = np.zeros(mesh.nodes.shape, dtype=bool)
    held[unit[:, 1] == 0, 1] = True
    held[unit[:, 1] == 1, 0] = True
    held[unit[:, 2] == 0, 2] = True
    loads = pressed(mesh, on(mesh, unit[:, 0], 1.0), -10e6)
    (node,) = np.flatnonzero((unit == 0).all(axis=1))
    assert mesh.nodes[node] == pytest.approx([2, 0, 0])
    assert stress_at(mesh, held, loads, node) == pytest.approx(92.7e6, rel=1e-3)


@pytest.mark.slow
def test_le10_thick_plate():
    """1 MPa on the upper face; sigma_yy at D (2, 0, top) is -5.38 MPa, 0.6 %."""
    unit, mesh = ring((12, 14, 10), 0.6)
    held = np.zeros(mesh.nodes.shape, dtype=bool)
    held[unit[:, 1] == 0, 1] = True
    held[unit[:, 1] == 1, 0] = True
    outer = unit[:, 0] == 1
    held[outer, 0] = held[outer, 1] = True
    held[outer & np.isclose(unit[:, 2], 0.5), 2] = True
    loads = pressed(mesh, on(mesh, unit[:, 2], 1.0), 1e6)
    (node,) = np.flatnonzero((unit == [0, 0, 1]).all(axis=1))
    assert mesh.nodes[node] == pytest.approx([2, 0, 0.6])
    assert loads.sum(axis=0)[2] == pytest.approx(
        -1e6 * np.pi / 4 * (3.25 * 2.75 - 2), rel=1e-3
    )
    assert stress_at(mesh, held, loads, node) == pytest.approx(-5.38e6, rel=6e-3)
