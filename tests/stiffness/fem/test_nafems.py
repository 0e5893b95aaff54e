"""Tests with the NAFEMS benchmarks LE1, LE10 and LE11.

Source: The Standard NAFEMS Benchmarks (1990). The body of LE1 and LE10 is a quarter of
the ring between the ellipses (x / 2)^2 + y^2 = 1 and (x / 3.25)^2 + (y / 2.75)^2 = 1. E
is 210 GPa, and nu is 0.3.
"""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.stiffness.fem.elements import (
    assemble,
    integration,
    isoparametric,
    lame,
    node_gradients,
    triangle_rule,
)
from forcefit.stiffness.fem.sparse_solver import solve
from tests.solids_for_tests import box_solid

LAM, MU = lame(210e9, 0.3)


def ring(counts, thickness):
    """Return cubic elements of the ring, and their nodes in a unit box."""
    flat = isoparametric(box_solid(counts, (1.0, 1.0, 1.0)))
    s, t, height = flat.nodes.T
    # the mesh is finer near the point (2, 0)
    s, t = (np.expm1(1.5 * v) / np.expm1(1.5) for v in (s, t))
    angle = np.pi / 2 * t
    a, b = 2 + 1.25 * s, 1 + 1.75 * s
    places = np.column_stack([a * np.cos(angle), b * np.sin(angle), thickness * height])
    curved = np.ones(len(flat.cells), dtype=bool)
    return flat.nodes, replace(flat, nodes=places, curved=curved)


def sphere_cone_cylinder(counts):
    """Return cubic elements of a quarter of the body of LE11, and their nodes in a unit
    box. The inner surface is a sphere with a radius of 1 m up to 45 degrees, then a
    cylinder. The outer surface is a sphere with a radius of 1.4 m up to z = 0.7, then a
    cone up to r = 1 and z = 1.39, then a cylinder up to z = 1.79."""
    flat = isoparametric(box_solid(counts, (1.0, 1.0, 1.0)))
    s, t, turn = flat.nodes.T
    # the mesh is finer near s = t = 0
    s, low = (np.expm1(2 * v) / np.expm1(2) for v in (s, np.minimum(4 * t, 1.0)))
    t = np.where(t < 0.25, low / 4, t)
    corner, top = np.sqrt(0.5), 1.79
    # the borders of four zones are at the corners of the outline
    inner_angle = np.interp(t, [0, 0.5], [0, np.pi / 4])
    height = np.interp(t, [0.5, 1.0], [corner, top])
    inner = np.where(
        t <= 0.5,
        [np.cos(inner_angle), np.sin(inner_angle)],
        [np.full(len(t), corner), height],
    )
    angle = np.interp(t, [0, 0.25], [0, np.arcsin(0.5)])
    line = [0.25, 0.5, 0.75, 1.0]
    edge_r = 1.4 * np.sqrt(0.75)
    outer = np.where(
        t <= 0.25,
        [1.4 * np.cos(angle), 1.4 * np.sin(angle)],
        [
            np.interp(t, line, [edge_r, (edge_r + 1) / 2, 1.0, 1.0]),
            np.interp(t, line, [0.7, 1.045, 1.39, top]),
        ],
    )
    r, z = inner + s * (outer - inner)
    places = np.column_stack([
        r * np.cos(np.pi / 2 * turn),
        r * np.sin(np.pi / 2 * turn),
        z,
    ])
    curved = np.ones(len(flat.cells), dtype=bool)
    return flat.nodes, replace(flat, nodes=places, curved=curved)


def pressed(mesh, faces, pressure):
    """Return the nodal forces of a pressure on faces, (n, 3)."""
    N, dN, weights = triangle_rule(mesh.order)
    J = np.einsum("qai,tax->tqix", dN, mesh.nodes[faces])
    normal = np.cross(J[:, :, 0], J[:, :, 1])
    middle = mesh.nodes[faces].mean(axis=1) - mesh.nodes.mean(axis=0)
    flip = np.sign(np.einsum("tqx,tx->tq", normal, middle))
    force = np.einsum("q,qa,tq,tqx->tax", weights, N, -pressure * flip, normal)
    loads = np.zeros_like(mesh.nodes)
    np.add.at(loads, faces, force)
    return loads


