"""Tests of the error indicator of the stiffness."""

from functools import cache

import numpy as np
import pytest

from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import round_section
from forcefit.stiffness.fem.adaptive_step import estimated_error, solve_level
from forcefit.stiffness.fem.condensation import condense, rigid_motions
from forcefit.stiffness.fem.elements import integration, isoparametric
from forcefit.stiffness.fem.error_indicator import error_matrices, geometry_errors
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.link import inverted, scaled
from forcefit.stiffness.surface.primitives import Cone
from tests.solids_for_tests import Z, bar_solid, box_solid, constants, with_plane_sides

E, NU = 60e9, 0.3
R, L = 0.04, 0.452
BENDING = 1032277.0  # [N m/rad] converged bending stiffness of the IRSBot-2 link
TORSION = E / (2 + 2 * NU) * np.pi / 2 * R**4 / L


@cache
def bar(rings, layers):
    """Return the IRSBot-2 link on a uniform mesh."""
    centers = np.array([[0, 0, 0], [0, 0, L]])
    solid = bar_solid(rings, layers, R, L)
    return solve_level(solid, [Material(E, NU)], centers, "rigid")


def volume(mesh):
    return sum(chunk.w.sum() for chunk in integration(mesh))


def test_estimated_error_is_zero_for_rigid_motions_and_constant_strains():
    """The mesh includes curved elements."""
    mesh, K = bar(1, 6).mesh, bar(1, 6).solution.stiffness
    lam, mu = constants(mesh)
    singular = np.ones(len(mesh.cells), dtype=bool)
    still = rigid_motions(mesh.nodes, np.zeros(3))
    none = error_matrices(mesh, still, lam, mu, singular, K).sum(axis=0)
    assert np.abs(scaled(none, K)).max() < 1e-15
    slopes = np.random.default_rng(3).normal(size=(3, 3, 6))
    stretched = np.einsum("nx,xik->nik", mesh.nodes, slopes)
    energy = E * volume(mesh) * np.eye(6)
    none = error_matrices(mesh, stretched, lam, mu, singular, energy).sum(axis=0)
    assert np.abs(none).max() < 1e-15 * energy.max()


def shifted(excess, kind="distributing-both"):
    """Return the compliance of a bar, and its geometry errors for a larger radius."""
    solid = bar_solid(2, 5, R, 0.25)
    mesh = isoparametric(solid)
    lam, mu = constants(mesh)
    solution = condense(mesh, lam, mu, np.array([[0, 0, 0], [0, 0, 0.25]]), kind)
    side = Cone(np.zeros(3), Z, R * (1 + excess))
    shapes = (*solid.shapes[:2], side)
    each = geometry_errors(mesh, shapes, solution.fields, lam, mu)
    return inverted(solution.stiffness), each


@pytest.mark.parametrize("excess", [1e-3, -1e-3])
def test_geometry_error_of_a_bar_equals_derivative_by_radius(excess):
    """The area is proportional to R^2, and I and J are proportional to R^4. The
    relative error of K is therefore 4 times the relative error of R in bending and
    torsion, and twice this error in tension.
    """
    C, each = shifted(excess)
    softer = C @ each.sum(axis=0) @ C
    power = np.array([4, 4, 4, 2])
    i = [0, 1, 2, 5]
    estimate = np.diag(softer)[i] / np.diag(C)[i]
    np.testing.assert_allclose(estimate, -power * excess, rtol=0.01)
    one, other = (
        beam_compliance(0.25, round_section(r, NU), E, NU, axis=[0, 0, 1])
        for r in (R, R * (1 + excess))
    )
    exact = np.diag(one - other)[i] / np.diag(one)[i]
    np.testing.assert_allclose(-estimate, exact, rtol=0.02)


@pytest.mark.parametrize(
    "mesh", [(1, 6), (1, 12), (2, 12), pytest.param((2, 24), marks=pytest.mark.slow)]
)
def test_estimated_error_on_one_mesh_covers_the_true_error(mesh):
    """The converged bending stiffness is 1 032 277 N m/rad. The estimate is at most
    five times the true error."""
    K, indicated, shape = bar(*mesh).totals()
    error, _ = estimated_error([(K, indicated, shape)])
    true = K[0, 0] / BENDING - 1
    told = np.diag(error + np.abs(shape)) / np.diag(K)
    # subtract the error due to the smaller volume of the mesh
    without = true - shape[0, 0] / BENDING
    assert without > 0
    assert without < told[0] < 5 * without
    assert abs(K[2, 2] / TORSION - 1) < told[2]


PLATE = (0.060, 0.002, 0.100)  # [m] width, thickness and length
# stiffness in torsion by another program, see
# benchmarks/evidence/stiffness_random_references.py
PLATE_RZ = 50.96  # N m/rad


def plate(*counts):
    """Return the plate on a uniform mesh with one element across the thickness."""
    width, thickness, length = PLATE
    solid = with_plane_sides(box_solid(counts, np.array(PLATE)))
    middle = np.array([width / 2, thickness / 2, 0])
    centers = np.array([middle, middle + [0, 0, length]])
    return solve_level(solid, [Material(E, NU)], centers, "rigid").totals()


def test_estimated_error_of_a_twisted_thin_plate_covers_the_true_error():
    """The elements are much wider than the boundary layer at the free edges."""
    history = [plate(4, 1, 8), plate(8, 1, 16)]
    for count in (1, 2):
        for meshes in (history[:count], history[count - 1 : count]):
            K = meshes[-1][0]
            told = np.diag(estimated_error(meshes)[0]) / np.diag(K)
            true = K[2, 2] / PLATE_RZ - 1
            assert 0.006 < true < told[2] < 6 * true
