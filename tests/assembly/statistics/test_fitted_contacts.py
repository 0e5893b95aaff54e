"""Fits of bores and bearings: hole and shaft have one clearance at both ends.

12 H7/g6: hole 0 to 18 um, shaft -17 to -6 um over 12 mm, so the radial clearance is 3
to 17.5 um, of uniform sizes 10.25 um with a deviation of sqrt(18^2 + 11^2)/sqrt(12)/2.
8 H8/h7: 0 to 22 and -15 to 0 um, radial 0 to 18.5 um, on average 9.25 um.
"""

import numpy as np
import pytest

from forcefit import BadInput, worst_pose
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws

FIRST = np.sqrt((18.0**2 + 11.0**2) / 12) / 2 * 1e-6  # [m] deviation of 12 H7/g6
SECOND = np.sqrt((22.0**2 + 15.0**2) / 12) / 2 * 1e-6  # [m] of 8 H8/h7
SPINDLE = """
format = 2
platform = "shaft"
platform_at = [0, 0, "200 mm"]
body = [{{ name = "shaft" }}]
[[joint]]
name = "bore"
type = "{kind}"
between = ["base", "shaft"]
at = [0, 0, 0]
axis = [0, 0, 1]
{more}
"""
BORE = 'clearance = { fit = "12 H7/g6", length = "40 mm" }'
BEARINGS = """clearance = { bearings = [
    { z = "-20 mm", fit = "12 H7/g6" }, { z = "30 mm", fit = "8 H8/h7" },
] }"""


def spindle(tmp_path, clearance, kind="revolute", more="\nactuated = true"):
    path = tmp_path / "spindle.toml"
    path.write_text(SPINDLE.format(kind=kind, more=clearance + more))
    return read_robot(path)


def worst(robot, quantity):
    return worst_pose(linear_response(home_posture(robot)), sources_of(robot), quantity)


def drawn_rotations(robot):
    experiment = Experiment(home_posture(robot), sources_of(robot), margins=False)
    return run_draws(experiment, 400)["rotation"].values


def test_worst_case_of_a_bore_with_a_fit_is_at_its_largest_clearance(tmp_path):
    """2 c / L and, 200 mm above the middle, 2 c h / L with c = 17.5 um."""
    robot = spindle(tmp_path, BORE)
    assert worst(robot, "rotation").attained == pytest.approx(875e-6, rel=1e-6)
    assert worst(robot, "translation").attained == pytest.approx(175e-6, rel=1e-6)


def test_commands_with_a_single_clearance_use_the_mean_clearance_of_a_bore(tmp_path):
    fitted = spindle(tmp_path, BORE)
    stated = spindle(tmp_path, 'clearance = { radial = "10.25 um", length = "40 mm" }')
    assert [f.name for f in fitted.frames] == [f.name for f in stated.frames]
    for one, other in zip(fitted.frames, stated.frames, strict=True):
        tilts = [getattr(f.clearance, "tilt", None) or 0.0 for f in (one, other)]
        assert tilts[0] == pytest.approx(tilts[1], rel=1e-12)
    (remark,) = fitted.remarks
    assert '"bore" 12 H7/g6, 10.25 um of 3 to 17.5' in remark


def test_both_ends_of_a_bore_have_the_same_drawn_clearance(tmp_path):
    """Rotation 2 c / L has the deviation of c; independent ends would have 0.71 of it.

    Three standard errors of 400 draws are 4.5 % of the mean and 11 % of the deviation.
    """
    found = drawn_rotations(spindle(tmp_path, BORE)) * 0.04 / 2
    assert found.mean() == pytest.approx(10.25e-6, rel=0.045)
    assert found.std() == pytest.approx(FIRST, rel=0.11)
    assert 3e-6 < found.min()
    assert found.max() < 17.5e-6 * (1 + 1e-3)


def test_two_bearings_have_independent_fit_clearances(tmp_path):
    """Rotation (c1 + c2) / 50 mm, of variance FIRST^2 + SECOND^2."""
    robot = spindle(tmp_path, BEARINGS)
    found = drawn_rotations(robot) * 0.05
    assert found.mean() == pytest.approx(10.25e-6 + 9.25e-6, rel=0.045)
    assert found.std() == pytest.approx(np.hypot(FIRST, SECOND), rel=0.11)
    names = [fit.name for fit in sources_of(robot).fits]
    assert sorted(names) == [
        "fit 12 H7/g6 of bore.bearing_1", "fit 8 H8/h7 of bore.bearing_2"
    ]  # fmt: skip


def test_worst_case_of_two_bearings_with_fits_equals_hand_calculation(tmp_path):
    """Offsets 17.5 um at -20 mm and -18.5 um at 30 mm: 141.1 um at 200 mm."""
    robot = spindle(tmp_path, BEARINGS)
    slope = (17.5e-6 + 18.5e-6) / 0.05
    assert worst(robot, "rotation").attained == pytest.approx(slope, rel=1e-6)
    reach = 18.5e-6 + slope * 0.17
    assert worst(robot, "translation").attained == pytest.approx(reach, rel=1e-6)


def test_bearing_with_a_given_gap_has_the_same_gap_in_every_draw(tmp_path):
    clearance = BEARINGS.replace('fit = "8 H8/h7"', 'radial = "5 um"')
    found = drawn_rotations(spindle(tmp_path, clearance)) * 0.05
    assert found.mean() == pytest.approx(15.25e-6, rel=0.045)
    assert found.std() == pytest.approx(FIRST, rel=0.11)


