"""Tests of quadrature rules."""

from math import factorial, prod

import numpy as np
import pytest

from forcefit.stiffness.mesh.lagrange import lattice
from forcefit.stiffness.mesh.quadrature import quadrature

CORNERS = (3, 4)


@pytest.mark.parametrize("corners", CORNERS)
@pytest.mark.parametrize("degree", range(1, 7))
def test_quadrature_rules_are_positive_and_integrate_monomials_exactly(degree, corners):
    """In d dimensions, the mean of the product of L_c^p_c is d! product(p_c!) / (d +
    sum p_c)!. Tabulated values have 14 digits."""
    L, weights = quadrature(degree, corners)
    assert (weights > 0).all()
    assert (L >= 0).all()
    np.testing.assert_allclose(L.sum(axis=1), 1, rtol=1e-14)
    for power in lattice(degree, corners):
        exact = prod(factorial(p) for p in power) / factorial(corners - 1 + degree)
        integral = weights @ (L**power).prod(axis=1)
        assert integral == pytest.approx(exact, rel=2e-13)


@pytest.mark.parametrize("corners", CORNERS)
def test_degree_without_a_quadrature_rule_is_rejected(corners):
    with pytest.raises(ValueError, match="degree: found 7, expected at most 6"):
        quadrature(7, corners)
