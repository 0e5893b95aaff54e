"""Tests of the HTML report on a link."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.page.page import Provenance
from forcefit.stiffness.beam.beam import beam_compliance
from forcefit.stiffness.beam.sections import round_section
from forcefit.stiffness.link import LinkStiffness
from forcefit.stiffness.report.link_page import link_page
from tests.pages_for_tests import parse, tiles

LENGTH, RADIUS, YOUNG = 0.4, 0.02, 70e9
MESH = {
    "elements": 10, "unknowns": 100, "meshes": 1, "accuracy": 0.01, "reached": True,
    "closed": True, "repairs": [], "volume": 5e-4, "solver": "SciPy",
}  # fmt: skip


def bar(**mesh):
    """Return a round bar along x with the attributes of a finite element result."""
    return LinkStiffness(
        "finite elements",
        beam_compliance(LENGTH, round_section(RADIUS, 0.3), YOUNG, 0.3),
        np.array([LENGTH, 0, 0]), np.zeros(3), mesh=MESH | mesh,
    )  # fmt: skip


def test_page_of_a_bar_shows_its_stiffness_and_compliance():
    """The tensile stiffness is E A / L. The torsional stiffness is E / 2.6 J / L for nu
    = 0.3.
    """
    text = link_page(bar(), Provenance())
    area, polar = np.pi * RADIUS**2, np.pi * RADIUS**4 / 2
    K, C = (
        {row[0].text: [cell.value for cell in row[1:]] for row in table[1:]}
        for table in parse(text).tables[:2]
    )
    assert K["FX"] == pytest.approx([0, 0, 0, YOUNG * area / LENGTH, 0, 0])
    assert K["MX"] == pytest.approx([YOUNG / 2.6 * polar / LENGTH, 0, 0, 0, 0, 0])
    assert C["TX"] == pytest.approx([0, 0, 0, LENGTH / (YOUNG * area), 0, 0])
    least = tiles(text)["Least rotational stiffness, RX"][0]
    assert least == f"{YOUNG / 2.6 * polar / LENGTH * 1e-3:.4g} N m/mrad"


@pytest.mark.parametrize(("mesh", "kind"), [
    ({}, "good"),
    ({"repairs": ["2 facets"]}, "mixed"),
    ({"closed": False}, "mixed"),
    ({"flat_elements": 3}, "mixed"),
    ({"reached": False, "closed": False}, "bad"),
])  # fmt: skip
def test_verdict_is_amber_for_doubts_and_red_for_insufficient_accuracy(mesh, kind):
    text = link_page(bar(**mesh), Provenance())
    assert f"<p class='verdict {kind}'>" in text
    assert ("Doubts about the surface" in text) == bool(set(mesh) - {"reached"})


def test_page_shows_the_estimated_error_of_each_entry():
    link = bar()
    error = np.zeros((6, 6))
    error[3, 3] = 2e-3 * link.stiffness[3, 3]
    text = link_page(replace(link, stiffness_error=error), Provenance())
    (spec,) = parse(text).figures
    assert spec["traces"][0]["z"][3][3] == pytest.approx(0.2)  # per cent
    assert tiles(text)["Estimated error"][0] == "0.2\xa0%"
