"""Cross-checks over a grid of poses."""

import json
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.robots import load_robot
from forcefit.assembly.sweeps.targets import grid_targets
from forcefit.commands import app as command
from forcefit.validation.assumptions.over_poses import costs_over_poses
from forcefit.validation.crosscheck.crosscheck import crosscheck
from forcefit.validation.crosscheck.poses import check_poses, poses_table, poses_text
from forcefit.validation.multibody.simulation import SimulationFailed
from tests.robots_for_tests import NUMBERS, irsbot2_with

pytestmark = pytest.mark.exudyn
AXES = {"tx": [-0.7, 0.0, 0.2], "tz": [-0.45]}


def test_pose_beyond_joint_limits_is_not_checked():
    """At the second pose, a slide of the Orthoglide is beyond its limit."""
    robot = load_robot("orthoglide")
    frames = tuple(
        replace(f, limits=(-0.4, -0.3)) if f.name == "x.slide" else f
        for f in robot.frames
    )
    axes = {"tx": np.array([0.0, 0.05]), "ty": np.zeros(1), "tz": np.zeros(1)}
    seen = []

    def check(posture):
        seen.append(posture.pose()["tx"])
        raise SimulationFailed("orthoglide", "none is run")

    rows = check_poses(replace(robot, frames=frames), axes, check)
    assert [row["status"] for row in rows] == ["simulation failed", "beyond_limits"]
    assert rows[1]["passed"] is None
    assert seen == [pytest.approx(0.0)]
    costs = costs_over_poses(replace(robot, frames=frames), grid_targets(axes))
    assert costs.unreached[0] == ""
    assert "x.slide at -0.26 m, limits -0.4 to -0.3" in costs.unreached[1]


def test_failed_pose_is_reported_and_the_grid_continues():
    def check(posture):
        if posture.pose()["tx"] > 0.1:
            raise SimulationFailed("irsbot2", "no equilibrium")
        return crosscheck(posture, (1.0, 0.5))

    rows = check_poses(irsbot2_with(NUMBERS["cases"][0]), AXES, check)
    assert [row["passed"] for row in rows] == [None, True, False]
    assert rows[2]["status"] == "simulation failed"
    assert not poses_table(rows)["passed"]
    assert "FAILED (simulation failed)" in poses_text(rows)


def test_grid_without_a_reachable_pose_does_not_pass():
    rows = check_poses(irsbot2_with(NUMBERS["cases"][0]), {"tz": [-0.9]}, None)
    assert not poses_table(rows)["passed"]


def test_crosscheck_command_checks_the_poses_of_a_grid(tmp_path, capsys, monkeypatch):
    import sys

    write_robot(irsbot2_with(NUMBERS["cases"][0]), tmp_path / "robot.toml")
    words = ["forcefit", "validation", "crosscheck", str(tmp_path / "robot.toml")]
    words += ["--grid", "tx=0:0.1:0.1,tz=-0.5", "--scale", "1,0.5", "--json", "-"]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as done:
        command.main()
    found = json.loads(capsys.readouterr().out)
    assert done.value.code == 0
    assert found["reached"] == 2
    assert len(found["poses"]) == 2
    monkeypatch.setattr(sys, "argv", [*words, "--pose", "tx=0"])
    with pytest.raises(SystemExit) as done:
        command.main()
    assert done.value.code == 2
    assert "--grid: found together with" in capsys.readouterr().err


def test_crosscheck_without_errors_or_loads_does_not_pass():
    """Without errors or loads, both models have zero displacements."""
    rows = check_poses(load_robot("irsbot2"), AXES, lambda p: crosscheck(p, (1.0, 0.5)))
    assert [row["passed"] for row in rows] == [None, False, False]
    assert not poses_table(rows)["passed"]
    said = poses_text(rows).splitlines()
    assert said[1].endswith("NOT CHECKED, no difference exceeds the noise")
    assert said[-1] == "0 of 2 reachable poses passed"
