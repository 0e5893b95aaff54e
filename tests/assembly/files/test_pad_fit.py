"""Pad between two planes, whose gap is determined by a fit.

The deviations for 20 H9/h9 are 0 to 52 um between the planes and -52 to 0 um of the
pad.  The gap on each side is 0 to 52 um with a mean of 26 um.
"""

import re

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.worst_pose import worst_pose
from forcefit.inputs.table import BadInput

A, B = 0.03, 0.02  # [m] half the length and half the width of the pad
FIT = 'fit = "20 H9/h9"'
PAD = """
format = 2
name = "key"
platform = "key"
platform_at = [0, 0, 0]
[[body]]
name = "key"
[[joint]]
name = "slot"
type = "planar"
between = ["base", "key"]
at = [0, 0, 0]
axis = [0, 0, 1]
clearance = { pad = { FIT, length = "60 mm", width = "40 mm" } }
"""


def read(tmp_path, text=PAD):
    path = tmp_path / "robot.toml"
    path.write_text(text.replace("FIT", FIT))
    return read_robot(path)


def octahedron(robot, gap, rng):
    """Check that the support function is gap * max(|w_T|, |w_RX| / B, |w_RY| / A)."""
    reachable = reachable_screws(solve_assembly(home_posture(robot)), "frozen")
    for w in rng.normal(size=(20, 6)) * [B, A, 0, 0, 0, 1]:
        expected = gap * (np.abs(w[[0, 1, 5]]) / [B, A, 1]).max()
        assert reachable.support(w).height == pytest.approx(expected, rel=1e-7)


def test_reachable_screws_of_a_pad_are_proportional_to_its_gap(tmp_path, rng):
    robot = read(tmp_path)
    sources = sources_of(robot)
    assert [fit.name for fit in sources.fits] == ["fit 20 H9/h9 of slot.turn"]
    octahedron(robot, 26e-6, rng)
    octahedron(sources.with_clearances(np.array([-11e-6])), 15e-6, rng)
    octahedron(sources.with_largest_clearances(), 52e-6, rng)


def test_random_gap_of_a_pad_has_mean_and_deviation_of_fit(tmp_path):
    """The standard deviation of the gap is 52 / sqrt(24) um and its mean is 26 um."""
    gaps = 26 + 1e6 * sources_of(read(tmp_path)).draw(0, 20_000, 1)[:, 0]
    assert 0 <= gaps.min() <= gaps.max() <= 52
    assert gaps.mean() == pytest.approx(26, abs=0.3)
    assert gaps.std() == pytest.approx(52 / np.sqrt(24), rel=0.02)


@pytest.mark.parametrize(("more", "um"), [("", 52), ("0.004 mm", 54)])
def test_worst_case_tilt_of_pad_follows_from_fit_and_flatness(tmp_path, more, um):
    """The rotation about x is gap / B; a flatness tolerance t increases it by t / 2."""
    form = f'[[tolerance]]\nfeature = "slot"\nflatness = "{more}"\n' if more else ""
    robot = read(tmp_path, PAD.replace("[[body]]", form + "[[body]]", 1))
    prepared = linear_response(home_posture(robot))
    found = worst_pose(prepared, sources_of(robot), "rotation")
    assert found.attained == pytest.approx(um * 1e-6 / B, rel=1e-6)


def test_fit_of_a_pad_is_preserved_in_format_1(tmp_path, rng):
    robot = read(tmp_path)
    write_robot(robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    assert dict(again.fitted_ends) == dict(robot.fitted_ends)
    octahedron(sources_of(again).with_largest_clearances(), 52e-6, rng)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("FIT", 'fit = "25 H7/p6"', 'pad.fit: found "25 H7/p6", an interference fit'),
        ("FIT", FIT + ', gap = "5 um"', 'pad.gap: found together with "fit"'),
        ("pad = { FIT", FIT + ', pad = { gap = "5 um"',
         'fit: found together with "pad", expected it in the pad'),
    ],
)  # fmt: skip
def test_invalid_fit_of_a_pad_is_rejected(tmp_path, old, new, message):
    with pytest.raises(BadInput, match=re.escape(message)) as error:
        read(tmp_path, PAD.replace(old, new))
    assert "\n" not in str(error.value)
