"""The page of tolerances: shares of the price, what was asked, what clearances take."""

import json
from dataclasses import replace

import numpy as np
import pytest

from assembly.files.robot_file import write_robot
from assembly.statistics.allocated_tolerances import Allocation, allocation_of
from assembly.statistics.tolerances_report import tolerances_page
from forcefit.page.page import Provenance
from tests.pages_for_tests import parse, tiles
from tests.robots_for_tests import coaxial_beams
from tests.tolerances_for_tests import arm, plan_for

NAN = float("nan")
RADIAL, LIMIT = 1e-4, 3e-4
PLAN = """
yield = 1.0
[limits]
translation = 3e-4
[[tolerance]]
name = "length"
frames = ["tip"]
components = ["TX"]
"""


def shown(tolerances, costs, most=(0.1, 0.1), cost="reciprocal"):
    """The page of two classes, an angle and a length."""
    plan = plan_for(
        coaxial_beams(np.zeros(6)), [("two", 1), ("two", 3)], [1, 1], {"energy": 2.0},
    )  # fmt: skip
    plan = replace(
        plan, group=np.array([0, 1]), names=("angle", "length"), cost=cost,
        costs=np.array(costs), most=np.array(most),
    )  # fmt: skip
    t = np.array(tolerances)
    found = Allocation(
        plan=plan, tolerances=t, price=plan.price(t), uniformly_scaled=t,
        price_uniformly_scaled=1.0, price_bound=NAN, cuts=1,
    )  # fmt: skip
    results = {
        "robot": "two bars", "postures": 3, "grid": "tx=0:2:1",
        "allocation": allocation_of(found),
    }  # fmt: skip
    return tolerances_page(json.loads(json.dumps(results)), Provenance())


@pytest.mark.parametrize("loosest", [1e-2, 0.1, 10.0])
def test_advice_on_tightening_does_not_depend_on_inactive_bounds(loosest):
    """Prices are 1 / 1e-3 and 1 / 1e-4: the length has 10 of 11 parts of the price."""
    page = shown([1e-3, 1e-4], [1.0, 1.0], (loosest, 0.1))
    answer, note = tiles(page)["What to tighten"]
    assert (answer, note[:4]) == ("length", "91\u00a0%")


def test_with_a_logarithmic_price_the_costs_are_the_multipliers():
    """t dL/dt is the cost over the multiplier, whatever the tolerances are."""
    answer, note = tiles(shown([1e-3, 1e-4], [3.0, 1.0], cost="logarithm"))[
        "What to tighten"
    ]
    assert (answer, note[:4]) == ("angle", "75\u00a0%")
    answer, _ = tiles(shown([1e-3, 1e-4], [1.0, 1.0], cost="logarithm"))[
        "What to tighten"
    ]
    assert answer == "angle, length"


def test_a_tolerance_at_its_loosest_is_not_to_be_tightened():
    """The angle costs more, and may not be looser: the length is to be tight."""
    both = shown([1e-5, 1e-4], [1.0, 1.0], (1e-5, 0.1))
    assert tiles(both)["What to tighten"][0] == "length"
    none = shown([1e-5, 1e-4], [1.0, 1.0], (1e-5, 1e-4))
    assert tiles(none)["What to tighten"][0] == "nothing"


def test_bars_begin_at_zero_on_a_linear_axis():
    """25.66 and 26.72 urad are drawn as they are, 1 to 1.04."""
    figures = parse(shown([2.566e-5, 2.672e-5], [1.0, 1.0])).figures
    assert len(figures) == 2
    for figure in figures:
        (trace,) = figure["traces"]
        assert trace["type"] == "bar"
        assert '"log"' not in json.dumps(figure)


def test_without_a_proof_the_page_says_so_and_has_no_empty_table():
    page = shown([1e-3, 1e-4], [1.0, 1.0])
    assert "not proved" in page
    assert "at least none" not in page
    assert all(len(table) > 1 for table in parse(page).tables)


def test_the_page_says_what_was_asked_and_what_clearances_take(tmp_path, run):
    """A pin of radius r, and a length t behind it: t = limit - r, 1 / t is the price.

    Without the clearance t would be the limit: 1.5 times looser, at 1 / limit.
    """
    write_robot(arm(radial=RADIAL), tmp_path / "arm.toml")
    (tmp_path / "plan.toml").write_text(PLAN)
    page, written = tmp_path / "t.html", tmp_path / "t.json"
    status, text, err = run(
        "assembly", "tolerances", tmp_path / "arm.toml", "--grid", "tx=0.4", "--plan",
        tmp_path / "plan.toml", "--fresh", 50, "--report", page, "--json", written,
    )  # fmt: skip
    assert status == 0, err
    allocation = json.loads(written.read_text())["allocation"]
    taken = allocation["perfect_parts"]["translation"]
    assert taken["reached"] == pytest.approx(RADIAL, rel=1e-3)
    assert taken["looser_without"] == pytest.approx(1.5, rel=1e-3)
    assert taken["price_without"] == pytest.approx(1.0 / LIMIT, rel=2e-3)
    assert "clearances alone take 0.1 mm of the 0.3 mm of translation" in text
    content = page.read_text("utf-8")
    assert tiles(content)["Clearances take"][0] == "33\u00a0%"
    asked = {row[0].text: row[1] for row in parse(content).table("asked")[1:]}
    assert asked["platform translation, at most"].value == LIMIT
    assert asked["errors"].text == "uniform within plus or minus their tolerance"
    assert asked["price"].text == "sum of cost / tolerance [rad or m]"
    assert asked["postures"].text == "1: tx=0.4"
    assert asked["clearances"].text.startswith("clearance worst: clearances anywhere")
    assert asked["yield"].text == "1: every robot within tolerance"


def test_errors_that_fit_everywhere_leave_nothing_to_tighten():
    """A margin of 0.5: the errors could be twice as large."""
    present = {
        "postures": 2, "assemblable_share": 1.0, "factor_on_errors": 2.0,
        "largest_margin": 0.5, "at": {"tx": 0.0}, "slopes": [],
    }  # fmt: skip
    results = {"robot": "bars", "postures": 2, "grid": "tx=0:1:1", "present": present}
    page = tolerances_page(results, Provenance())
    assert tiles(page)["What to tighten"][0] == "nothing"
    tight = present | {"factor_on_errors": 0.5, "assemblable_share": 0.0}
    page = tolerances_page(results | {"present": tight}, Provenance())
    assert tiles(page)["What to tighten"][0] == "all errors times 0.5"
