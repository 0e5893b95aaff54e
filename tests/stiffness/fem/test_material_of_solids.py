"""Tests of the materials of solids in a STEP file."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.fem.elements import integration
from forcefit.stiffness.fem.fea import FemOptions, solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.material_of_solids import placed_materials
from forcefit.stiffness.fem.part_text import parse_part, scaled_part
from forcefit.stiffness.fem.stress import stress_influence, von_mises
from forcefit.stiffness.link import inverted
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import check_surface
from tests.solids_for_tests import bar_of_two_boxes, cylinder, rod_in_tube

ALUMINIUM, STEEL = 7e10, 2.1e11
NEAR, FAR, WIDTH, HEIGHT = 0.1, 0.2, 0.02, 0.03
INNER, OUTER, LENGTH = 0.013, 0.015, 0.1


def solved(surface, length, materials, accuracy=0.01):
    ends = parse_interface("z=0"), parse_interface(f"z={length}")
    return solve_link(surface, *ends, materials, options=FemOptions(accuracy))


@pytest.fixture(scope="module")
def bar():
    """Return two prisms in series with zero Poisson's ratio."""
    surface = bar_of_two_boxes(WIDTH, HEIGHT, NEAR, FAR)
    materials = [Material(ALUMINIUM, 0, 2700, solid="near"),
                 Material(STEEL, 0, 7800, solid="far")]  # fmt: skip
    return solved(surface, NEAR + FAR, materials, 0.005)


@pytest.fixture(scope="module")
def rod():
    """Return a steel rod in a tube with a third of its modulus."""
    materials = [Material(ALUMINIUM, 0, 1600), Material(STEEL, 0, 7800, solid="rod")]
    return solved(rod_in_tube(INNER, OUTER, LENGTH), LENGTH, materials)


def test_compliance_of_prisms_in_series_agrees_with_unit_load_method(bar):
    """The compliances L / E A, L / E I and 6 / 5 L / G A of both prisms add up."""
    A = WIDTH * HEIGHT
    C = inverted(bar.level.solution.stiffness)
    flexible = lambda I: (FAR / STEEL + NEAR / ALUMINIUM) / I  # noqa: E731
    assert C[5, 5] == pytest.approx(flexible(A), rel=1e-6)
    for turn, shift, I in (
        (0, 4, WIDTH * HEIGHT**3 / 12),
        (1, 3, HEIGHT * WIDTH**3 / 12),
    ):
        lever = (FAR**2 / STEEL + ((FAR + NEAR) ** 2 - FAR**2) / ALUMINIUM) / 2 / I
        sag = (FAR**3 / STEEL + ((FAR + NEAR) ** 3 - FAR**3) / ALUMINIUM) / 3 / I
        sag += 6 / 5 * 2 * flexible(A)
        assert C[turn, turn] == pytest.approx(flexible(I), rel=1e-3)
        assert abs(C[turn, shift]) == pytest.approx(lever, rel=1e-3)
        assert C[shift, shift] == pytest.approx(sag, rel=2e-3)


def test_mass_and_centre_include_both_solids(bar):
    near, far = 2700 * NEAR * WIDTH * HEIGHT, 7800 * FAR * WIDTH * HEIGHT
    center = (near * NEAR / 2 + far * (NEAR + FAR / 2)) / (near + far)
    assert bar.link.mass == pytest.approx(near + far, rel=1e-9)
    assert bar.link.center_of_mass[2] == pytest.approx(center, rel=1e-9)


@pytest.mark.slow
def test_stiffness_of_a_rod_in_a_tube_is_the_sum_of_both_stiffnesses(rod):
    """This applies to torsion and tension."""
    K = rod.level.solution.stiffness
    areas = np.pi * np.array([INNER**2, OUTER**2 - INNER**2])
    J = np.pi / 2 * np.array([INNER**4, OUTER**4 - INNER**4])
    E = np.array([STEEL, ALUMINIUM])
    assert K[5, 5] == pytest.approx(E @ areas / LENGTH, rel=2e-5)
    assert K[2, 2] == pytest.approx(E / 2 @ J / LENGTH, rel=2e-5)


@pytest.mark.slow
def test_mesh_follows_the_curved_face_between_two_solids(rod):
    """The volumes of both cylinders are exact."""
    stiff = rod.level.material[:, 2] == 7800
    volume = sum(w[stiff[part]].sum() for part, *_, w in integration(rod.level.mesh))
    assert volume == pytest.approx(np.pi * INNER**2 * LENGTH, rel=2e-5)


@pytest.mark.slow
def test_stress_at_the_face_between_two_solids_is_proportional_to_modulus(rod):
    """The strain is the same in both materials."""
    area = np.pi * np.array([INNER**2, OUTER**2 - INNER**2])
    strain = 1000 / (np.array([STEEL, ALUMINIUM]) @ area)
    stresses = von_mises(stress_influence(rod, 0.02).stresses([0, 0, 0, 0, 0, 1000]))
    soft = stresses < 1.5 * ALUMINIUM * strain
    np.testing.assert_allclose(stresses[soft], ALUMINIUM * strain, rtol=1e-3)
    np.testing.assert_allclose(stresses[~soft], STEEL * strain, rtol=1e-3)


@pytest.mark.parametrize(("given", "message"), [
    (["rod"], 'solid "tube" has no material; expected a material of this solid'),
    (["", "rood"], r'no solid "rood"; did you mean "rod"\?'),
    (["", "rod+tub"], r'no solid "tub"; did you mean "tube"\?'),
])  # fmt: skip
def test_unknown_solid_or_solid_without_material_is_rejected(given, message):
    surface = rod_in_tube(INNER, OUTER, LENGTH)
    with pytest.raises(BadInput, match=message):
        placed_materials(surface, [Material(STEEL, 0.3, solid=name) for name in given])


def test_solids_that_overlap_are_rejected():
    surface = rod_in_tube(INNER, OUTER, LENGTH)
    solids = replace(surface.solids, overlaps=("solids a and b have 1 m^3 in common",))
    with pytest.raises(BadInput, match="a and b have 1 m.3 in common; expected solids"):
        placed_materials(
            replace(surface, solids=solids),
            [Material(STEEL, 0.3), Material(STEEL, 0.3, solid="rod")],
        )


def test_material_of_a_solid_is_rejected_for_a_surface_without_solids():
    surface = check_surface(*cylinder(), "part.stl")
    with pytest.raises(BadInput, match=r'part.stl: found a material of solid "rod"'):
        placed_materials(surface, [Material(STEEL, 0.3, solid="rod")])


def test_part_option_with_several_solids_is_parsed():
    part = parse_part("--part", "solid=end/a+end b/young=2e11,poisson=0.3,density=7800")
    assert (part.solid, part.E, part.density) == ("end/a+end b", 2e11, 7800)
    twice = parse_part("--part", scaled_part("solid=a/young=2e11,poisson=0.3", 2.0))
    assert (twice.solid, twice.E, twice.nu) == ("a", 4e11, 0.3)
