"""Increase of joint clearances by half the flatness or cylindricity tolerance."""

import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.worst_pose import worst_pose

ARM = """
format = 2
name = "arm"
platform = "rod"
platform_at = ["200 mm", 0, 0]
[[tolerance]]
feature = "pin"
cylindricity = "0.004 mm"
[[body]]
name = "rod"
[[body.tolerance]]
feature = "pin"
cylindricity = "0.006 mm"
[[joint]]
name = "pin"
type = "revolute"
between = ["base", "rod"]
at = [0, 0, 0]
axis = [0, 0, 1]
actuated = true
clearance = { fit = "12 H7/g6", length = "40 mm" }
"""
PAD = (
    ARM.replace("revolute", "planar").replace("cylindricity", "flatness")
    .replace("actuated = true\n", "")
    .replace('fit = "12 H7/g6", length = "40 mm"',
             'pad = { gap = "10 um", length = "60 mm", width = "40 mm" }')
)  # fmt: skip


def read(tmp_path, text):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    return read_robot(path)


def worst(robot):
    prepared = linear_response(home_posture(robot))
    return worst_pose(prepared, sources_of(robot), "rotation").attained


def test_cylindricity_of_shaft_and_hole_increases_clearance_of_fit(tmp_path):
    """The tilt is 2 * 22.5 um / 40 mm.

    The radial clearance of the fit is at most 17.5 um, and the form adds 2 + 3 um.
    """
    robot = read(tmp_path, ARM)
    assert worst(robot) == pytest.approx(1.125e-3, rel=1e-6)
    assert any('"pin" by 5 um (cylindricity)' in remark for remark in robot.remarks)
    assert not robot.callouts
    sources = sources_of(robot)
    radial = sources.fits[0].fit.mean_radial + sources.draw(0, 2000, 1)[:, 0]
    # 3 to 17.5 um of the fit, plus 5 um of the form
    assert 8e-6 <= radial.min() <= radial.max() <= 22.5e-6
    assert radial.mean() == pytest.approx(15.25e-6, abs=0.3e-6)


def test_form_tolerance_is_preserved_in_format_1(tmp_path):
    robot = read(tmp_path, ARM)
    write_robot(robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    assert worst(again) == pytest.approx(1.125e-3, rel=1e-6)


def test_cylindricity_increases_clearances_of_two_bearings(tmp_path):
    """The tilt between two bearings at a distance of 50 mm is (15 + 19.5) um / 50 mm.

    The form adds 5 um to the clearances of 10 um and 14.5 um (12 H7/h6).
    """
    fit = '{ fit = "12 H7/g6", length = "40 mm" }'
    one, two = '{ z = 0, radial = "10 um" }', '{ z = "50 mm", fit = "12 H7/h6" }'
    robot = read(tmp_path, ARM.replace(fit, f"{{ bearings = [ {one}, {two} ] }}"))
    assert worst(robot) == pytest.approx((15e-6 + 19.5e-6) / 0.05, rel=1e-6)


def test_flatness_increases_the_gap_of_a_pad(tmp_path):
    """The gap increases from 10 to 15 um, and all screws by a factor of 1.5."""
    of_form = [
        '[[tolerance]]\nfeature = "pin"\nflatness = "0.004 mm"\n',
        '[[body.tolerance]]\nfeature = "pin"\nflatness = "0.006 mm"\n',
    ]
    exact = PAD
    for table in of_form:
        assert table in exact
        exact = exact.replace(table, "")
    wide, narrow = (
        linear_response(home_posture(read(tmp_path, text))).joints.cones
        for text in (PAD, exact)
    )
    assert wide == pytest.approx(1.5 * narrow, rel=1e-9)
