"""Test the output files and error messages of ``validation diagnose``."""

import json

import numpy as np
import pytest

from forcefit.assembly.effects import apply_effects
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.validation.campaign.campaign_file import read_campaign
from tests.planar_arm_for_tests import measure


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Campaign with an encoder offset of 5e-5 rad and measured positions."""
    folder = tmp_path_factory.mktemp("small") / "campaign"
    measure(folder, configurations=10, passes=3, offset=(0, 8e-5))
    path = folder / "measurements.csv"
    lines = [line.split(",") for line in path.read_text().splitlines()]
    turns = [k for k, name in enumerate(lines[0]) if name.startswith("meas.r")]
    kept = [[w for k, w in enumerate(line) if k not in turns] for line in lines]
    path.write_text("".join(",".join(line) + "\n" for line in kept))
    return folder


def test_diagnose_writes_results_a_report_and_a_robot(small, tmp_path, run):
    out = {name: tmp_path / name for name in ("d.json", "d.html", "robot.toml")}
    status, printed, err = run(
        "validation", "diagnose", small, "--json", out["d.json"],
        "--report", out["d.html"], "--save", out["robot.toml"],
    )  # fmt: skip
    assert status == 0, err
    written = json.loads(out["d.json"].read_text())
    assert written["verdict"] == "explained"
    assert written["error"]["before"]["rotation"] is None  # never measured
    assert written["error"]["after"]["position"] < 1e-5
    assert written["sentence"] in printed
    page = out["d.html"].read_text(encoding="utf-8")
    assert written["sentence"] in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert 'src="http' not in page
    robot = read_robot(out["robot.toml"])
    ((effect, values),) = robot.effects.items()
    assert (effect, values.keys()) == ("encoder_offset", {"two"})
    campaign = read_campaign(small)
    q = campaign.coordinates[0]
    status, printed, _ = run(
        "assembly", "solve", out["robot.toml"], "--joint", f"one={q[0]},two={q[1]}",
        "--load", ",".join(f"{n}={w}" for n, w in zip(
            ("mx", "my", "mz", "fx", "fy", "fz"), campaign.loads[0], strict=True)),
        "--json", "-",
    )  # fmt: skip
    assert status == 0
    solved = np.array(json.loads(printed)["platform_screw"])
    placed = place_robot(campaign.robot, joints={"one": q[0], "two": q[1]})
    declared = as_declared(placed, campaign.loads[0])
    fitted = predict(apply_effects(declared, {effect: values})).deviation[0]
    assert solved == pytest.approx(fitted, abs=1e-9)  # tolerance for second-order terms
    assert np.abs(fitted - predict(declared).deviation[0]).max() > 1e-5


def test_diagnose_saves_no_robot_without_identified_effects(tmp_path, run):
    folder = measure(tmp_path / "campaign", configurations=8, passes=3)
    status, _, err = run(
        "validation", "diagnose", folder, "--save", tmp_path / "r.toml"
    )
    assert status == 1
    assert "no error or effect in addition to the declared ones" in err
    assert not (tmp_path / "r.toml").exists()


def test_diagnose_rejects_invalid_output_paths_before_computing(
    tmp_path, small, rejected
):
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    for words, told in (
        (("nowhere",), "nowhere"),
        ((small, "--report", tmp_path / "no" / "d.html"), "no folder"),
        ((small, "--report", tmp_path / "d.toml"), "expected an HTML page: .html or"),
        ((small, "--save", folder), "found a folder"),
        ((small, "--save", small / "robot.toml"), "not a robot file written by"),
        ((small, "--save", small / "campaign.toml"), "it is not overwritten"),
        ((small, "--json", small / "measurements.csv"), "expected a JSON file: .json"),
    ):
        assert told in rejected("validation", "diagnose", *words)
