"""Tests of the report pages of cross-checks."""

import json

import pytest

from forcefit.page.page import Provenance
from forcefit.validation.crosscheck.report import failure_page, poses_page
from tests.pages_for_tests import parse, tiles

pytestmark = pytest.mark.exudyn
PLACE = ("irsbot2", "--pose", "tx=0.1,tz=-0.45", "--scale", "1,0.5")


def shown(run, folder, *words):
    """Return exit status, page and JSON results of a cross-check."""
    page, written = folder / "page.html", folder / "page.json"
    status, _, err = run(
        "validation", "crosscheck", *words, "--report", page, "--json", written
    )
    assert page.exists(), err
    return status, page.read_text(encoding="utf-8"), json.loads(written.read_text())


def test_page_shows_the_displacements_of_both_models(run, tmp_path):
    status, text, results = shown(run, tmp_path, *PLACE, "--load", "fz=-100")
    assert status == 0
    assert "<p class='verdict good'>" in text
    seen = parse(text)
    rows = seen.table("component", "virtual joints")[1:]
    assert [row[0].text for row in rows] == ["RX", "RY", "RZ", "TX", "TY", "TZ"]
    first = results["scales"][0]
    for column, model in ((1, "vjm"), (2, "multibody")):
        assert [row[column].value for row in rows] == first[model]["platform_screw"]
    # the force and the virtual-joint displacement are along -z
    assert rows[5][1].value < 0 > rows[5][2].value
    slope = tiles(text)["Slope of the difference"][0]
    assert float(slope) == pytest.approx(2.0, abs=0.1)
    assert seen.results == results


def test_page_of_a_stiffness_check_shows_equal_compliances(run, tmp_path):
    """Without errors and loads, the exact and the linear model coincide."""
    status, text, _ = shown(run, tmp_path, "four_bar", "--state", "exact")
    assert status == 0
    assert "<p class='verdict good'>" in text
    for row in parse(text).table("component", "exact", "linear")[1:]:
        exact, *others = (cell.value for cell in row[1:])
        assert others == pytest.approx([exact] * 3, rel=1e-5)


def pose(passed, verdict, status="ok"):
    """Return the result of a cross-check at a pose."""
    return {"asked": {"tx": 0.1}, "passed": passed, "verdict": verdict, "slope": 2.0,
            "status": status}  # fmt: skip


@pytest.mark.parametrize(("rows", "kind"), [
    ([pose(True, "passed")] * 2, "good"),
    ([pose(True, "passed"), pose(False, "not decided")], "mixed"),
    ([pose(True, "passed"), pose(False, "failed")], "bad"),
    ([pose(None, "", "out of reach")], "bad"),
])  # fmt: skip
def test_colour_of_a_page_of_poses_shows_the_worst_outcome(rows, kind):
    text = poses_page("a robot", rows, Provenance())
    assert f"<p class='verdict {kind}'>" in text
    assert len(parse(text).table("tx [mm]")) == 1 + len(rows)


def test_page_of_a_failed_simulation_shows_the_reason():
    failure = {"robot": "r", "status": "simulation failed", "reason": "no equilibrium"}
    text = failure_page(failure, Provenance())
    assert "<p class='verdict bad'>" in text
    assert "There is no result: no equilibrium." in text
