"""Worst cases and standard deviations of five mechanisms with callouts. The expected
values are hand calculations: tilts of bores within their zones, and rotations and gaps
multiplied by lever arms.
"""

import numpy as np
import pytest

from forcefit import BadInput, worst_pose
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.tolerance_file import read_plan

# shaft in two bearings of a housing, with a coaxiality tolerance
SHAFT = """
format = 2
platform = "shaft"
platform_at = [0, 0, "300 mm"]
body = [
    { name = "house", tolerance = [{ feature = "front", datums = ["seat"], coaxiality = "0.02 mm", extent = "15 mm" }] },
    { name = "shaft" },
]
joint = [
    { name = "seat", type = "fixed", between = ["base", "house"], at = [0, 0, 0], axis = [0, 0, 1] },
    { name = "front", type = "revolute", between = ["house", "shaft"], at = [0, 0, "100 mm"], axis = [0, 0, 1], actuated = true, clearance = { bearings = [{ z = 0, fit = "20 H7/h6" }, { z = "60 mm", fit = "15 H7/h6" }] } },
]
"""  # noqa: E501
# block in a linear guide, with a position tolerance of the rail
GUIDE = """
format = 2
platform = "block"
platform_at = [0, 0, "200 mm"]
body = [
    { name = "rail", tolerance = [{ feature = "slide", datums = ["foot"], position = "0.05 mm", parallelism = "0.03 mm", extent = "80 mm" }] },
    { name = "block" },
]
joint = [
    { name = "foot", type = "fixed", between = ["base", "rail"], at = [0, 0, 0], axis = [0, 0, 1] },
    { name = "slide", type = "prismatic", between = ["rail", "block"], at = [0, 0, 0], axis = [0, 0, 1], actuated = true, clearance = { guide = { fit = "40 H7/g6", length = "80 mm", width = "40 mm", height = "30 mm" } } },
]
"""  # noqa: E501
# crank with general tolerances ISO 2768-mK
LINK = """
format = 2
platform = "tip"
platform_at = ["700 mm", 0, 0]
body = [
    { name = "crank", tolerance = [{ feature = "elbow", datums = ["root"], general = "ISO 2768-mK", extent = "30 mm" }] },
    { name = "tip" },
]
joint = [
    { name = "root", type = "revolute", between = ["base", "crank"], at = [0, 0, 0], axis = [0, 1, 0], actuated = true },
    { name = "elbow", type = "revolute", between = ["crank", "tip"], at = ["400 mm", 0, 0], axis = [0, 0, 1], actuated = true },
]
"""  # noqa: E501
# plate with a hole and a side face as datum
PLATE = """
format = 2
platform = "pin"
platform_at = ["80 mm", 0, "60 mm"]
body = [
    { name = "plate", tolerance = [
        { feature = "hole", datums = ["side", "face"], position = "0.05 mm (M)", hole = "12 H7", extent = "20 mm" },
        { feature = "side", datums = ["face"], perpendicularity = "0.05 mm", extent = ["60 mm", "40 mm"] },
    ] },
    { name = "pin" }, { name = "stopA" }, { name = "stopB" },
]
joint = [
    { name = "mount", type = "fixed", between = ["base", "plate"], at = ["40 mm", 0, 0] },
    { name = "face", type = "planar", between = ["plate", "stopA"], at = [0, 0, 0], axis = [0, 0, 1] },
    { name = "side", type = "planar", between = ["plate", "stopB"], at = [0, 0, 0], axis = [1, 0, 0] },
    { name = "hole", type = "revolute", between = ["plate", "pin"], at = ["80 mm", 0, 0], axis = [0, 0, 1], actuated = true, clearance = { fit = "12 H7/g6", length = "20 mm" } },
]
"""  # noqa: E501
# bracket with a face A, a hole B at maximum material, and a bore C
BRACKET = """
format = 2
platform = "rod"
platform_at = ["300 mm", 0, "20 mm"]
body = [
    { name = "bracket", tolerance = [{ feature = "C", name = "bore C", datums = ["A", "B (M)"], datum_hole = "12 H7", position = "0.04 mm", perpendicularity = "0.02 mm", extent = "20 mm" }] },
    { name = "rod", tolerance = [{ feature = "C", cylindricity = "0.006 mm" }] },
]
joint = [
    { name = "A", type = "planar", between = ["base", "bracket"], at = [0, 0, 0], axis = [0, 0, 1], clearance = { pad = { gap = "5 um", length = "60 mm", width = "40 mm" } } },
    { name = "B", type = "revolute", between = ["base", "bracket"], at = [0, 0, 0], axis = [0, 0, 1], actuated = true, clearance = { fit = "12 H7/g6", axial = "1 mm", tilt = "10 mrad" } },
    { name = "C", type = "revolute", between = ["bracket", "rod"], at = ["100 mm", 0, "20 mm"], axis = [0, 0, 1], actuated = true, clearance = { fit = "10 H7/h6", length = "20 mm" } },
]
"""  # noqa: E501


