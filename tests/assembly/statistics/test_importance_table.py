"""The importance table of a linear platform whose indices are known."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.importance_table import (
    ImportanceOptions,
    importance_dataset,
    importance_design,
    importance_report,
    importance_rows,
    importance_text,
)
from tests import tolerances_for_tests

WIDTHS = np.array([2e-3, 0, 0, 3e-4, 4e-4, 0.0])
NAMES = ["tip.RX", "tip.TX", "tip.TY"]


def arm(**options):
    """A driven arm; its tip follows its errors, of an angle and of two lengths."""
    robot = tolerances_for_tests.arm()
    sources = tolerance_sources(robot, WIDTHS, ("tip",))
    return Experiment(home_posture(robot), sources, margins=False, **options)


def solved(by="source", draws=400, **options):
    """The data set of an arm without clearance, and its plain values."""
    experiment = arm(clearance="least", **options)
    design = importance_design(experiment, ImportanceOptions(draws, by))
    rows = importance_rows(experiment, design, 0, len(design))
    data = importance_dataset(experiment, design, rows)
    return data, importance_report(data)


def test_platform_that_follows_each_error_has_gains_of_one():
    """A uniform error of half width w has the deviation w / sqrt(3), as the platform.

    400 draws know a deviation to 4 %; a gain is a slope, and no draw changes it.
    """
    data, report = solved()
    assert list(data["group"].values) == NAMES
    deviation = WIDTHS[WIDTHS > 0] / np.sqrt(3)
    for name, size, unit in zip(NAMES, deviation, ("rad", "m", "m"), strict=True):
        one = report["platform"][name]
        moved, still = ("rotation", "translation")[:: 1 if unit == "rad" else -1]
        assert one["error_unit"] == unit
        assert one[f"{moved}_part"] == pytest.approx(size, rel=0.15)
        assert one[f"{moved}_gain"] == pytest.approx(1.0, rel=1e-12)
        assert one[f"{still}_part"] == pytest.approx(0.0, abs=1e-3 * size)
        assert one[f"{still}_gain"] == pytest.approx(0.0, abs=1e-12)
    assert (report["base_draws"], report["clearance"]) == (400, "least")
    quantities = report["quantities"]
    assert set(quantities) == {"energy", "rotation", "translation", "force"}
    # an open chain is never pressed
    assert quantities["energy"]["reason"] == "it does not vary"
    assert "reason" not in quantities["translation"]
    total = quantities["rotation"]["total_index"]
    assert [total[name][0] for name in NAMES] == pytest.approx([1, 0, 0], abs=0.15)


def test_group_of_angles_and_lengths_has_a_standard_deviation_but_no_gain():
    """The part of a frame is the root sum of squares of its errors' parts."""
    data, report = solved("frame")
    (one,) = report["platform"].values()
    assert one["error_unit"] == "rad, m"
    assert np.isnan(one["translation_gain"])
    assert np.isnan(one["rotation_gain"])
    lengths = np.linalg.norm(WIDTHS[3:]) / np.sqrt(3)
    assert one["translation_part"] == pytest.approx(lengths, rel=0.1)
    assert data["part"].sel(component="rotation").item() == one["rotation_part"]


def test_draws_without_a_solution_are_reported_with_the_reason():
    """At most 5 % may be left out; beyond, the remaining draws are not independent."""
    experiment = arm(clearance="least")
    design = importance_design(experiment, ImportanceOptions(100, "source"))
    rows = importance_rows(experiment, design, 0, len(design))
    for lost, reason in ((4, None), (6, "6.0%")):
        some = rows.copy()
        for name in ("translation", "platform_screw"):
            some[name][:lost] = np.nan
        report = importance_report(importance_dataset(experiment, design, some))
        one = report["quantities"]["translation"]
        assert one["largest_share_left_out"] == pytest.approx(lost / 100)
        lines = importance_text(report).splitlines()
        if reason is None:
            assert "reason" not in one
            assert (
                "translation: up to 4.0% of the draws have no solution and are left out"
                in lines
            )
            assert report["platform"]["tip.TX"]["translation_gain"] > 0.5
            continue
        assert one["reason"] == (
            "no indices are computed if more than 5% of the draws have no solution: "
            "up to 6.0% were left out, and the errors of the other draws are not "
            "independent"
        )
        assert f"translation: {one['reason']}" in lines
        assert all(np.isnan(v).all() for v in one["total_index"].values())
        # no part of a platform that is not known
        parts = [v["translation_part"] for v in report["platform"].values()]
        assert np.isnan(parts).all()


def told(units, left_out=0.0, rank=(1, 1)):
    """The table's lines for a group of each unit, the first of the largest part."""
    count = len(units)
    platform = {
        f"group{k}": {
            "error_unit": unit, "translation_part": 1e-6 * (count - k),
            "rotation_part": 2e-3 * (k + 1), "translation_gain": 0.5 + k,
            "rotation_gain": 0.1,
        }
        for k, unit in enumerate(units)
    }  # fmt: skip
    index = {group: np.array([0.25, 0.2, 0.3]) for group in platform}
    one = {
        "total_index": index, "first_index": index, "largest_share_left_out": 0.0,
        "rank": dict.fromkeys(platform, rank),
    }  # fmt: skip
    lines = importance_text({
        "base_draws": 64, "clearance": "least", "platform": platform,
        "quantities": {
            "translation": one, "energy": one | {"largest_share_left_out": left_out},
            "stress": one | {"reason": "it does not vary"},
        },
    }).splitlines()  # fmt: skip
    assert lines[-1].startswith("largest: group0")
    return lines[:-1]


def test_importance_table_has_um_per_um_for_lengths_and_um_per_mrad_for_angles():
    head, stress, columns, length, angle, both = told(["m", "rad", "rad, m"])
    assert "64 base draws" in head
    assert stress == "stress: it does not vary"
    begin = [columns.index(word) for word in ("for each um", "for each mrad", "[mrad]")]
    assert length.split() == "group0 3 0.5 2 0.250 (0.200 to 0.300) 1".split()
    assert begin[0] <= length.index(" 0.5 ") < begin[1]
    # 1.5 m for each rad are 1500 um for each mrad
    assert angle.split() == "group1 2 1500 4 0.250 (0.200 to 0.300) 1".split()
    assert begin[1] <= angle.index(" 1500 ") < begin[2]
    # rad and m together have no gain
    assert both.split() == "group2 1 6 0.250 (0.200 to 0.300) 1".split()
    ends = [len(line) for line in (length, angle, both)]
    assert len(set(ends)) == 1


def test_importance_table_reports_omitted_draws_and_further_groups():
    lines = told(["m"] * 18, left_out=0.015)
    assert "energy: up to 1.5% of the draws have no solution and are left out" in lines
    assert lines[-1] == "and 3 more, see --json"
    assert [line.split()[0] for line in lines[-4:-1]] == [
        "group12",
        "group13",
        "group14",
    ]
    assert "more" not in told(["m"] * 15)[-1]
