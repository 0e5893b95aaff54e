"""Tests of the comparison of beams with finite elements."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.curve import curve_compliance, curve_length
from forcefit.stiffness.beam.curve_file import read_curve
from forcefit.stiffness.beam.sections import rectangular_section, round_section
from forcefit.stiffness.link import LinkStiffness
from forcefit.stiffness.report.compare import compare_link
from forcefit.stiffness.report.results import comparison_results
from forcefit.stiffness.report.slenderness import fit_end_effect, sweep_slenderness

MATERIAL = ["--young", "6e10", "--poisson", "0.3"]


def made_up(ratio, c, d, error=0.0):
    """Return the comparison of a bar with a bar that is stiffer by 1 + c / ratio + d /
    ratio^2."""
    length = 0.02 * ratio
    C = beam_compliance(length, round_section(0.02, 0.3), 6e10, 0.3)
    ends = {"tip": [length, 0, 0], "base": [0, 0, 0]}
    beam = LinkStiffness("beam", C, **ends)
    factor = 1 + c / ratio + d / ratio**2
    fea = LinkStiffness(
        "fea", C / factor, **ends, stiffness_error=error * beam.stiffness
    )
    return compare_link(beam, fea, size=0.02)


def diagonal_residual(sweep):
    """Return the diagonal of the residual."""
    return np.abs(np.diagonal(sweep.residual, axis1=1, axis2=2)).max()


def test_end_effect_fit_recovers_the_simulated_coefficients():
    sweep = fit_end_effect([made_up(r, 0.2, 0.7) for r in (5, 10, 20, 40)])
    np.testing.assert_allclose(np.diag(sweep.end_effect), 0.2, rtol=1e-9)
    np.testing.assert_allclose(np.diag(sweep.second), 0.7, rtol=1e-9)
    assert diagonal_residual(sweep) < 1e-12
    assert "c = 0.200 0.200 0.200 (rotations)" in sweep.explanation


def test_wrong_modulus_causes_a_large_residual_of_the_fit():
    """A modulus that is 1 % too high has the same effect at all lengths."""
    comparisons = []
    for ratio in (5, 10, 20, 40):
        one = made_up(ratio, 0.2, 0.0)
        C = one.fea.compliance / 1.01
        fea = LinkStiffness("fea", C, tip=one.fea.tip, base=one.fea.base)
        comparisons.append(compare_link(one.beam, fea, size=0.02))
    sweep = fit_end_effect(comparisons)
    assert 0.004 < diagonal_residual(sweep) < 0.01
    clean = fit_end_effect([made_up(r, 0.2, 0.0) for r in (5, 10, 20, 40)])
    assert diagonal_residual(clean) < 1e-12


def test_end_effect_error_follows_from_the_errors_of_the_meshes():
    """The error of K is 0.1 % at both lengths. For two lengths, c is 2 y20 20 - y10
    10."""
    sweep = fit_end_effect([made_up(r, 0.2, 0.7, error=1e-3) for r in (10, 20)])
    expected = 1e-3 * (40 / (1 + 0.01 + 0.7 / 400) + 10 / (1 + 0.02 + 0.7 / 100))
    assert np.diag(sweep.end_effect_error) == pytest.approx(expected, rel=1e-9)


# K / K_beam - 1 of RX, TX and TZ for each L / r and nu = 0.3, computed with an error of
# 1e-6 by benchmarks/evidence/stiffness_round_references.py
ENDS = {
    6: (0.025438, 0.030358, 0.017318),
    12: (0.015261, 0.018274, 0.008585),
    24: (0.008103, 0.009709, 0.004274),
}


@pytest.mark.slow
def test_end_effect_of_a_round_bar_agrees_with_an_independent_solution():
    """The fit to the independent solution results in c = 0.212, 0.254, 0.102, and zero
    in torsion.
    """
    sweep = sweep_slenderness({"radius": 0.02}, 6e10, 0.3, list(ENDS), accuracy=0.004)
    for comparison, exact in zip(sweep.comparisons, ENDS.values(), strict=True):
        comparisons = np.diag(comparison.difference)
        gap = comparisons[[0, 3, 5]] - exact
        assert (gap > -1e-5).all()
        assert (gap <= np.diag(comparison.fea.relative_errors)[[0, 3, 5]]).all()
        assert 0 < comparisons[2] + 1e-5 < 0.004
    c, error = np.diag(sweep.end_effect), np.diag(sweep.end_effect_error)
    assert (np.abs(c - [0.212, 0.212, 0, 0.254, 0.254, 0.102]) <= error).all()
    assert np.abs(sweep.residual).max() < 0.004


@pytest.mark.slow
def test_axial_stiffness_at_zero_poissons_ratio_has_no_end_effect():
    """The exact stiffness is E V / L^2, where V is the volume of the mesh. The relative
    volume error of 16 parabolas around a circle is 5e-5."""
    sweep = sweep_slenderness({"radius": 0.02}, 6e10, 0.0, [6, 12], accuracy=0.01)
    for comparison in sweep.comparisons:
        length, volume = comparison.length, comparison.fea.mesh["volume"]
        expected = 6e10 * volume / length**2
        assert comparison.fea.stiffness[5, 5] == pytest.approx(expected, rel=1e-7)
        assert volume == pytest.approx(np.pi * 0.02**2 * length, rel=5e-5)


@pytest.mark.parametrize(("options", "message"), [
    (["--radius", "0.02", "--ratios", "5"], "found one length"),
    (["--radius", "0.02", "--ratios", "5,x"], "--ratios: found '5,x'"),
    (["--radius", "0.02", "--ratios", "5,5"], "5 is given twice"),
    (["--radius", "0.02", "--ratios", "0,5"], "--ratios: found 0"),
    (["--section", "width=1,height=1,web=.1,flange=.1"], "found a section of"),
    (["--section", "radius=1,rdius=2"], 'unknown "rdius"; did you mean "radius"'),
    (["--section", "radius=1", "--radius", "1"], "found together with --radius"),
    (["--section", "width=1"], "--section: found width, expected one of"),
])  # fmt: skip
def test_slenderness_command_rejects_wrong_options(rejected, options, message):
    command = ["stiffness", "compare", "--ratios", "5,10", *MATERIAL]
    assert message in rejected(*command, *options)


def test_comparison_with_a_different_tip_is_rejected():
    C = beam_compliance(0.4, round_section(0.02, 0.3), 6e10, 0.3)
    one = LinkStiffness("beam", C, tip=[0.4, 0, 0], base=[0, 0, 0])
    other = LinkStiffness("fea", C, tip=[0.41, 0, 0], base=[0, 0, 0])
    with pytest.raises(BadInput, match="the tip interface of the surface is at"):
        compare_link(one, other, 0.02)


# --- curves from files ---------------------------------------------------------------

L_BRACKET = """
[[piece]]
end = [0, 0, 0.2]
section = { width = 0.04, height = 0.05 }
up = [0, 1, 0]
[[piece]]
end = [0.15, 0, 0.2]
up = [0, 1, 0]
"""


def curve_file(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "curve.toml"
    path.write_text(content)
    return path


def test_compliance_of_an_l_shape_from_a_curve_file_equals_hand_calculation(
    run, tmp_path
):
    """A force along y at the tip bends both legs and twists the first leg."""
    path = curve_file(tmp_path, L_BRACKET)
    command = ["stiffness", "beam", path, *MATERIAL, "--theory", "euler"]
    C = np.array(json.loads(run(*command, "--json", "-")[1])["compliance"])
    pieces = read_curve(path, 0.3)
    assert curve_length(pieces) == pytest.approx(0.35, rel=1e-12)
    np.testing.assert_allclose(
        C, curve_compliance(pieces, 6e10, 0.3, theory="euler"), rtol=1e-12, atol=1e-20
    )
    s = rectangular_section(0.04, 0.05, 0.3)
    E, G, a, b = 6e10, 6e10 / 2.6, 0.2, 0.15
    expected = (a**3 + b**3) / (3 * E * s.I_y) + a * b**2 / (G * s.J)
    assert C[4, 4] == pytest.approx(expected, rel=1e-9)


def test_compliance_from_a_curve_file_equals_closed_forms(tmp_path):
    """The axial compliance of a cone is L / (E pi r1 r2)."""
    cone = """
