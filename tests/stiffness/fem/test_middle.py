"""Tests of the midpoint between the bounds on the stiffness."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forcefit.stiffness.fem.adaptive_step import middle_stiffness
from forcefit.stiffness.fem.fea import Budget, FemOptions, solve_bar
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.stress import stress_influence
from forcefit.stiffness.fem.two_ends import two_ends
from forcefit.stiffness.link import scaled

NONE = np.zeros((6, 6))


def random_definite(seed, size=1.0):
    """Return a random positive definite matrix with mixed units, (6, 6)."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 9)) * np.repeat([30.0, 4000.0], 3)[:, None]
    return size * root @ root.T


@given(st.integers(0, 10**6), st.floats(1e-6, 30.0))
def test_estimated_error_covers_the_interval_of_the_stiffness(seed, size):
    """The interval is from K_h - E to K_h, also if E is larger than K_h."""
    K_h, E = random_definite(seed), random_definite(seed + 1, size)
    middle, told = middle_stiffness(K_h, E, NONE)
    for share in (0.0, 0.3, 1.0):
        gap = np.abs(K_h - share * E - middle)
        assert (gap <= np.abs(told) * (1 + 1e-9) + 1e-12 * np.abs(K_h).max()).all()


def test_midpoint_stiffness_does_not_depend_on_units():
    """Lengths in metres and in millimetres are compared."""
    units = np.outer(np.repeat([1.0, 1e3], 3), np.repeat([1.0, 1e3], 3))
    for size in (1e-3, 10.0):
        K, E, g = random_definite(6), random_definite(7, size), random_definite(8, 0.1)
        for one, other in zip(
            middle_stiffness(K, E, g),
            middle_stiffness(units * K, units * E, units * g),
            strict=True,
        ):
            np.testing.assert_allclose(units * one, other, rtol=1e-9)


@pytest.fixture(scope="module")
def bar():
    """Return a square bar on its first mesh."""
    options = FemOptions(1e-3, budget=Budget(levels=1))
    return solve_bar({"width": 0.25, "height": 0.25}, Material(2.0, 0.3), options)


def test_link_stiffness_is_mesh_stiffness_minus_estimated_error(bar):
    """The stiffness of the mesh is the upper bound."""
    K_h, K = bar.level.solution.stiffness, bar.link.stiffness
    above = np.diag(scaled(K_h - K, K))
    assert (above > 0).all()
    told = np.diag(bar.link.relative_errors)
    # a bar with plane sides has no geometry error
    np.testing.assert_allclose(above, told, rtol=1e-6)


def test_stresses_and_condensed_ends_use_the_stiffness_of_the_mesh(bar):
    """Stresses must balance the wrench on the mesh."""
    held = two_ends(bar).stiffness[6:, 6:]
    np.testing.assert_allclose(held, bar.level.solution.stiffness, rtol=1e-9)
    softer = replace(bar, link=replace(bar.link, compliance=2 * bar.link.compliance))
    one, other = (stress_influence(b).influence for b in (bar, softer))
    np.testing.assert_array_equal(one, other)
    # the mean stress is the force divided by the area, apart from nodal errors
    assert one[:, 5, 2].mean() * 0.25**2 == pytest.approx(1.0, abs=5e-3)
