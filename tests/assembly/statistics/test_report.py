"""HTML reports on random draws and tolerances."""

import json
from pathlib import Path

import numpy as np
import pytest

from forcefit import place_robot
from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.error_distributions import read_sources
from forcefit.assembly.robots import load_robot
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.scenes import drawn_robot, margin_map, tightest_robot
from forcefit.assembly.statistics.tolerances import grid_postures, present_errors
from tests.pages_for_tests import parse
from tests.robots_for_tests import NUMBERS, irsbot2_with

ERRORS = Path(__file__).parents[3] / "examples" / "hexapod_errors.toml"


def shown(path):
    """Return a page, and the numbers in its tables by row."""
    seen = parse(path.read_text(encoding="utf-8"))
    rows = {row[0].text: row[1:] for table in seen.tables for row in table[1:]}
    assert seen.fetched == []
    return seen, rows


def test_draws_report_contains_the_numbers_of_the_summary(tmp_path, run):
    page, written = tmp_path / "s.html", tmp_path / "s.json"
    status, _, err = run(
        "assembly", "statistics", "hexapod", "--errors", ERRORS, "--draws", 100,
        "--limit", "translation=2.5e-4", "--importance", 16, "--report", page,
        "--json", written, "--clearance", "least", "--no-margins",
    )  # fmt: skip
    assert status == 0, err
    summary = json.loads(written.read_text())
    seen, rows = shown(page)
    assert seen.results == summary
    limits = summary["within_limits"]
    cells = rows["all limits satisfied"]
    assert [c.value for c in cells[:3]] == [
        limits[k] for k in ("probability", "lower", "upper")
    ]
    translation = summary["quantities"]["translation"]
    cells = rows["platform translation (clearance least)"]
    expected = [translation["mean"]["value"], translation["most_probable"]["value"]]
    expected += [translation["quantiles"][q]["value"] for q in ("0.5", "0.95", "0.99")]
    assert [c.value for c in cells] == expected
    charts = [figure for figure in seen.figures if "traces" in figure]
    counted = [figure["traces"][0] for figure in charts]
    bins = [one for one in counted if one["type"] == "bar" and "orientation" not in one]
    assert {sum(one["y"]) for one in bins} == {100}
    shares = summary["importance"]["quantities"]["translation"]["total_index"]
    largest = max(shares, key=lambda name: shares[name][0])
    assert "Governing errors" in page.read_text(encoding="utf-8")
    assert rows[largest][0].value == shares[largest][0]
    assert str(ERRORS.name) in " ".join(rows)  # the provenance contains the file name


def test_tolerance_report_lists_errors_by_contribution(tmp_path, run):
    write_robot(irsbot2_with(NUMBERS["cases"][0]), tmp_path / "robot.toml")
    page, written = tmp_path / "t.html", tmp_path / "t.json"
    status, _, err = run(
        "assembly", "tolerances", tmp_path / "robot.toml", "--grid", "tx=0.1,tz=-0.5",
        "--report", page, "--json", written,
    )  # fmt: skip
    assert status == 0, err
    present = json.loads(written.read_text())["present"]
    seen, rows = shown(page)
    first = present["slopes"][0]
    assert rows[first["error"]][1].value == first["share_of_margin"]
    assert seen.numbers[0].value == present["largest_margin"]


def test_report_scene_has_the_platform_displacement_of_its_draw():
    """The draw closest to the 95 % quantile is solved separately for comparison."""
    posture = place_robot(load_robot("hexapod"))
    experiment = Experiment(
        posture, read_sources(ERRORS, posture.robot), seed=3, clearance="least"
    )
    data = run_draws(experiment, 40)
    (scene,) = parse(drawn_robot(experiment, data)).figures
    sizes = data["translation"].values
    draw = int(np.argmin(np.abs(sizes - np.quantile(sizes, 0.95))))
    platform = posture.robot.index(posture.robot.platform)
    moved = np.array(scene["bodies"][platform]["moved"][-1])
    assert np.linalg.norm(moved) == pytest.approx(sizes[draw], rel=1e-6)
    assert moved == pytest.approx(data["platform_screw"].values[draw, 3:], rel=1e-6)


def test_tolerance_report_contains_margin_map_and_robot_scene():
    robot = irsbot2_with(NUMBERS["cases"][0])
    postures, _ = grid_postures(robot, "tx=-0.1:0.1:0.1,tz=-0.5:-0.4:0.1")
    present = present_errors(postures)
    (drawn,) = parse(margin_map(postures, present)).figures
    values = np.array(drawn["layers"][0]["values"])
    for posture, margin in zip(postures, present["margins"], strict=True):
        i, j = (drawn["axes"][a]["values"] for a in "xy")
        pose = posture.pose()
        there = values[np.argmin(np.abs(np.array(i) - pose["tx"])),
                       np.argmin(np.abs(np.array(j) - pose["tz"]))]  # fmt: skip
        assert there == margin
    assert np.max(values) == present["largest_margin"]
    (scene,) = parse(tightest_robot(postures, present)).figures
    assert {one["name"] for one in scene["bodies"]} == {f.name for f in robot.frames}
