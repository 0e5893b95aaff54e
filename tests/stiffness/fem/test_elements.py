"""Tests of finite elements."""

import numpy as np
import pytest
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import eigsh

from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import rectangular_section, round_section
from forcefit.stiffness.fem.condensation import KINDS, condense, rigid_motions
from forcefit.stiffness.fem.elements import assemble, integration, isoparametric, lame
from forcefit.stiffness.fem.sparse_solver import solve
from forcefit.stiffness.link import inverted, scaled
from forcefit.stiffness.mesh.edge_grading import layered, split_joining_edges
from forcefit.stiffness.mesh.lagrange import lattice
from forcefit.stiffness.mesh.solid import Solid
from forcefit.stiffness.screws import rotation_matrix, screw_map
from tests.solids_for_tests import bar_solid, box_solid, constants

E, NU = 60e9, 0.3
LAM, MU = lame(E, NU)
MESHES = [  # order of the elements, and whether there are layers along edges
    (2, False), (3, False), (2, True),
    pytest.param(3, True, marks=pytest.mark.slow),
]  # fmt: skip


def full(upper):
    """Return a symmetric matrix from its upper triangle."""
    dense = upper.toarray()
    return dense + dense.T - np.diag(np.diag(dense))


def crooked(rng):
    """Return a mesh of a box with a curved side and irregular elements."""
    solid = box_solid((2, 2, 3), (0.1, 0.12, 0.2))
    inside = np.all((solid.points > 1e-9) & (solid.points < [0.1, 0.12, 0.2]), axis=1)
    points = solid.points + 0.01 * inside[:, None] * rng.uniform(
        -1, 1, (len(inside), 3)
    )
    return Solid(points, solid.cells, solid.faces, solid.patch, solid.shapes)


def curved_mesh(order, layers=False):
    solid = split_joining_edges(bar_solid(1, 3, 0.04, 0.2), (0, 1))
    parts = layered(solid, (0, 1)) if layers else None
    mesh = isoparametric(solid, order, parts)
    assert mesh.curved.sum() > 30
    return mesh


def solved(solid, order, kind="rigid", tip=None):
    mesh = isoparametric(solid, order)
    top = solid.points[:, 2].max()
    middle = solid.points.mean(axis=0)
    centers = np.array([[*middle[:2], 0], [*middle[:2], top] if tip is None else tip])
    return mesh, condense(mesh, *constants(mesh), centers, kind)


both_orders = pytest.mark.parametrize("order", [2, 3])


@pytest.mark.parametrize(("order", "layers"), MESHES)
def test_only_rigid_motions_have_zero_strain_energy(rng, order, layers):
    """This includes curved elements and elements in layers."""
    mesh = curved_mesh(order, layers)
    K = full(assemble(mesh, *constants(mesh)))
    motions = rigid_motions(mesh.nodes, np.array([0.3, 0.2, 0.1])).reshape(-1, 6)
    # forces of a rigid motion, relative to those of a strain
    strained = mesh.nodes * [1, -1, 0]
    scale = np.abs(K @ strained.ravel()).max()
    assert np.abs(K @ motions).max() < 1e-11 * scale
    # the matrix has exactly six zero eigenvalues, and the others are positive
    shift = 1e-6 * np.diag(K).max()
    np.linalg.cholesky(K + shift * np.eye(len(K)))
    values = np.sort(eigsh(
        csc_matrix(K), 7, sigma=-shift, v0=rng.normal(size=len(K)),
        return_eigenvectors=False,
    ))  # fmt: skip
    assert np.abs(values[:6]).max() < 1e-10 * values[6]


