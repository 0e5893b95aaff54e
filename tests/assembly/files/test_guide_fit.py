"""Linear guides with a fit: limits, random draws and worst case."""

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.worst_pose import worst_pose

# block in a guide with a length of 80 mm; the platform is 200 mm from its centre
GUIDE = """
format = 2
name = "guide"
platform = "block"
platform_at = [0, 0, "200 mm"]
[[body]]
name = "block"
[[joint]]
name = "slide"
type = "prismatic"
between = ["base", "block"]
at = [0, 0, 0]
axis = [0, 0, 1]
actuated = true
[joint.clearance]
guide = { fit = FIT, length = "80 mm", width = "40 mm", height = "30 mm" }
"""
ONE, TWO = '"40 H7/g6"', '["40 H7/g6", "30 H8/f7"]'


def read(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return read_robot(path)


def worst(robot):
    prepared = linear_response(home_posture(robot))
    return worst_pose(prepared, sources_of(robot), "translation").attained


@pytest.mark.parametrize(("fit", "um"), [(ONE, (25, 25)), (TWO, (25, 37))])
def test_worst_case_of_guide_follows_from_largest_gap_of_fit(tmp_path, fit, um):
    """A gap c displaces a point at 200 mm by c * 2 * 200 / 80 along x and y.

    The gap is 4.5 to 25 um for 40 H7/g6 and 10 to 37 um for 30 H8/f7.
    """
    robot = read(tmp_path, GUIDE.replace("FIT", fit))
    assert worst(robot) == pytest.approx(5e-6 * np.hypot(*um), rel=1e-6)


def test_fit_of_a_guide_is_preserved_in_format_1(tmp_path):
    robot = read(tmp_path, GUIDE.replace("FIT", TWO))
    write_robot(robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    assert dict(again.fits) == dict(robot.fits)
    assert dict(again.fitted_ends) == dict(robot.fitted_ends)
    assert worst(again) == pytest.approx(worst(robot), rel=1e-9)


def test_gaps_of_a_guide_along_x_and_y_are_independent(tmp_path):
    robot = read(tmp_path, GUIDE.replace("FIT", TWO))
    sources = sources_of(robot)
    assert [fit.name for fit in sources.fits] == [
        "fit 40 H7/g6 of slide.x", "fit 30 H8/f7 of slide.y",
    ]  # fmt: skip
    assert sources.groups_by("kind") == [fit.name for fit in sources.fits]
    means = [fit.fit.mean_radial for fit in sources.fits]
    gaps = 1e6 * (sources.draw(0, 20_000, 1) + means)
    assert (gaps.min(axis=0) >= [4.5, 10]).all()
    assert (gaps.max(axis=0) <= [25, 37]).all()
    # the gap is half the difference of two uniform sizes with the given ranges [um]
    expected = [np.hypot(25, 16) / np.sqrt(48), np.hypot(33, 21) / np.sqrt(48)]
    assert gaps.std(axis=0) == pytest.approx(expected, rel=0.02)
    assert abs(np.corrcoef(gaps.T)[0, 1]) < 0.03
    drawn = sources.with_clearances(np.array([1e-6, -2e-6]))
    turns = [
        drawn.frame(f"slide.guide_{turn}_{end}").clearance.spin
        for turn in ("yaw", "pitch") for end in ("start", "end")
    ]  # fmt: skip
    rotation = np.array([means[0] + 1e-6, means[1] - 2e-6]) / 0.08
    assert turns == pytest.approx(np.repeat(rotation, 2), rel=1e-12)
