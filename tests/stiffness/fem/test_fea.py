"""Tests of the stiffness of links from their surfaces."""

from pathlib import Path

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.fem.fea import (
    Budget,
    FemOptions,
    mesh_link,
    solve_bar,
    solve_link,
)
from forcefit.stiffness.fem.mass_properties import PointMass
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.link import scaled
from forcefit.stiffness.mesh.cut_face import CutFace
from forcefit.stiffness.mesh.fit_to_patches import MeshFailed
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.primitives import Plane
from forcefit.stiffness.surface.surface import check_surface
from tests.solids_for_tests import cylinder

E, NU = 60e9, 0.3


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("meshes")


def bar_surface(facets=48):
    return check_surface(*cylinder(0.04, 0.452, facets), "bar")


PLANES = (parse_interface("z=0"), parse_interface("z=0.452"))


@pytest.mark.slow
def test_stiffness_of_the_irsbot2_link_agrees_within_its_estimated_error(cache):
    """The converged bending stiffness is 1 032 277 N m/rad, and the torsional stiffness
    is G J / L. The stiffness on the mesh is an upper bound.
    """
    solution = solve_link(
        bar_surface(),
        *PLANES,
        [Material(E, NU, 2700.0)],
        point_masses=[PointMass(1.0, np.array([0, 0, 0.452]))],
        options=FemOptions(cache=cache),
    )
    link = solution.link
    assert link.mesh["reached"]
    true = abs(link.stiffness[0, 0] / 1032277 - 1)
    assert true < link.relative_error_estimate <= 0.005
    own = solution.level.solution.stiffness[0, 0] / 1032277 - 1
    assert 0 < own < 2 * link.relative_error_estimate < 10 * own
    assert link.stiffness[2, 2] == pytest.approx(205304.8977, rel=1e-6)
    np.testing.assert_allclose(link.tip, [0, 0, 0.452], atol=1e-12)
    # mass of the exact cylinder and a point mass of 1 kg; the error of cubic elements
    # is 2.5e-7
    body = 2700 * np.pi * 0.04**2 * 0.452
    assert link.mass - 1 == pytest.approx(body, rel=1e-6)
    center = (body * 0.226 + 0.452) / (body + 1)
    np.testing.assert_allclose(link.center_of_mass, [0, 0, center], atol=1e-7)
    spin = body * 0.04**2 / 2
    assert link.inertia[2, 2] == pytest.approx(spin, rel=2e-6)
    across = body * (0.04**2 / 4 + 0.452**2 / 12 + (0.226 - center) ** 2)
    across += (0.452 - center) ** 2
    assert link.inertia[0, 0] == pytest.approx(across, rel=2e-6)


@pytest.mark.slow
def test_bar_of_two_materials_has_the_stiffness_of_springs_in_series(cache):
    """The end effect is less than 2 %."""
    middle = CutFace(Plane(np.array([0, 0, 0.226]), np.array([0, 0, 1.0])))
    half = Material(2 * E, NU, where=lambda p: p[:, 2] > 0.226, faces=(middle,))
    options = FemOptions(cache=cache, budget=Budget(levels=2))
    one, two = (
        solve_link(bar_surface(), *PLANES, m, options=options).link
        for m in ([Material(E, NU)], [Material(E, NU), half])
    )
    assert two.stiffness[5, 5] / one.stiffness[5, 5] == pytest.approx(4 / 3, rel=0.02)


@pytest.mark.parametrize(("change", "message"), [
    ({"interface": "rigit"}, '"rigid"?'),
    ({"accuracy": 0.0}, "accuracy = 0 must lie between"),
    ({"materials": []}, "at least one"),
])  # fmt: skip
def test_wrong_options_are_rejected(change, message, cache):
    given = {"materials": [Material(E, NU)], "cache": cache} | change
    materials = given.pop("materials")
    with pytest.raises(BadInput) as caught:
        solve_link(bar_surface(), *PLANES, materials, options=FemOptions(**given))
    assert message in str(caught.value)


def test_mesh_is_refined_up_to_the_budget_of_unknowns():
    """The requested accuracy cannot be reached within the budget."""
    section, material = {"width": 0.3, "height": 0.3}, Material(E, NU)
    first = solve_bar(section, material, FemOptions(1e-3, budget=Budget(levels=1))).link
    budget = Budget(unknowns=2 * first.mesh["unknowns"])
    finer = solve_bar(section, material, FemOptions(1e-3, budget=budget)).link
    assert first.mesh["unknowns"] < finer.mesh["unknowns"] <= budget.unknowns
    assert finer.mesh["meshes"] > 1
    assert not finer.mesh["reached"]
    # the difference between two meshes is at most the sum of both estimated errors
    gap = np.abs(scaled(first.stiffness - finer.stiffness, finer.stiffness)).max()
    both = first.relative_error_estimate + finer.relative_error_estimate
    assert 0 < gap <= 1.01 * both


@pytest.mark.parametrize("budget", [Budget(unknowns=99), Budget(seconds=1e-9)])
def test_first_mesh_that_exceeds_the_budget_is_rejected(budget):
    words = (
        r"the coarsest mesh of the part has \d+ unknowns\. The solution needs about "
    )
    with pytest.raises(MeshFailed, match=f"{words}.* s and .*increase the time limit"):
        solve_bar({"radius": 0.1}, Material(E, NU), FemOptions(budget=budget))


def test_invalid_description_of_an_interface_is_rejected():
    surface = Path(__file__).parents[3] / "meshes/tapered_arm.stl"
    with pytest.raises(BadInput, match="base: found 'q=0', expected"):
        mesh_link(surface, "q=0", "z=0.35", E=7e10, nu=0.33)