@pytest.mark.parametrize(("order", "layers"), MESHES)
def test_linear_displacement_field_is_exact_on_any_mesh(rng, order, layers):
    """In this patch test, a linear field is prescribed on the boundary."""
    solid = split_joining_edges(crooked(rng), (0, 1))
    parts = layered(solid, (0, 1)) if layers else None
    mesh = isoparametric(solid, order, parts)
    upper = assemble(mesh, *constants(mesh))
    slope = rng.normal(size=(3, 3))
    exact = mesh.nodes @ slope.T
    inner = np.ones(len(mesh.nodes), dtype=bool)
    inner[np.unique(mesh.faces)] = False
    assert inner.sum() > 10
    free = np.repeat(inner, 3)
    u = np.where(free, 0.0, exact.ravel())
    K = full(upper)
    u[free] = solve(upper[free][:, free], -(K @ u)[free][:, None])[:, 0]
    np.testing.assert_allclose(u, exact.ravel(), atol=1e-13)


@pytest.mark.parametrize("curved", [False, True])
def test_stiffness_matrix_equals_that_of_scikit_fem(curved):
    """Only the quadrature rule is the same in both programs."""
    import skfem
    from scipy.spatial import cKDTree
    from skfem.models.elasticity import linear_elasticity

    solid = bar_solid(2, 4, 0.04, 0.2)
    straight = Solid(solid.points, solid.cells, solid.faces, solid.patch, (None,) * 3)
    flat = isoparametric(straight, 2)
    mesh = isoparametric(solid, 2) if curved else flat
    ours = full(assemble(mesh, *constants(mesh)))
    theirs = skfem.MeshTet2.from_mesh(skfem.MeshTet(solid.points.T, solid.cells.T))
    ours_of_theirs = cKDTree(flat.nodes).query(theirs.doflocs.T)[1]
    theirs.doflocs[:] = mesh.nodes[ours_of_theirs].T
    basis = skfem.Basis(theirs, skfem.ElementVector(skfem.ElementTetP2()), intorder=5)
    K = linear_elasticity(LAM, MU).assemble(basis).toarray()
    direction = np.zeros(K.shape[0], dtype=int)
    for dofs in (basis.nodal_dofs, basis.edge_dofs):
        direction[dofs] = np.arange(3)[:, None]
    gap, node = cKDTree(mesh.nodes).query(basis.doflocs.T)
    assert gap.max() < 1e-12
    order = 3 * node + direction
    difference = K - ours[np.ix_(order, order)]
    assert np.abs(difference).max() < 1e-12 * np.abs(ours).max()


@both_orders
def test_strain_energy_of_a_polynomial_field_equals_its_integral(rng, order):
    """The components of the field are polynomials with random coefficients. Their exact
    energy is integrated over the whole box.
    """
    size = np.array([0.5, 0.6, 0.8])
    mesh = isoparametric(box_solid((1, 2, 2), size), order)
    powers = lattice(order)[:, 1:]
    A = rng.normal(size=(len(powers), 3))
    u = (mesh.nodes[:, None] ** powers).prod(axis=2) @ A
    upper = assemble(mesh, *constants(mesh))
    energies = 2 * u.ravel() @ (upper @ u.ravel()) - u.ravel() ** 2 @ upper.diagonal()
    point, weight = np.polynomial.legendre.leggauss(4)
    grid = np.stack(np.meshgrid(point, point, point), axis=-1).reshape(-1, 3)
    x = (1 + grid) / 2 * size
    w = np.prod(np.stack(np.meshgrid(weight, weight, weight), axis=-1), axis=-1)
    w = w.ravel() * size.prod() / 8
    slope = np.zeros((len(x), 3, 3))
    for k in range(3):
        lower = powers - np.eye(3, dtype=int)[k]
        grown = (x[:, None] ** np.maximum(lower, 0)).prod(axis=2) * powers[:, k]
        slope[:, :, k] = grown @ A
    strain = (slope + slope.swapaxes(1, 2)) / 2
    trace = np.trace(strain, axis1=1, axis2=2)
    energy = LAM * trace**2 + 2 * MU * (strain**2).sum(axis=(1, 2))
    assert energies == pytest.approx(w @ energy, rel=1e-12)


