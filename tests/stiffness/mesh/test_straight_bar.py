"""Tests of meshes of straight bars."""

import numpy as np
import pytest

from forcefit.stiffness.beam.sections import declared_section
from forcefit.stiffness.fem.fea import Budget, FemOptions, solve_bar
from forcefit.stiffness.fem.material import Material
from forcefit.stiffness.mesh.curved_elements import curved_elements
from forcefit.stiffness.mesh.straight_bar import straight_bar
from forcefit.stiffness.surface.surface import directed_edges

ROUND = {"radius": 0.1}
THIN = {"radius": 0.03, "inner_radius": 0.024}
SECTIONS = [
    ROUND,
    {"radius": 0.5},
    THIN,
    {"width": 0.1, "height": 0.3},
    {"width": 0.1, "height": 0.2, "wall": 0.01},
    {"width": 0.1, "height": 0.2, "web": 0.01, "flange": 0.02},
]


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: "-".join(section))
def test_straight_bar_mesh_is_closed_and_has_exact_volume_and_ends(section):
    """The reference has chords in place of arcs."""
    solid = straight_bar(section)
    area = declared_section(section, 0.3).area
    assert (solid.volumes() > 0.0).all()
    volume = solid.volumes().sum()
    assert volume == pytest.approx(area, rel=0.15 if "radius" in section else 1e-12)
    edges = {tuple(edge) for edge in directed_edges(solid.faces)}
    assert edges == {(b, a) for a, b in edges}
    corners = solid.points[solid.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    for patch, sign in ((0, -1), (1, 1)):
        total = across[solid.patch == patch].sum(axis=0)
        np.testing.assert_allclose(total, [0, 0, sign * volume], atol=1e-12)
    for k, shape in enumerate(solid.shapes):
        if shape is not None:
            on = corners[solid.patch == k].reshape(-1, 3)
            np.testing.assert_allclose(shape.signed(on)[0], 0.0, atol=1e-12)


@pytest.mark.parametrize("section", [ROUND, {"radius": 0.5}], ids=["slim", "stout"])
def test_no_element_of_a_round_bar_is_inverted(section):
    assert not curved_elements(straight_bar(section), 3).inverted.any()


@pytest.mark.parametrize(
    "section", [ROUND, {"radius": 0.3}, pytest.param(THIN, marks=pytest.mark.slow)]
)
def test_torsion_of_round_bars_and_tubes_equals_the_textbook_value(section):
    """The stiffness is G J / L, because round sections do not warp."""
    options = FemOptions(0.01, budget=Budget(unknowns=60_000))
    link = solve_bar(section, Material(1.0, 0.3), options).link
    J = declared_section(section, 0.3).J
    assert link.mesh["reached"]
    assert link.stiffness[2, 2] == pytest.approx(J / 2.6, rel=2e-3)
    assert link.stiffness[2, 2] / (J / 2.6) - 1 < link.relative_error_estimate
    # clamped ends cannot contract, so K exceeds E A / L by at most 10 %
    assert 1.0 < link.stiffness[5, 5] / declared_section(section, 0.3).area < 1.1


def test_bending_stiffness_of_a_square_bar_is_equal_about_both_axes():
    """On a finer mesh, K is less by at most the estimated error."""
    coarse, fine = (
        solve_bar(
            {"width": 0.2, "height": 0.2}, Material(1.0, 0.3),
            FemOptions(accuracy, budget=Budget(unknowns=60_000)),
        ).link
        for accuracy in (0.02, 0.002)
    )  # fmt: skip
    K = fine.stiffness
    assert K[0, 0] == pytest.approx(K[1, 1], rel=1e-3)
    assert K[0, 4] == pytest.approx(-K[1, 3], rel=1e-3)
    size = np.sqrt(np.outer(np.diag(K), np.diag(K)))
    off = np.abs((coarse.stiffness - K) / size).max()
    assert off < coarse.relative_error_estimate