def bore_variance(radius, length, height):
    """Return the variance along x at a height above a bore with ends in discs."""
    return radius**2 * (1 / 8 + (height / length) ** 2 / 2)


def grown_mean_square(radius, growth):
    """Return the mean square of a radius that is uniformly distributed."""
    return ((radius + growth) ** 3 - radius**3) / (3 * growth)


# [um] worst translation and standard deviations along x, y and z
um = 1e-6
SHAFT_WORST = 10 * 2 * 200 / 15 + 17 * (200 / 60 - 1) + 14.5 * 200 / 60
GUIDE_WORST = 25 + (200 - 40) * 30 / 80 + 25 * np.sqrt(2) * 2 * 200 / 80
# offset of the hole and its fit at maximum size, and tilts of the side face
PLATE_REACH = (34 + 17.5) * 2 * 60 / 20
PLATE_TILTS = 25 / 20 * np.array([0, 1, 0]), 25 / 30 * np.array([0, 0, 1])
PLATE_WORST = max(
    np.linalg.norm(moved + PLATE_REACH * moved * [1, 1, 0] / np.hypot(*moved[:2]))
    for moved in (np.cross(tilt, [80, 0, 60]) for tilt in PLATE_TILTS)
)
_GROWN = grown_mean_square(25, 9)
_TILT = np.array([(25 / 20) ** 2, (25 / 30) ** 2]) / 6  # about y and z, in a rhombus
CASES = {
    "shaft": (SHAFT, SHAFT_WORST, [np.sqrt(bore_variance(10, 15, 200))] * 2 + [0]),
    "guide": (GUIDE, GUIDE_WORST, None),
    "link": (LINK, np.hypot(500, 300 * 400 / 30),
             [500 / np.sqrt(3), 0, 300 * 400 / 30 / 2]),
    "plate": (PLATE, PLATE_WORST, np.sqrt([
        bore_variance(np.sqrt(_GROWN), 20, 60) + _TILT[0] * 60**2,
        bore_variance(np.sqrt(_GROWN), 20, 60) + _TILT[1] * 80**2,
        _TILT[0] * 80**2,
    ])),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_worst_case_of_callouts_equals_hand_calculation(write_file, name):
    text, expected, _ = CASES[name]
    worst = worst_pose(home_posture(read_robot(write_file(text))))
    assert worst.attained == pytest.approx(expected * um, rel=1e-6)
    assert worst.attained <= worst.bound <= worst.attained * 1.001


@pytest.mark.parametrize("name", ["shaft", "link", "plate"])
def test_standard_deviations_of_callouts_equal_hand_calculation(write_file, name):
    """For 200 000 draws, the error of the standard deviation is about 0.3 %."""
    text, _, expected = CASES[name]
    moved = translations(read_robot(write_file(text)))
    assert moved.std(axis=0) == pytest.approx(np.array(expected) * um, rel=0.006)


def translations(robot):
    """Return platform translations due to random errors, without clearances."""
    sources, prepared = sources_of(robot), linear_response(home_posture(robot))
    errors = sources.errors(sources.draw(0, 200_000, 3)).reshape(200_000, -1)
    return errors @ prepared.platform[3:].T


def test_variance_of_a_bracket_includes_the_datum_shift(write_file):
    """A bore of 20 mm length has position 0.04 mm and perpendicularity 0.02 mm. The
    expected values are those of an independent sample of both ends in discs. The datum
    shift of up to 9 um adds a variance of 81/12 um^2 along x and y.
    """
    moved = translations(read_robot(write_file(BRACKET)))
    rng = np.random.default_rng(11)
    angle, radius = rng.uniform(0, 2 * np.pi, (2, 400_000)), rng.random((2, 400_000))
    ends = 20 * np.sqrt(radius) * np.stack([np.cos(angle), np.sin(angle)])
    tilt = (ends[:, 0] - ends[:, 1]) / 20  # mrad
    kept = np.linalg.norm(tilt, axis=0) <= 1.0
    shift = (ends.sum(axis=1) / 2)[:, kept]
    across = np.sqrt((shift**2).mean() + 81 / 12)
    along = 200 * np.sqrt((tilt[:, kept] ** 2).mean())
    assert moved.std(axis=0) == pytest.approx(
        np.array([across, across, along]) * um, rel=0.01
    )


def test_tolerance_file_rejects_callouts_at_maximum_material(tmp_path, write_file):
    robot = read_robot(write_file(PLATE))
    plan = tmp_path / "plan.toml"
    plan.write_text(
        "yield = 0.9\n[limits]\ntranslation = 3e-4\n[[tolerance]]\n"
        'callouts = ["hole on plate"]\ncost = 1.0\n'
    )
    with pytest.raises(BadInput, match="which is at maximum material, expected"):
        read_plan(plan, robot)
