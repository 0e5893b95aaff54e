"""HTML reports, JSON and data sets of random draws and tolerances."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit import load_robot, place_robot, write_robot
from forcefit.assembly.model.error_distributions import read_sources
from forcefit.assembly.statistics.allocated_tolerances import (
    Allocation,
    allocation_of,
    allocation_text,
)
from forcefit.assembly.statistics.clearance_positions import CLEARANCE_MODELS
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.scenes import drawn_robot, margin_map, tightest_robot
from forcefit.assembly.statistics.tolerances import grid_postures, present_errors
from forcefit.assembly.statistics.tolerances_report import tolerances_page
from forcefit.page.page import Provenance
from tests.pages_for_tests import parse, tiles
from tests.robots_for_tests import NUMBERS, coaxial_beams, irsbot2_with
from tests.tolerances_for_tests import arm, plan_for

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


NAN = float("nan")
RADIAL, LIMIT = 1e-4, 3e-4
PLAN = """
yield = 1.0
limits = { translation = 3e-4 }
tolerance = [{ name = "length", frames = ["tip"], components = ["TX"] }]
"""


def advice(tolerances, costs, most=(0.1, 0.1), cost="reciprocal"):
    """Return the advice of the report on two classes of errors, an angle and a
    length.
    """
    plan = plan_for(coaxial_beams(np.zeros(6)), [("two", 1), ("two", 3)], costs,
                    {"energy": 2.0}, cost=cost)  # fmt: skip
    plan = replace(plan, names=("angle", "length"), most=np.array(most))
    t = np.array(tolerances)
    found = Allocation(plan=plan, tolerances=t, price=plan.price(t), uniformly_scaled=t,
                       price_uniformly_scaled=1.0, price_bound=NAN, cuts=1)  # fmt: skip
    results = {"robot": "two bars", "postures": 3, "grid": "tx=0:2:1",
               "allocation": allocation_of(found)}  # fmt: skip
    page = tolerances_page(json.loads(json.dumps(results)), Provenance())
    return tiles(page)["Tolerance to tighten"]


@pytest.mark.parametrize("loosest", [1e-2, 0.1, 10.0])
def test_advice_on_tightening_does_not_depend_on_inactive_bounds(loosest):
    """The costs are 1 / 1e-3 and 1 / 1e-4, so the share of the length is 10/11."""
    answer, note = advice([1e-3, 1e-4], [1.0, 1.0], (loosest, 0.1))
    assert (answer, note[:4]) == ("length", "91\u00a0%")


def test_advice_for_logarithmic_costs_depends_on_cost_coefficients():
    """The saving does not depend on the tolerances."""
    answer, note = advice([1e-3, 1e-4], [3.0, 1.0], cost="logarithm")
    assert (answer, note[:4]) == ("angle", "75\u00a0%")
    both, _ = advice([1e-3, 1e-4], [1.0, 1.0], cost="logarithm")
    assert both == "angle, length"


def test_advice_omits_tolerances_at_their_upper_bound():
    """The angle has the higher cost, but its tolerance is at the upper bound."""
    assert advice([1e-5, 1e-4], [1.0, 1.0], (1e-5, 0.1))[0] == "length"
    assert advice([1e-5, 1e-4], [1.0, 1.0], (1e-5, 1e-4))[0] == "nothing"


def test_report_contains_limits_and_effect_of_clearances(tmp_path, run):
    """For a pin with radial clearance r, the tolerance of a length is t = limit - r.

    Without the clearance, t would be the limit, which is larger by the factor 1.5.
    """
    write_robot(arm(radial=RADIAL), tmp_path / "arm.toml")
    (tmp_path / "plan.toml").write_text(PLAN)
    page, written = tmp_path / "t.html", tmp_path / "t.json"
    status, text, err = run(
        "assembly", "tolerances", tmp_path / "arm.toml", "--grid", "tx=0.4", "--plan",
        tmp_path / "plan.toml", "--draws", 50, "--report", page, "--json", written,
    )  # fmt: skip
    assert status == 0, err
    allocation = json.loads(written.read_text())["allocation"]
    taken = allocation["perfect_parts"]["translation"]
    assert taken["reached"] == pytest.approx(RADIAL, rel=1e-3)
    assert taken["looser_without"] == pytest.approx(1.5, rel=1e-3)
    assert taken["price_without"] == pytest.approx(1.0 / LIMIT, rel=2e-3)
    assert "clearances alone cause 0.1 mm of the limit of 0.3 mm on translation" in text
    content = page.read_text("utf-8")
    assert tiles(content)["Used by clearances"][0] == "33\u00a0%"
    asked = {row[0].text: row[1] for row in parse(content).table("requirement")[1:]}
    assert asked["platform translation, at most"].value == LIMIT
    assert asked["errors"].text == "uniform within plus or minus their tolerance"
    assert asked["price"].text == "sum of cost / tolerance [rad or m]"
    assert asked["postures"].text == "1: tx=0.4"
    assert asked["clearances"].text.startswith("clearance worst: largest pose errors")
    assert asked["yield"].text == "1: every robot within tolerance"


def test_report_contains_no_advice_if_all_postures_assemble():
    """The largest margin is 0.5."""
    present = {
        "postures": 2, "assemblable_share": 1.0, "factor_on_errors": 2.0,
        "largest_margin": 0.5, "at": {"tx": 0.0}, "slopes": [],
    }  # fmt: skip
    results = {"robot": "bars", "postures": 2, "grid": "tx=0:1:1"}
    tight = present | {"factor_on_errors": 0.5, "assemblable_share": 0.0}
    for shares, advised in ((present, "nothing"), (tight, "all errors times 0.5")):
        page = tolerances_page(results | {"present": shares}, Provenance())
        assert tiles(page)["Tolerance to tighten"][0] == advised


CHECK = {
    "draws": 500, "verdict": "shown", "look": 2, "most_looks": 4, "confidence": 0.95,
    "confidence_of_a_look": 0.9875,
    "yield": {"probability": 0.99, "lower": 0.976, "upper": 0.9967, "undecided": 0},
}  # fmt: skip


def allocation(**values):
    """Return an allocation for two classes: angles of a bar and lengths of two bars."""
    plan = plan_for(
        coaxial_beams(np.zeros(6)), [("two", 1), ("one", 3), ("two", 3)], [1] * 3,
        {"energy": 2.0}, asked_yield=0.9,
    )  # fmt: skip
    plan = replace(
        plan, group=np.array([1, 0, 0]), names=("length", "angle"),
        costs=np.array([3.0, 5.0]), most=np.array([1e-2, 0.1]),
    )  # fmt: skip
    options = {name: values.pop(name) for name in list(values) if hasattr(plan, name)}
    found = Allocation(
        plan=replace(plan, **options), tolerances=np.array([1.25e-3, 0.0999]),
        price=20.0, uniformly_scaled=np.array([1e-3, 0.08]),
        price_uniformly_scaled=25.0, price_bound=NAN, cuts=7,
    )  # fmt: skip
    return replace(found, **values)


def test_tolerance_class_has_the_unit_of_its_first_error():
    first, second = allocation_of(allocation())["tolerances"]
    assert first == {
        "name": "length", "tolerance": 1.25e-3, "unit": "m", "scaled_alike": 1e-3,
        "cost": 3.0, "loosest_allowed": 1e-2, "at_loosest": False,
        "share": pytest.approx(3.0 / 1.25e-3 / (3.0 / 1.25e-3 + 5.0 / 0.0999)),
    }  # fmt: skip
    assert (second["name"], second["unit"], second["cost"]) == ("angle", "rad", 5.0)
    for tolerance, loosest in ((0.0999 + 1e-6, True), (0.0999 - 1e-6, False)):
        some = allocation(tolerances=np.array([1e-3, tolerance]))
        assert allocation_of(some)["tolerances"][1]["at_loosest"] == loosest


def test_clearance_model_is_reported_only_for_pose_error_limits():
    for limits, play in (({"rotation": 1e-3}, "worst"), ({"energy": 1.0}, None)):
        plain = allocation_of(allocation(limits=limits))
        assert plain["clearance"] == play
        said = f"pose errors: clearance worst: {CLEARANCE_MODELS['worst']}"
        assert (said in allocation_text(plain).splitlines()) == (play is not None)
        attributes = allocation(limits=limits).to_xarray().attrs
        assert attributes["clearance"] == (play or "")


def test_allocation_data_set_contains_tolerances_and_provenance():
    found = allocation(verification=CHECK, seed=7)
    data = found.to_xarray()
    assert list(data["class"].values) == ["length", "angle"]
    assert list(data["unit"].values) == ["m", "rad"]
    np.testing.assert_array_equal(data["tolerance"], found.tolerances)
    np.testing.assert_array_equal(data["scaled_alike"], found.uniformly_scaled)
    np.testing.assert_array_equal(data["loosest_allowed"], [1e-2, 0.1])
    np.testing.assert_array_equal(data["cost"], [3.0, 5.0])
    table = found.to_pandas()
    assert list(table.index) == ["length", "angle"]
    np.testing.assert_array_equal(table["tolerance", ""], found.tolerances)
    attributes = data.attrs
    assert (attributes["seed"], attributes["yield"]) == (7, 0.9)
    assert (attributes["price"], attributes["price_alike"]) == (20.0, 25.0)
    assert attributes["limit.energy"] == 2.0
    assert attributes["verified_yield"] == 0.99
    assert attributes["said"].startswith("price 20, 25 for the uniformly scaled")
    assert attributes["said"].count("; ") == 1
    assert np.isnan(allocation().to_xarray().attrs["verified_yield"])
