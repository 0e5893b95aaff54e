"""Tests of the estimated error of peak stresses."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.stiffness.fem.adaptive_step import solve_level
from forcefit.stiffness.fem.fea import FemOptions, MeshedLink, solve_link
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.fem.stress import peak_stress
from forcefit.stiffness.fem.stress_error import estimated_error
from forcefit.stiffness.link import LinkStiffness, inverted
from forcefit.stiffness.report.results import stress_results, stress_text
from forcefit.stiffness.surface.interface import parse_interface
from forcefit.stiffness.surface.surface import check_surface
from tests.solids_for_tests import (
    bar_solid,
    masked_solid,
    shouldered_shaft,
    with_plane_sides,
)

R, L = 0.04, 0.4
AREA, SECOND = np.pi * R**2, np.pi / 4 * R**4
STEEL = [Material(2.1e11, 0.3)]


def meshed(solid, tip):
    """Return the solution of a solid with the base at z = 0."""
    centers = np.array([[*tip[:2], 0.0], tip])
    level = solve_level(solid, STEEL, centers, "rigid")
    link = LinkStiffness("test", inverted(level.solution.stiffness),
                         tip=centers[1], base=centers[0])  # fmt: skip
    return MeshedLink(link, level, centers)


@pytest.fixture(scope="module", params=[(1, 6), (2, 20)], ids=["coarse", "fine"])
def bar(request):
    return meshed(bar_solid(*request.param, R, L), [0.0, 0.0, L])


@pytest.mark.parametrize(("wrench", "expected"), [
    ([0, 0, 0, 0, 0, 1e3], 1e3 / AREA),
    ([1e3, 0, 0, 0, 0, 0], 1e3 * R / SECOND),
    ([0, 0, 1e3, 0, 0, 0], np.sqrt(3) * 1e3 * R / (2 * SECOND)),
])  # fmt: skip
def test_stress_of_a_bar_agrees_within_the_estimated_error(bar, wrench, expected):
    """The stress is compared with F / A, M R / I and T R / J at a distance of four
    radii from the ends.  The mesh error of the fine mesh is 0.3 %.
    """
    peak = peak_stress(bar, wrench, away=4 * R)
    if len(bar.level.mesh.cells) > 1000:
        assert peak.von_mises == pytest.approx(expected, rel=3e-3)
    assert abs(peak.von_mises - expected) <= peak.error + 1e-3 * expected
    assert peak.error < 0.25 * expected
    assert "inner edges" not in peak.region
    assert f"{peak.error / 1e6:.2g} MPa" in stress_text(peak)
    assert stress_results(peak)["error"] == peak.error


def test_estimated_stress_error_of_a_uniform_strain_is_zero(rng):
    """Linear displacements result in a uniform stress."""

    def everything(x):
        return np.full(len(x), True)

    solid = with_plane_sides(masked_solid((2, 2, 4), (0.1, 0.1, 0.4), everything))
    level = meshed(solid, [0.05, 0.05, 0.4]).level
    strain = rng.normal(size=(6, 3, 3))
    linear = np.einsum("kij,nj->nik", strain, level.mesh.nodes)
    uniform = replace(level, solution=replace(level.solution, fields=linear))
    everywhere = np.ones(len(level.mesh.nodes), dtype=bool)
    pull, scale = np.eye(6)[2], 2.1e11 * np.abs(strain).max()
    assert estimated_error(uniform, pull, 7, everywhere, ~everywhere) < 1e-9 * scale
    assert estimated_error(level, pull, 7, everywhere, ~everywhere) > 1e-3 * scale


def test_peak_at_a_sharp_inner_edge_has_no_error_estimate():
    """The exact stress at a re-entrant edge is infinite."""

    def keep(x):
        return (x[:, 0] < 0.05) | (np.abs(x[:, 2] - 0.2) > 0.1)

    solid = with_plane_sides(masked_solid((2, 2, 4), (0.1, 0.1, 0.4), keep))
    peak = peak_stress(meshed(solid, [0.05, 0.05, 0.4]), [0, 0, 0, 0, 0, 1], away=0.05)
    assert np.isinf(peak.error)
    assert "inner edges without a fillet" in peak.region
    assert "none, because the peak is on an inner edge" in stress_text(peak)
    assert stress_results(peak)["error"] is None


@pytest.mark.slow
def test_peak_stress_of_a_stepped_shaft_agrees_within_the_estimated_error():
    """The diameters are 30 and 20 mm, and the fillet radius is 2 mm. The loads are
    tension, torsion and bending. The expected values were computed by another program
    with axisymmetric elements and are accurate to 0.3 %.
    """
    points, triangles = shouldered_shaft(0.015, 0.010, 0.002, 48, 8)
    surface = check_surface(points, triangles, "shaft")
    ends = map(parse_interface, ("z=0", "z=0.12"))
    solved = solve_link(surface, *ends, STEEL, options=FemOptions(0.02))
    expected = {5: 6103.3, 2: 1.5213e6, 1: 2.0826e6}
    for component, stress in expected.items():
        peak = peak_stress(solved, np.eye(6)[component], away=0.015)
        assert abs(peak.von_mises - stress) <= peak.error + 3e-3 * stress
        assert abs(peak.von_mises - stress) <= 0.08 * stress
        assert "inner edges" not in peak.region
        assert np.hypot(*peak.place[:2]) < 0.0105
