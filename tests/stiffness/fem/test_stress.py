"""Tests of the stresses in meshed links."""

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.fem.stress import peak_stress, stress_influence
from forcefit.stiffness.report.plot import plot_stress
from forcefit.stiffness.report.results import stress_results, stress_text
from tests.solids_for_tests import bar_solid
from tests.stiffness.fem.test_stress_error import AREA, SECOND, L, R, meshed


@pytest.fixture(scope="module")
def solved():
    return meshed(bar_solid(2, 20, R, L), [0.0, 0.0, L])


def test_stress_of_a_bar_in_tension_is_axial_only(solved):
    """The components are compared, because the von Mises stress does not depend on
    pressure.
    """
    stress = stress_influence(solved, away=4 * R).stresses([0, 0, 0, 0, 0, 1e3])
    np.testing.assert_allclose(stress[:, 2], 1e3 / AREA, rtol=3e-3)
    assert np.abs(stress[:, :2]).max() < 1e-3 * 1e3 / AREA


def test_stress_region_is_reported_and_excludes_the_clamped_edges(solved):
    stress = stress_influence(solved)
    assert stress.away == pytest.approx(R, rel=1e-6)
    assert stress.places[:, 2].min() >= R * (1 - 1e-9)
    assert stress.places[:, 2].max() <= (L - R) * (1 + 1e-9)
    assert "at least 0.04 m away" in stress.region
    words = (
        "stress: found no node at a distance of 1 m from the interfaces; the largest"
    )
    with pytest.raises(BadInput, match=f"^{words} distance is 0.2 m"):
        stress_influence(solved, away=1.0)


def test_peak_stress_by_beam_theory_is_reported(solved):
    """The largest moment is F (L - away) in the evaluated region, and F L in the whole
    beam. The mesh error is 2 %.
    """
    load = [0, 0, 0, 1e3, 0, 0]
    peak = peak_stress(solved, load, section={"radius": R})
    assert peak.away == pytest.approx(R, rel=1e-6)
    assert peak.beam_whole == pytest.approx(1e3 * L * R / SECOND, rel=1e-6)
    stress, place = peak.beam
    assert stress == pytest.approx(1e3 * (L - R) * R / SECOND, rel=1e-6)
    assert np.abs(place) == pytest.approx([R, 0, R], abs=1e-6)
    assert peak.von_mises == pytest.approx(stress, rel=0.02)
    assert np.linalg.norm(peak.place[:2]) == pytest.approx(R, rel=1e-6)


def test_beam_stress_is_computed_in_the_axes_of_the_link(solved):
    """The loads are torsion about the z axis of the link and pure bending."""
    twist = peak_stress(solved, [0, 0, 50, 0, 0, 0], section={"radius": R})
    expected = np.sqrt(3) * 50 * R / (2 * SECOND)
    assert twist.beam[0] == pytest.approx(expected, rel=1e-9)
    assert twist.von_mises == pytest.approx(expected, rel=0.02)
    plate = {"width": 0.02, "height": 0.05}
    bent = [peak_stress(solved, m, section=plate, up=[0, 1, 0]) for m in
            ([50, 0, 0, 0, 0, 0], [0, 50, 0, 0, 0, 0])]  # fmt: skip
    # up is y, so a moment about x bends the section about its y axis
    assert bent[0].beam[0] == pytest.approx(50 * 6 / (0.02 * 0.05**2), rel=1e-9)
    assert bent[1].beam[0] == pytest.approx(50 * 6 / (0.05 * 0.02**2), rel=1e-9)


def test_stress_report_and_figure_show_region_and_beam_stress(solved):
    peak = peak_stress(solved, [0, 0, 0, 1e3, 0, 0], section={"radius": R})
    text = stress_text(peak)
    assert "at least 0.04 m away from both interfaces" in text
    assert "beam, whole length: 7.958 MPa" in text  # 400 N m / 5.027e-5 m^3
    results = stress_results(peak)
    assert results["beam"]["von_mises_whole_length"] == peak.beam_whole
    everywhere = stress_influence(solved, away=0.0)
    assert len(everywhere.places) == len(solved.level.mesh.nodes)
    ends = solved.link.base, solved.link.tip
    axes = plot_stress(everywhere, peak, *ends, {"radius": R}).axes[0]
    line = axes.get_lines()[-1]
    assert line.get_ydata()[0] * 1e6 == pytest.approx(peak.beam_whole)
    assert line.get_ydata()[-1] < line.get_ydata()[0]