def test_cylindrical_and_universal_joints_have_bores_with_fits(tmp_path):
    """Tilts of 17.5 um / 40 mm and 18.5 um / 25 mm at most."""
    slide = spindle(tmp_path, BORE, "cylindrical", "")
    (fit,) = sources_of(slide).fits
    assert fit.name == "fit 12 H7/g6 of bore.turn"
    assert len(fit.bounds) == 2
    cross = """clearance = [
        { fit = "12 H7/g6", length = "40 mm" }, { fit = "8 H8/h7", length = "25 mm" },
    ]
    axis2 = [1, 0, 0]"""
    sources = sources_of(spindle(tmp_path, cross, "universal", ""))
    tilts = {
        frame.name: frame.clearance.tilt
        for frame in sources.with_largest_clearances().frames if frame.clearance
    }  # fmt: skip
    assert tilts == pytest.approx({
        "bore.first.bore_start": 437.5e-6, "bore.first.bore_end": 437.5e-6,
        "bore.second.bore_start": 740e-6, "bore.second.bore_end": 740e-6,
    })  # fmt: skip


@pytest.mark.parametrize("clearance", [BORE, BEARINGS])
def test_fitted_contacts_are_preserved_in_a_file_of_frames(tmp_path, clearance):
    robot = spindle(tmp_path, clearance)
    write_robot(robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    assert again.fits == robot.fits
    assert again.fitted_ends == robot.fitted_ends
    for one, other in zip(robot.frames, again.frames, strict=True):
        assert one.clearance == other.clearance


@pytest.mark.parametrize(
    ("clearance", "message"),
    [
        ('{ fit = "25 H7/p6", length = "40 mm" }', 'fit: found "25 H7/p6", an int'),
        ('{ fit = "12 H7/g6", radial = 1e-5, length = 0.04 }', "radial: found to"),
        ('{ fit = "12 H7/g6", tilt = 1e-3, length = 0.04 }', "tilt: found together"),
        ('{ fit = "12 H7/g6", length = 0 }', "length: found 0, expected"),
        (
            '{ fit = "12 H7/g6", bearings = [{ z = 0, radial = 0 }, '
            "{ z = 0.1, radial = 0 }] }",
            'fit: found together with "bearings", expected it in each bearing',
        ),
        (
            '{ bearings = [{ z = 0, fit = "12 H7/g6", radial = 0 }, '
            "{ z = 0.1, radial = 0 }] }",
            'bearings[1].radial: found together with "fit"',
        ),
        (
            '{ bearings = [{ z = 0, fit = "12 H7/z6" }, { z = 0.1, radial = 0 }] }',
            'bearings[1].fit: found "z6"',
        ),
        ('{ bearings = [{ z = 0 }, { z = 0.1, radial = 0 }] }', "[1].radial: missing"),
    ],
)  # fmt: skip
def test_mistake_in_a_fitted_contact_is_reported_in_one_line(
    tmp_path, clearance, message
):
    with pytest.raises(BadInput) as error:
        spindle(tmp_path, f"clearance = {clearance}")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


BOLTED = """
format = 2
platform = "plate"
platform_at = [0, 0, 0]
body = [{ name = "plate" }]
joint = [
    { name = "pin", type = "fixed", between = ["base", "plate"], at = [0, 0, 0] },
    { name = "slot", type = "fixed", between = ["base", "plate"], at = [0.1, 0, 0], locked_at = "home", clearance = { CLEARANCE } },
]
tolerance = [{ feature = "slot", datums = ["pin"], length = "100 +- 0.03 mm" }]
"""  # noqa: E501


@pytest.mark.parametrize(
    ("clearance", "largest", "share"),
    [('fit = "12 H7/g6"', 17.5e-6, 10.25 / 30), ("radial = 12e-6", 12e-6, 0.4)],
)
def test_bolted_slot_assembles_if_its_clearance_covers_the_error(
    write_file, clearance, largest, share
):
    """A rigid plate closes only if the clearance c exceeds the error e of the length: e
    is uniform up to 30 um, so the yield is the mean of c over 30 um.

    Three standard errors of 500 draws are 0.066.
    """
    robot = read_robot(write_file(BOLTED.replace("CLEARANCE", clearance)))
    sources = sources_of(robot)
    bolt = sources.with_largest_clearances().frame("slot").locked_at
    assert bolt.clearance.radial == pytest.approx(largest)
    experiment = Experiment(home_posture(robot), sources)
    data = run_draws(experiment, 500)
    solved = data["status"].values == 0
    assert solved.mean() == pytest.approx(share, abs=0.066)
    assert np.isnan(data["energy"].values[~solved]).all()
    assert data["translation"].values[solved].max() < 1e-12
    again = experiment.solve(137, 1)["status"]
    assert again[0] == data["status"].values[137]


FRAMES = """
platform = "a"
frame = [
    { name = "a", parent = "base", clearance = { fit = "12 H7/g6", length = 0.04, parts = "pin" } },
    { name = "b", parent = "a", clearance = { fit = "12 H7/g6", length = 0.04, parts = "pin" } },
]
"""  # noqa: E501


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (', parts = "pin"', "", "clearance.parts: missing"),
        ('fit = "12 H7/g6", ', "", "clearance.fit: missing"),
        ("length", "tilt = 1e-3, length", 'clearance.tilt: found together with "le'),
        ("12 H7/g6", "12 H7/h6", 'clearance.fit: found "12 H7/g6" of the parts "pin"'),
        ("length = 0.04", "length = -1", "clearance.length: found -1"),
    ],
)
def test_mistake_in_a_fitted_frame_is_reported_in_one_line(
    write_file, old, new, message
):
    with pytest.raises(BadInput) as error:
        read_robot(write_file(FRAMES.replace(old, new, 1)))
    assert message in str(error.value)
    assert "\n" not in str(error.value)
