"""Tests that random errors do not replace the effects of a robot file."""

import json

import numpy as np
import pytest

import forcefit as ff
from forcefit.assembly.statistics.statistics import statistics

ARM = """
name = "arm"
platform = "tip"
[[frame]]
name = "drive"
parent = "base"
joint = "revolute"
actuated = true
[[frame]]
name = "tip"
parent = "drive"
translation = [0.5, 0, 0]
[[effect]]
name = "encoder_offset"
parameters = { drive = 2e-3 }
"""
ERRORS = """
[[errors]]
frames = ["drive"]
distribution = "normal"
deviation = [0, 0, 1e-6, 0, 0, 0]
"""


@pytest.fixture
def files(tmp_path):
    robot, errors = tmp_path / "arm.toml", tmp_path / "errors.toml"
    robot.write_text(ARM)
    errors.write_text(ERRORS)
    return robot, errors


def test_drawn_pose_errors_include_the_offset_of_an_encoder(files):
    """The offset of 2 mrad moves the tip of a 0.5 m arm by 1 mm."""
    robot, errors = files
    posture = ff.place_robot(ff.load_robot(str(robot)))
    drawn = statistics(posture, errors, draws=50, margins=False).data
    rotation, translation = (drawn[k].values for k in ("rotation", "translation"))
    np.testing.assert_allclose(rotation, 2e-3, atol=1e-5)
    np.testing.assert_allclose(translation, 1e-3, atol=5e-6)


@pytest.mark.parametrize("command", ["statistics", "validity"])
def test_commands_keep_effects_when_errors_are_drawn(command, files, tmp_path, run):
    """The neglected second-order motion of an arm turned by a is L a^2 / 2 = 1 um."""
    robot, errors = map(str, files)
    if command == "statistics":
        words = ["assembly", command, "--draws", "20"]
    else:
        words = ["validation", command]
    status, out, err = run(*words, robot, "--errors", errors, "--json", "-")
    assert status == 0, err
    found = json.loads(out)
    if command == "statistics":
        mean = found["quantities"]["translation"]["mean"]["value"]
        assert mean == pytest.approx(1e-3, abs=5e-6)
    else:
        linear = found["costs"]["linear closures"]["position"]
        assert linear == pytest.approx(1e-6, rel=0.01)
