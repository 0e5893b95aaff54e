"""Tests of the report page of errors caused by modelling assumptions."""

import pytest

from forcefit.assembly.robots import load_robot
from forcefit.page.page import Provenance
from forcefit.validation.assumptions.costs_page import costs_page
from forcefit.validation.assumptions.over_poses import CostsOverPoses
from forcefit.validation.assumptions.validity import Cost
from tests.pages_for_tests import parse, tiles

POSES = ({"tx": 0.0}, {"tx": 0.1})


def shown(*errors):
    """Return the page of two poses, each with one known and one unknown error."""
    costs = tuple(
        {"linear closures": e, "one spring a beam": "no beam"} for e in errors
    )
    return costs_page(
        CostsOverPoses(load_robot("four_bar"), POSES, ("", ""), costs, "no meshes"),
        {}, Provenance(),
    )  # fmt: skip


@pytest.mark.parametrize(("second", "kind"), [
    (Cost(1e-3, 19e-6, 0.009), "good"),
    (Cost(1e-3, 21e-6, 0.0), "mixed"),
    (Cost(1e-3, 1e-6, 0.011), "mixed"),
])  # fmt: skip
def test_verdict_is_amber_for_significant_errors(second, kind):
    text = shown(Cost(2e-3, 1e-6, 0.0), second)
    assert f"<p class='verdict {kind}'>" in text
    assert "(1 more errors are unknown)" in text


def test_report_page_shows_the_largest_error_over_the_poses():
    text = shown(Cost(2e-3, 1e-6, 0.001), Cost(1e-3, 30e-6, 0.0))
    (row,) = parse(text).table("assumption", "largest rotation")[1:]
    assert [cell.value for cell in row[1:4]] == [2e-3, 30e-6, 0.001]
    assert row[4].text == "1 of 2 poses"
    assert tiles(text)["Largest error of position"] == ("30 µm", "linear closures.")
