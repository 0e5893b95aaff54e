"""Tests of ISO 9283 and ISO 230-2 characteristics against hand calculations."""

import json

import numpy as np
import pytest

from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.standards.figures import standard_figures
from forcefit.validation.standards.iso230 import axis_figures
from forcefit.validation.standards.iso9283 import (
    accuracy_drift,
    distance_accuracy,
    orientation_accuracy,
    orientation_repeatability,
    position_accuracy,
    position_repeatability,
)
from tests.campaigns_for_tests import write_campaign
from tests.pages_for_tests import parse, tiles


def test_pose_accuracy_and_repeatability_equal_hand_calculation():
    """The mean position is (3, 4, 0), and the distances from it are 1, 1, 2 and 2."""
    d = np.array([[4, 4, 0], [2, 4, 0], [3, 6, 0], [3, 2, 0]], dtype=float)
    assert position_accuracy(d) == pytest.approx(5.0, rel=1e-15)
    expected = 1.5 + 3 * np.sqrt(1 / 3)
    assert position_repeatability(d) == pytest.approx(expected, rel=1e-14)


def test_orientation_accuracy_and_repeatability_equal_hand_calculation():
    angles = np.array([[1, 0, 5], [3, 0, 5], [5, 3, 5]], dtype=float)
    assert orientation_accuracy(angles) == pytest.approx([3, 1, 5], rel=1e-15)
    expected = [3 * 2, 3 * np.sqrt(3), 0]
    assert orientation_repeatability(angles) == pytest.approx(expected, rel=1e-14)


def test_distance_accuracy_equals_hand_calculation():
    """The distances are 5, 7 and 6 for a commanded distance of 5.5."""
    first = np.zeros((3, 3))
    second = [[3, 4, 0], [0, 0, 7], [6, 0, 0]]
    accuracy, repeatability = distance_accuracy(first, second, 5.5)
    assert accuracy == pytest.approx(0.5, rel=1e-14)
    assert repeatability == pytest.approx(3.0, rel=1e-14)


def test_drift_is_the_largest_change_from_the_first_block():
    d = np.zeros((35, 3))
    d[:10, 0], d[10:20, 0], d[20:30, 1], d[30:, 0] = 1, 1.5, 4, 99
    assert accuracy_drift(d) == pytest.approx(3.0, rel=1e-15)
    assert accuracy_drift(d[:19]) is None


def test_reversal_and_repeatability_of_an_axis_equal_hand_calculation():
    """Two positions are approached three times from each direction.

    The means are 1 and 4 upward, 0 and 6 downward.  The standard deviations are 1 and 2
    upward, 1 and 0 downward.
    """
    figures = axis_figures([[0, 1, 2], [2, 4, 6]], [[-1, 0, 1], [6, 6, 6]])
    assert figures.reversal == pytest.approx(2)
    assert figures.mean_reversal == pytest.approx(-0.5)
    assert figures.repeatability_forward == pytest.approx(8)
    assert figures.repeatability_backward == pytest.approx(4)
    assert figures.repeatability == pytest.approx(8)
    assert figures.systematic_deviation == pytest.approx(6)
    assert figures.mean_deviation == pytest.approx(4.5)
    assert figures.accuracy == pytest.approx(8 - (-2))


HEAD = "id,q.one,q.two,meas.tx,meas.ty,meas.tz,cov.time,cov.approach"


def campaign(tmp_path, rows):
    """Write a campaign of the two-joint arm and return its folder."""
    return write_campaign(tmp_path / "lab", head=HEAD, rows=rows)


def test_iso_command_reports_characteristics_of_both_standards(run, tmp_path):
    """The arm of length 1.8 m is stretched along x and along y."""
    quarter = repr(np.pi / 2)
    rows = [
        f"{name}{k}{side},{angle},0,{x + side * 1e-5 + k * 1e-6},0,0,{t},{side}"
        for t, (k, name, angle, x, side) in enumerate(
            (k, name, angle, x, side)
            for k in range(3)
            for name, angle, x in (("a", "0", 1e-4), ("b", quarter, 2e-4))
            for side in (1, -1)
        )
    ]
    status, out, _ = run(
        "validation", "inspect", campaign(tmp_path, rows), "--iso", "--json", "-"
    )
    table = json.loads(out)
    assert status == 0
    poses = {pose["label"]: pose for pose in table["iso_9283"]["poses"]}
    assert set(poses) == {"a01", "a0-1", "b01", "b0-1"}
    assert poses["a01"]["accuracy"] == pytest.approx(1e-4 + 1e-5 + 1e-6, rel=1e-9)
    # the distances from the mean position are 1, 0 and 1 um
    spread = (2 / 3 + 3 * np.sqrt(1 / 3)) * 1e-6
    assert poses["a01"]["repeatability"] == pytest.approx(spread, rel=1e-6)
    pair = next(
        p for p in table["iso_9283"]["distances"] if p["labels"] == ["a01", "b01"]
    )
    assert pair["commanded"] == pytest.approx(1.8 * np.sqrt(2), rel=1e-12)
    # b moves by 1e-4 m more than a along x, at 45 degrees to the line between them
    assert pair["accuracy"] == pytest.approx(-1e-4 / np.sqrt(2), rel=1e-3)
    axis = table["iso_230_2"]["tx"]
    assert axis["reversal"] == pytest.approx(2e-5, rel=1e-9)
    assert axis["repeatability"] == pytest.approx(2e-5 + 4e-6, rel=1e-9)
    assert axis["systematic_deviation"] == pytest.approx(1e-4 + 2e-5, rel=1e-9)