[[piece]]
end = [0.3, 0, 0]
section = { radius = 0.02 }
tip_section = { radius = 0.01 }
"""
    C = curve_compliance(read_curve(curve_file(tmp_path, cone), 0.3), 6e10, 0.3)
    assert C[3, 3] == pytest.approx(0.3 / (6e10 * np.pi * 0.02 * 0.01), rel=1e-9)
    arc = """
[[piece]]
start = [0.1, 0, 0]
center = [0, 0, 0]
turn = [0, 0, 1.5707963267948966]
section = { width = 0.01, height = 0.02, wall = 0.001 }
"""
    (piece,) = read_curve(curve_file(tmp_path, arc), 0.3)
    np.testing.assert_allclose(piece.place(1.0), [0, 0.1, 0], atol=1e-15)
    assert curve_length([piece]) == pytest.approx(np.pi * 0.05, rel=1e-12)


@pytest.mark.parametrize(("change", "message"), [
    (("[[piece]]", "[[pieces]]"), 'unknown key "pieces"; did you'),
    (("section =", "sektion ="), "piece[1].section: missing"),
    (("width", "widht"), 'piece[1].section: unknown "widht"; did you mean'),
    (("height = 0.05", "height = -1"), "piece[1]: rectangular_section: height"),
    (("end = [0, 0, 0.2]", "end = [0, 0, 0]"), "piece[1]: piece: vector from start"),
    (("end = [0, 0, 0.2]", "end = [0, 0]"), "piece[1].end: found"),
    (("up = [0, 1, 0]", "upp = [0, 1, 0]"), 'unknown key "upp"'),
    (("up = [0, 1, 0]", "tip_section = { radius = 0.1 }"),
     "found different dimensions at the two ends"),
])  # fmt: skip
def test_wrong_curve_file_is_rejected_with_its_path(tmp_path, change, message):
    path = curve_file(tmp_path, L_BRACKET.replace(*change, 1))
    with pytest.raises(BadInput) as caught:
        read_curve(path, 0.3)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_compare_rejects_a_curve_file_together_with_a_section(rejected, tmp_path):
    path = curve_file(tmp_path, L_BRACKET)
    command = ["stiffness", "compare", "x.stl", "--base", "z=0", "--tip", "x=0.15"]
    err = rejected(*command, *MATERIAL, "--curve", path, "--radius", "0.1")
    assert "--curve: found together with cross section options" in err


def rectangle(width, height, up, stiffer=1.0, axis=(0, 0, 1)):
    """Return a rectangular bar of 0.3 m by beam theory."""
    section = rectangular_section(width, height, 0.3)
    C = beam_compliance(0.3, section, 6e10, 0.3, axis=axis, up=up)
    tip = 0.3 * np.array(axis)
    return LinkStiffness("beam", C / stiffer, tip=tip, base=np.zeros(3))


@pytest.mark.parametrize("axis", [(0, 0, 1), (0.6, 0, 0.8)])
def test_comparison_reports_a_section_rotated_by_90_degrees(axis):
    """The second moments of area of the bar differ by a factor of nine."""
    solid = rectangle(0.06, 0.02, [0, 1, 0], 1.02, axis)
    right = compare_link(rectangle(0.06, 0.02, [0, 1, 0], axis=axis), solid, 0.03)
    assert right.better_turn == (0, pytest.approx(0.02))
    assert "Rigid faces" in right.explanation
    across = np.cross(axis, [0, 1, 0])
    for beam in (
        rectangle(0.02, 0.06, [0, 1, 0], axis=axis),
        rectangle(0.06, 0.02, across, axis=axis),
    ):
        turned = compare_link(beam, solid, 0.03)
        assert turned.better_turn == (90, pytest.approx(0.02))
        assert np.abs(turned.difference).max() > 5
        words = "seem to be exchanged. After a rotation by 90 degrees about"
        assert words in turned.explanation
        assert "Rigid faces" not in turned.explanation
        assert comparison_results(turned)["axes_turned"] == 90


def test_comparison_reports_no_rotation_if_differences_are_within_the_mesh_error():
    solid = rectangle(0.0200, 0.0202, [0, 1, 0])
    unsure = replace(solid, stiffness_error=0.02 * solid.stiffness)
    beam = rectangle(0.0202, 0.0200, [0, 1, 0])
    assert compare_link(beam, unsure, 0.01).better_turn[0] == 0
    assert compare_link(beam, solid, 0.01).better_turn[0] == 90


def test_comparison_reports_the_corner_of_a_bent_beam():
    """The corner of an L-shaped beam is not an end effect."""
    one = made_up(20, 0.2, 0.0)
    assert "corner" not in one.explanation
    bent = compare_link(one.beam, one.fea, 0.02, length=1.5 * one.length)
    assert "corner of a solid is stiffer" in bent.explanation
    assert bent.slenderness == pytest.approx(30)
