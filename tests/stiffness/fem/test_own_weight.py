"""Tests of the stress in a meshed link under its own weight."""

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.fem.fea import FemOptions, solve_bar
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.own_weight import with_own_weight
from forcefit.stiffness.fem.stress import peak_stress, stress_influence

SIDE, DENSITY, G = 0.02, 7850.0, 9.81
SECTION = {"width": SIDE, "height": SIDE}


@pytest.fixture(scope="module", params=["rigid", "distributing"])
def bar(request):
    """Return a square bar of 20 x 20 x 1000 mm along z."""
    options = FemOptions(0.02, request.param)
    return solve_bar(SECTION, Material(2e11, 0.3, DENSITY), options)


def test_bending_stress_of_a_heavy_cantilever_equals_beam_theory(bar):
    """The bending moment is rho g A (L - z)^2 / 2."""
    field = stress_influence(with_own_weight(bar), 0.1)
    stress = field.stresses(np.r_[np.zeros(6), 0.0, -G, 0.0])[:, 2]
    x, y, z = field.places.T
    moment = DENSITY * G * SIDE**2 * (1 - z) ** 2 / 2
    expected = 12 * moment * y / SIDE**4
    largest = np.abs(expected).max()
    np.testing.assert_allclose(stress, expected, atol=5e-3 * largest)


def test_peak_stress_under_own_weight_agrees_with_the_beam(bar):
    """The largest stress in the whole beam is 6 rho g A L^2 / 2 / h^3."""
    peak = peak_stress(bar, np.zeros(6), section=SECTION, up=[0, 1, 0], away=0.05,
                       gravity=[0, -G, 0])  # fmt: skip
    whole = 3 * DENSITY * G / SIDE
    assert peak.beam_whole == pytest.approx(whole, rel=1e-9)
    assert peak.beam[0] == pytest.approx(whole * 0.95**2, rel=1e-9)
    assert 0.05 <= peak.place[2] < 0.06  # nearest node beyond the excluded distance
    there = whole * (1 - peak.place[2]) ** 2
    assert peak.von_mises == pytest.approx(there, rel=3e-3)
    assert peak.error < 1e-2 * there


def test_weight_along_the_bar_causes_a_linear_axial_stress(bar):
    """The stress is rho g (L - z)."""
    field = stress_influence(with_own_weight(bar), 0.1)
    stress = field.stresses(np.r_[np.zeros(6), 0.0, 0.0, G])[:, 2]
    expected = DENSITY * G * (1 - field.places[:, 2])
    np.testing.assert_allclose(stress, expected, atol=2e-3 * DENSITY * G)


def test_gravity_on_a_link_without_a_density_is_rejected():
    light = solve_bar({"radius": 0.2}, Material(2e11, 0.3), FemOptions(0.3))
    with pytest.raises(BadInput, match="gravity: the link has no density"):
        with_own_weight(light)