@both_orders
@pytest.mark.parametrize("kind", KINDS)
def test_rotating_the_mesh_rotates_the_stiffness(rng, kind, order):
    solid = box_solid((2, 2, 3), (0.05, 0.08, 0.2))
    R = rotation_matrix(rng.normal(size=3))
    turned = Solid(
        solid.points @ R.T, solid.cells, solid.faces, solid.patch, (None,) * 3
    )
    centers = np.array([[0.025, 0.04, 0], [0.025, 0.04, 0.2]])
    A = np.kron(np.eye(2), R)
    K = []
    for each, places in ((solid, centers), (turned, centers @ R.T)):
        mesh = isoparametric(each, order)
        K.append(condense(mesh, *constants(mesh), places, kind).stiffness)
    assert np.abs(scaled(A @ K[0] @ A.T - K[1], K[1])).max() < 1e-10


@both_orders
def test_stiffness_in_millimetres_equals_that_in_metres(order):
    """The unit of the modulus is then N/mm^2, and K is in N mm/rad and N/mm."""
    mesh = isoparametric(box_solid((2, 2, 3), (0.05, 0.08, 0.2)), order)
    large = isoparametric(box_solid((2, 2, 3), (50.0, 80.0, 200.0)), order)
    tip = np.array([[0, 0, 0], [0.025, 0.04, 0.2]])
    small = condense(mesh, *constants(mesh), tip).stiffness
    lam, mu = (1e-6 * v for v in constants(large))
    in_mm = condense(large, lam, mu, 1000 * tip).stiffness
    ratio = np.diag(in_mm) / np.diag(small)
    np.testing.assert_allclose(ratio, [1e3] * 3 + [1e-3] * 3, rtol=1e-10)


@both_orders
def test_stiffness_at_another_tip_follows_from_a_screw_map(order):
    """On the same mesh, the stiffness at the second tip is A^T K A."""
    solid = box_solid((2, 2, 3), (0.05, 0.08, 0.2))
    near, there = np.array([0.02, 0.04, 0.2]), np.array([0.1, -0.2, 0.3])
    _, one = solved(solid, order, tip=near)
    _, other = solved(solid, order, tip=there)
    A = screw_map(there - near)
    expected = A.T @ one.stiffness @ A
    assert np.abs(scaled(other.stiffness - expected, expected)).max() < 1e-11


@pytest.mark.parametrize(
    ("order", "rings", "layers", "rel"), [(2, 3, 8, 5e-4), (3, 3, 6, 2e-6)]
)
def test_distributing_interfaces_reproduce_the_compliance_of_a_round_beam(
    order, rings, layers, rel
):
    """The tractions on the interface are linear, so there is no end effect in bending,
    tension and torsion. The error is due to the approximate circle and is proportional
    to h^4 for quadratic elements and to h^6 for cubic elements.
    """
    solid = bar_solid(rings, layers, 0.04, 0.2)
    _, solution = solved(solid, order, "distributing-both")
    C = inverted(solution.stiffness)
    beam = beam_compliance(0.2, round_section(0.04, NU), E, NU, axis=[0, 0, 1])
    for i in (0, 1, 2, 5):
        assert C[i, i] == pytest.approx(beam[i, i], rel=rel)
    assert C[0, 4] == pytest.approx(beam[0, 4], rel=rel)


@both_orders
def test_each_distributing_interface_lowers_the_stiffness(order):
    solid = bar_solid(2, 4, 0.04, 0.2)
    rigid, one, two = (solved(solid, order, kind)[1].stiffness for kind in KINDS)
    assert np.linalg.eigvalsh(scaled(rigid - one, rigid))[0] > -1e-9
    assert np.linalg.eigvalsh(scaled(one - two, rigid))[0] > -1e-9


def test_stiffness_with_a_distributing_tip_agrees_with_converged_value():
    """The converged bending stiffness of the IRSBot-2 link is 1 020 060 N m/rad. The
    error on this mesh is 5e-4."""
    _, solution = solved(bar_solid(2, 16, 0.04, 0.452), 3, "distributing")
    assert 0 < solution.stiffness[0, 0] / 1020060 - 1 < 1e-3