def shown(run, folder, registration):
    """Return the page for a pose with the readings 1e-5, 2e-5 and 3e-5 m."""
    rows = [f"a{k},0,0,{k}e-5,0,0,{k},1" for k in (1, 2, 3)]
    toml = {"registration": f'"{registration}"'}
    write_campaign(folder / "lab", head=HEAD, rows=rows, toml=toml)
    page = folder / "iso.html"
    status, _, err = run(
        "validation", "inspect", folder / "lab", "--iso", "--report", page
    )
    assert status == 0, err
    return page.read_text(encoding="utf-8")


def test_iso_report_shows_accuracy_and_repeatability_of_the_poses(run, tmp_path):
    """The distances from the mean position 2e-5 m are 1e-5, 0 and 1e-5 m."""
    text = shown(run, tmp_path, "known")
    (row,) = parse(text).table("pose", "cycles")[1:]
    assert row[1].value == 3
    assert row[-3].value == pytest.approx(2e-5)
    assert row[-2].value == pytest.approx((2 / 3 + 3 * np.sqrt(1 / 3)) * 1e-5)
    assert tiles(text)["Pose accuracy AP, worst"] == ("20 µm", "at a1, 3 cycles.")


@pytest.mark.parametrize("registration", ["known", "unknown"])
def test_iso_report_warns_of_too_few_cycles(run, tmp_path, registration):
    """ISO 9283 requires 30 cycles."""
    text = shown(run, tmp_path, registration)
    assert "<p class='verdict mixed'>" in text
    assert "a pose has 3 cycles, ISO 9283 requires 30" in text
    included = "AP includes the unknown position of the measuring device" in text
    assert included == (registration == "unknown")


def test_iso_command_rejects_a_campaign_without_repeats(run, tmp_path):
    folder = campaign(tmp_path, ["a,0,0,0,0,0,0,1", "b,0.1,0,0,0,0,1,1"])
    status, _, err = run("validation", "inspect", "--iso", folder)
    assert status == 2
    assert "found no command that was measured twice" in err


def test_repeatability_does_not_depend_on_the_device_frame(tmp_path, rng):
    """The deviations are rotated and translated."""
    d = rng.normal(size=(30, 3))
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert position_repeatability(d @ Q + 5) == pytest.approx(position_repeatability(d))
    folder = campaign(tmp_path, ["a,0,0,1e-5,0,0,0,1", "b,0,0,2e-5,0,0,1,1"])
    (pose,) = standard_figures(read_campaign(folder)).poses
    assert pose.accuracy == pytest.approx(1.5e-5)
    assert pose.angles is None


def distances(folder):
    """Return a mapping from the ids of two poses to their AD_P [m]."""
    figures = standard_figures(read_campaign(folder))
    return {pair.labels: pair.accuracy for pair in figures.distances}


TWO_POSES = [("a", "0"), ("b", repr(np.pi / 2))]


def test_distances_are_computed_separately_for_each_load(tmp_path):
    """A load moves both poses by 1 mm, so the distances equal the commanded ones."""
    rows = [
        f"{name}{fx}{k},{angle},0,{0.001 * (fx > 0)},0,0,{fx}"
        for name, angle in TWO_POSES for fx in (0, 100) for k in range(2)
    ]  # fmt: skip
    head = "id,q.one,q.two,meas.tx,meas.ty,meas.tz,load.fx"
    found = distances(write_campaign(tmp_path / "lab", head=head, rows=rows))
    assert found == pytest.approx({("a00", "b00"): 0, ("a1000", "b1000"): 0}, abs=1e-15)


def test_distances_are_computed_separately_for_each_session(tmp_path):
    """The device is displaced by 2 m in the second session."""
    rows = [
        f"{name}{day}{k},{day},{angle},0,{shift},0,0"
        for name, angle in TWO_POSES
        for day, shift in (("mon", 0), ("tue", 2)) for k in range(2)
    ]  # fmt: skip
    head = "id,session,q.one,q.two,meas.tx,meas.ty,meas.tz"
    toml = {"registration": '"unknown"'}
    folder = write_campaign(tmp_path / "lab", head=head, rows=rows, toml=toml)
    found = distances(folder)
    assert set(found) == {("amon0", "bmon0"), ("atue0", "btue0")}
    assert np.abs(list(found.values())).max() < 1e-15


def test_axis_characteristics_are_computed_separately_for_each_load(tmp_path):
    """The deflection of 1 mm under a load must not increase the deviation of 20 um."""
    rows = [
        f"{name}{fx}{side}{k},{angle},0,{1e-5 * (fx + side)},0,0,{side},{fx}"
        for name, angle in TWO_POSES
        for fx in (0, 100) for side in (-1, 1) for k in range(2)
    ]  # fmt: skip
    rows = [f"{row},{time}" for time, row in enumerate(rows)]
    head = "id,q.one,q.two,meas.tx,meas.ty,meas.tz,cov.approach,load.fx,cov.time"
    folder = write_campaign(tmp_path / "lab", head=head, rows=rows)
    axes = standard_figures(read_campaign(folder)).axes
    tx = {
        name: axis.systematic_deviation for name, axis in axes.items() if "tx" in name
    }
    expected = {"tx from a0-10": 2e-5, "tx from a100-10": 2e-5}
    assert tx == pytest.approx(expected, rel=1e-9)
