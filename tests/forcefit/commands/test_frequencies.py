"""The command ``forcefit assembly frequencies``."""

import json

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import write_robot
from forcefit.assembly.model.robot import BeamLink, Frame, Robot


def test_frequencies_are_ascending_and_shares_sum_to_one(run):
    status, out, _ = run(
        "assembly", "frequencies", "delta", "--count", "4", "--json", "-"
    )
    answer = json.loads(out)
    assert status == 0
    assert answer["frequencies"] == sorted(answer["frequencies"])
    assert len(answer["modes"]) == 4
    for mode in answer["modes"]:
        assert sum(mode["shares"].values()) == pytest.approx(1.0)


def test_nominal_frequencies_report_that_gravity_is_neglected(run, tmp_path):
    """The frequency of a pendulum, sqrt(m g l / I) / (2 pi), is due to gravity."""
    pendulum = Robot("pendulum", "tip", (
        Frame("pivot", joint="revolute", rotation=[np.pi / 2, 0, 0]),
        Frame("tip", "pivot", [0, -1.0, 0], mass=2.0,
              link=BeamLink({"radius": 0.02}, 2e11, 0.3)),
    ))  # fmt: skip
    write_robot(pendulum, tmp_path / "p.toml")
    words = ["frequencies", tmp_path / "p.toml", "--gravity", "z=-9.81", "--count", "1"]
    _, out, _ = run("assembly", *words)
    assert "without load and gravity" in out
    _, out, _ = run("assembly", *words, "--state", "exact")
    assert "left out" not in out
    assert float(out.split("Hz")[0].split()[-1]) == pytest.approx(
        np.sqrt(9.81) / (2 * np.pi), rel=1e-3
    )