@pytest.mark.slow
def test_end_effect_is_inversely_proportional_to_length():
    """The slope of the end effect c r / L on a log-log scale is -1."""
    excess = []
    lengths = np.array([0.4, 0.8, 1.6])
    for length in lengths:
        count = int(8 * length / 0.4)
        _, solution = solved(bar_solid(2, count, 0.02, length), 3)
        beam = inverted(
            beam_compliance(length, round_section(0.02, NU), E, NU, axis=[0, 0, 1])
        )
        excess.append(solution.stiffness[0, 0] / beam[0, 0] - 1)
    slope = np.polyfit(np.log(lengths), np.log(excess), 1)[0]
    assert slope == pytest.approx(-1, abs=0.05)


@both_orders
def test_tension_and_bending_of_a_bar_are_exact_at_zero_poissons_ratio(order):
    """Without lateral contraction, there is no end effect, and K_TZ is E A / L."""
    mesh = isoparametric(box_solid((2, 2, 4), (0.03, 0.05, 0.2)), order)
    lam, mu = lame(E, 0.0)
    ones = np.ones(len(mesh.cells))
    centers = np.array([[0.015, 0.025, 0], [0.015, 0.025, 0.2]])
    K = condense(mesh, lam * ones, mu * ones, centers).stiffness
    assert K[5, 5] == pytest.approx(E * 0.03 * 0.05 / 0.2, rel=1e-11)
    # quadratic elements are exact in pure bending without lateral contraction
    C = inverted(K)
    beam = beam_compliance(
        0.2, rectangular_section(0.03, 0.05, 0.0), E, 0.0, axis=[0, 0, 1], up=[0, 1, 0]
    )
    assert C[0, 0] == pytest.approx(beam[0, 0], rel=1e-10)
    assert C[1, 1] == pytest.approx(beam[1, 1], rel=1e-10)


def harmonic_slope(x):
    """Return the second derivatives of the harmonic function exp(5 z) cos(3 x) cos(4
    y)."""
    ex, cx, cy = np.exp(5 * x[..., 2]), np.cos(3 * x[..., 0]), np.cos(4 * x[..., 1])
    sx, sy = np.sin(3 * x[..., 0]), np.sin(4 * x[..., 1])
    xy, xz, yz = 12 * ex * sx * sy, -15 * ex * sx * cy, -20 * ex * cx * sy
    p = ex * cx * cy
    rows = [[-9 * p, xy, xz], [xy, -16 * p, yz], [xz, yz, 25 * p]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@pytest.mark.parametrize(
    ("order", "counts"), [(2, (6, 12)), pytest.param(3, (4, 8), marks=pytest.mark.slow)]
)
def test_strain_energy_error_converges_with_the_order_of_the_elements(order, counts):
    """The exact displacement field is the gradient of a harmonic function, which is
    prescribed on the surface of a cube. In the energy norm, the error is proportional
    to h^2 for quadratic elements and to h^3 for cubic elements."""
    errors = []
    for n in counts:
        mesh = isoparametric(box_solid((n, n, n), (0.5, 0.5, 0.5)), order)
        x = mesh.nodes
        grown, px, py = np.exp(5 * x[:, 2]), 3 * x[:, 0], 4 * x[:, 1]
        exact = grown[:, None] * np.column_stack([
            -3 * np.sin(px) * np.cos(py),
            -4 * np.cos(px) * np.sin(py),
            5 * np.cos(px) * np.cos(py),
        ])
        inner = np.ones(len(x), dtype=bool)
        inner[np.unique(mesh.faces)] = False
        free = np.repeat(inner, 3)
        upper = assemble(mesh, *constants(mesh))
        u = np.where(free, 0.0, exact.ravel())
        force = upper @ u + upper.T @ u - upper.diagonal() * u
        u[free] = solve(upper[free][:, free], -force[free][:, None])[:, 0]
        error = 0.0
        for part, _, _, N, G, w in integration(mesh):
            nodes = mesh.cells[part]
            slope = np.einsum("tqax,tai->tqix", G, u.reshape(-1, 3)[nodes])
            gap = slope - harmonic_slope(np.einsum("qa,tax->tqx", N, x[nodes]))
            error += np.einsum("tq,tqix,tqix->", w, gap, gap)
        errors.append(np.sqrt(error))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)
