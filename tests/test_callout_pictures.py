"""Pictures of tolerance callouts in the documentation."""

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.evidence.callout_pictures import PICTURES, outline
from forcefit.assembly.callouts.zones_of_features import (
    axis_position,
    round_plane_position,
)

DOCS = Path(__file__).parents[1] / "docs"


def test_page_shows_the_picture_of_each_callout():
    page = (DOCS / "drawing_tolerances.md").read_text()
    shown = re.findall(r"pictures/callouts/(\w+)\.svg", page)
    assert shown == list(PICTURES)
    assert {p.stem for p in (DOCS / "pictures" / "callouts").iterdir()} == set(shown)


def test_bore_position_zone_is_a_diamond():
    """A 20 mm bore with a position tolerance of 0.05 mm: |TX| + L/2 |RY| = 25 um."""
    points = outline(axis_position(50e-6, 0.020), 3, 1)  # um, mrad
    assert abs(points[:, 0]) + 10 * abs(points[:, 1]) == pytest.approx(25, rel=1e-6)


def test_round_face_zone_is_a_circle():
    points = outline(round_plane_position(50e-6, 0.040), 0, 1)
    assert np.linalg.norm(points, axis=1) == pytest.approx(1.25, rel=1e-6)