def stress_at(mesh, held, loads, node, direction=1):
    """Return a component of the stress at a node [Pa]."""
    ones = np.ones(len(mesh.cells))
    upper = assemble(mesh, LAM * ones, MU * ones)
    free = ~held.ravel()
    u = np.zeros(free.size)
    u[free] = solve(upper[free][:, free], loads.ravel()[free][:, None])[:, 0]
    u = u.reshape(-1, 3)
    stresses = []
    for part, G in node_gradients(mesh):
        nodes = mesh.cells[part]
        slope = np.einsum("cqax,cai->cqix", G, u[nodes])
        along = slope[:, :, direction, direction]
        stress = LAM * np.trace(slope, axis1=2, axis2=3) + 2 * MU * along
        stresses.append(stress[nodes == node])
    return float(np.concatenate(stresses).mean())


def on(mesh, values, value):
    """Return the boundary faces on a side of the unit box."""
    return mesh.faces[np.isclose(values[mesh.faces], value, atol=1e-9).all(axis=1)]


def test_nafems_le1_elliptic_membrane_has_the_published_stress():
    """A traction of 10 MPa acts on the outer edge. The published sigma_yy at (2, 0) is
    92.7 MPa."""
    unit, mesh = ring((10, 16, 1), 0.02)
    held = np.zeros(mesh.nodes.shape, dtype=bool)
    held[unit[:, 1] == 0, 1] = True
    held[unit[:, 1] == 1, 0] = True
    held[unit[:, 2] == 0, 2] = True
    loads = pressed(mesh, on(mesh, unit[:, 0], 1.0), -10e6)
    (node,) = np.flatnonzero((unit == 0).all(axis=1))
    assert mesh.nodes[node] == pytest.approx([2, 0, 0])
    assert stress_at(mesh, held, loads, node) == pytest.approx(92.7e6, rel=1e-3)


def test_nafems_le10_thick_plate_has_the_published_stress():
    """A pressure of 1 MPa acts on the upper face. The published sigma_yy at (2, 0) on
    this face is -5.38 MPa."""
    unit, mesh = ring((6, 7, 4), 0.6)
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


def heated(mesh, temperature, coefficient):
    """Return the nodal forces that are equivalent to a temperature, (n, 3)."""
    loads = np.zeros_like(mesh.nodes)
    modulus = (3 * LAM + 2 * MU) * coefficient
    for part, _, _, N, G, w in integration(mesh):
        T = temperature(np.einsum("qa,tax->tqx", N, mesh.nodes[mesh.cells[part]]))
        force = np.einsum("tq,tqax->tax", w * modulus * T, G)
        np.add.at(loads, mesh.cells[part], force)
    return loads


def warmth(x):
    """Return the temperature r + z."""
    return np.hypot(x[..., 0], x[..., 1]) + x[..., 2]


def le11_stress(counts):
    """Return sigma_zz on the circle through (1, 0, 0) [Pa]."""
    unit, mesh = sphere_cone_cylinder(counts)
    held = np.zeros(mesh.nodes.shape, dtype=bool)
    held[unit[:, 2] == 0, 1] = True
    held[unit[:, 2] == 1, 0] = True
    held[(unit[:, 1] == 0) | (unit[:, 1] == 1), 2] = True
    loads = heated(mesh, warmth, 2.3e-4)
    circle = np.flatnonzero((unit[:, 0] == 0) & (unit[:, 1] == 0))
    assert np.hypot(*mesh.nodes[circle, :2].T) == pytest.approx(1)
    middle = circle[np.argmin(np.abs(unit[circle, 2] - 0.5))]
    thermal = (3 * LAM + 2 * MU) * 2.3e-4 * warmth(mesh.nodes[middle])
    return stress_at(mesh, held, loads, middle, direction=2) - thermal


@pytest.mark.slow
def test_nafems_le11_solid_cylinder_taper_sphere_has_the_published_stress():
    """The temperature is r + z, and the ends are fixed along z. The published sigma_zz
    at (1, 0, 0) is -105 MPa."""
    coarse, fine = le11_stress((4, 12, 4)), le11_stress((6, 16, 4))
    assert fine == pytest.approx(-105e6, rel=6e-3)
    assert abs(fine + 105e6) < 0.6 * abs(coarse + 105e6)
