"""Tests of the two estimates in the error indicator."""

import numpy as np
import pytest
from scipy.optimize import brentq

from forcefit.stiffness.fem.elements import isoparametric, lame
from forcefit.stiffness.fem.error_indicator import error_matrices, traction_errors
from forcefit.stiffness.mesh.quadrature import quadrature
from tests.solids_for_tests import box_solid, constants

E = 60e9
LAM, MU = lame(E, 0.3)


def split_energies(mesh, stress):
    """Return the energies of the quadratic and the linear part of a stress zz for a
    unit modulus.
    """
    places, weights = quadrature(6)
    quadratic, linear = [], []
    for corners in mesh.nodes[mesh.cells[:, :4]]:
        root = np.sqrt(weights * abs(np.linalg.det(corners[1:] - corners[0])))
        values = root * stress(places @ corners[:, 2])
        A = root[:, None] * places
        best = A @ np.linalg.lstsq(A, values)[0]
        mean = root * (root @ best) / (root @ root)
        quadratic.append((values - best) @ (values - best))
        linear.append((best - mean) @ (best - mean))
    return np.array(quadratic), np.array(linear)


def share_of_the_rest(ratio):
    """Return e_3 / s_3, at most three, for errors proportional to p^-b."""
    smallest, largest = 0.1, 40.0

    def fall(b):
        return (2**-b - 3**-b) / (1 - 2**-b) - ratio

    if fall(smallest) < 0:
        return 3.0
    b = brentq(fall, smallest, largest)
    return min(3**-b / (2**-b - 3**-b), 3.0)


# for -3.75, the stress in some elements has no linear part
@pytest.mark.parametrize("bend", [0.01, 0.3, 1.0, 2.0, 5.0, 100.0, -3.75, -3.5])
@pytest.mark.parametrize("stiffness", [E, 7.0])
def test_estimated_error_follows_from_the_ratio_of_energies(bend, stiffness):
    """The displacement is z^2 / 2 + c z^3 / 3, so the stress is z + c z^2."""
    mesh = isoparametric(box_solid((1, 1, 3), (0.5, 0.6, 0.8)))
    field = np.zeros((len(mesh.nodes), 3, 1))
    z = mesh.nodes[:, 2]
    field[:, 2, 0] = z**2 / 2 + bend * z**3 / 3
    s_3, s_2 = (
        (LAM + 2 * MU) * s for s in split_energies(mesh, lambda z: z + bend * z**2)
    )
    expected = s_3 * [share_of_the_rest(r) for r in s_3 / s_2]
    nowhere = np.zeros(len(mesh.cells), dtype=bool)
    scale = np.array([[stiffness]])
    estimate = error_matrices(mesh, field, *constants(mesh), nowhere, scale)
    # the tolerance accounts for interpolation between the 400 exponents of the table
    np.testing.assert_allclose(estimate[:, 0, 0], expected, rtol=5e-3, atol=1e-9 * E)
    edge = error_matrices(mesh, field, *constants(mesh), ~nowhere, scale)
    np.testing.assert_allclose(edge[:, 0, 0], 1.2 * s_3, rtol=1e-6)


SIZES = [(0.3, 0.4, 0.5), (0.3, 0.4, 0.01), (0.02, 0.4, 0.5), (30.0, 0.4, 50.0)]


def heights(size):
    """Return the smallest heights of faces normal to x, y or z in a box of six
    tetrahedra: the height of a right triangle or the depth of the box.
    """
    found = []
    for axis in range(3):
        p, q = np.delete(size, axis)
        found.append(min(p * q / np.hypot(p, q), size[axis]))
    return np.array(found)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("order", [2, 3])
def test_traction_errors_of_a_constant_stress_equal_hand_calculation(rng, size, order):
    """The energy of a face is t^2 / (2 mu) times its area times its height, divided by
    pi.
    """
    mesh = isoparametric(box_solid((1, 1, 1), np.array(size)), order)
    A = rng.normal(size=(3, 3, 2))
    fields = np.einsum("nx,ixk->nik", mesh.nodes, A)
    strain = (A + A.swapaxes(0, 1)) / 2
    stress = 2 * MU * strain + LAM * np.einsum("iik->k", A) * np.eye(3)[:, :, None]
    axis = np.ptp(mesh.nodes[mesh.faces[:, :3]], axis=1).argmin(axis=1)
    area = np.prod(size) / np.array(size)[axis] / 2
    depth = heights(size)[axis] / np.pi
    t = stress[:, axis]  # traction, (3, f, k)
    expected = np.einsum("f,ifk,ifl->fkl", area * depth / (2 * MU), t, t)
    some = rng.permutation(len(mesh.faces))[:7]
    found = traction_errors(mesh, fields, *constants(mesh), some)
    np.testing.assert_allclose(found, expected[some], rtol=1e-9)
