"""Clearances of fits at the ends of bores and at bearings.

In 12 H7/g6, the deviations of the hole are 0 to 18 um and those of the shaft -17 to -6
um. The radial clearance is 3 to 17.5 um, with a mean of 10.25 um and a standard
deviation of sqrt((18^2 + 11^2)/12)/2. In 8 H8/h7, the deviations are 0 to 22 um and -15
to 0 um. The radial clearance is 0 to 18.5 um, with a mean of 9.25 um.
"""

import numpy as np
import pytest

from forcefit import BadInput, worst_pose
from forcefit.assembly.files.robot_file import read_robot, write_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.monte_carlo import run_draws

FIRST = np.sqrt((18.0**2 + 11.0**2) / 12) / 2 * 1e-6  # [m] std. dev. of 12 H7/g6
SECOND = np.sqrt((22.0**2 + 15.0**2) / 12) / 2 * 1e-6  # [m] std. dev. of 8 H8/h7
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
    return worst_pose(home_posture(robot), quantity=quantity).attained


def drawn_rotations(robot):
    experiment = Experiment(home_posture(robot), sources_of(robot), margins=False)
    return run_draws(experiment, 400)["rotation"].values


def test_worst_case_of_a_fit_has_the_largest_clearance(tmp_path):
    """For c = 17.5 um, the rotation is 2 c / L. At h = 200 mm above the middle of the
    bore, the translation is 2 c h / L.
    """
    robot = spindle(tmp_path, BORE)
    assert worst(robot, "rotation") == pytest.approx(875e-6, rel=1e-6)
    assert worst(robot, "translation") == pytest.approx(175e-6, rel=1e-6)


def test_nominal_clearance_of_a_fit_is_its_mean(tmp_path):
    fitted = spindle(tmp_path, BORE)
    stated = spindle(tmp_path, 'clearance = { radial = "10.25 um", length = "40 mm" }')
    assert [f.name for f in fitted.frames] == [f.name for f in stated.frames]
    for one, other in zip(fitted.frames, stated.frames, strict=True):
        tilts = [getattr(f.clearance, "tilt", None) or 0.0 for f in (one, other)]
        assert tilts[0] == pytest.approx(tilts[1], rel=1e-12)
    (remark,) = fitted.remarks
    assert '"bore" 12 H7/g6, 10.25 um of 3 to 17.5' in remark


def test_both_ends_of_a_bore_have_the_same_random_clearance(tmp_path):
    """The rotation is 2 c / L, so its standard deviation is that of c times 2 / L.

    For 400 draws, three standard errors are 4.5 % of the mean and 11 % of the standard
    deviation.
    """
    found = drawn_rotations(spindle(tmp_path, BORE)) * 0.04 / 2
    assert found.mean() == pytest.approx(10.25e-6, rel=0.045)
    assert found.std() == pytest.approx(FIRST, rel=0.11)
    assert 3e-6 < found.min()
    assert found.max() < 17.5e-6 * (1 + 1e-3)


def test_two_bearings_have_independent_clearances(tmp_path):
    """The rotation is (c1 + c2) / 50 mm, and c1 + c2 has the variance FIRST^2 +
    SECOND^2.
    """
    robot = spindle(tmp_path, BEARINGS)
    found = drawn_rotations(robot) * 0.05
    assert found.mean() == pytest.approx(10.25e-6 + 9.25e-6, rel=0.045)
    assert found.std() == pytest.approx(np.hypot(FIRST, SECOND), rel=0.11)
    names = [fit.name for fit in sources_of(robot).fits]
    assert sorted(names) == [
        "fit 12 H7/g6 of bore.bearing_1", "fit 8 H8/h7 of bore.bearing_2"
    ]  # fmt: skip


def test_worst_case_of_two_bearings_with_fits_equals_hand_calculation(tmp_path):
    """Offsets of 17.5 um at -20 mm and -18.5 um at 30 mm add to 141.1 um at 200 mm."""
    robot = spindle(tmp_path, BEARINGS)
    slope = (17.5e-6 + 18.5e-6) / 0.05
    assert worst(robot, "rotation") == pytest.approx(slope, rel=1e-6)
    reach = 18.5e-6 + slope * 0.17
    assert worst(robot, "translation") == pytest.approx(reach, rel=1e-6)


def test_bearing_without_a_fit_has_a_constant_clearance(tmp_path):
    clearance = BEARINGS.replace('fit = "8 H8/h7"', 'radial = "5 um"')
    found = drawn_rotations(spindle(tmp_path, clearance)) * 0.05
    assert found.mean() == pytest.approx(15.25e-6, rel=0.045)
    assert found.std() == pytest.approx(FIRST, rel=0.11)


def test_cylindrical_and_universal_joints_accept_fits(tmp_path):
    """The largest tilts are 17.5 um / 40 mm and 18.5 um / 25 mm."""
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
def test_fits_are_preserved_in_a_file_of_frames(tmp_path, clearance):
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
        ('fit = "25 H7/p6", length = "40 mm"', 'fit: found "25 H7/p6", an int'),
        ('fit = "12 H7/g6", radial = 1e-5, length = 0.04', "radial: found to"),
        ('fit = "12 H7/g6", tilt = 1e-3, length = 0.04', "tilt: found together"),
        ('fit = "12 H7/g6", length = 0', "length: found 0, expected"),
        ('fit = "12 H7/g6", bearings = [{ z = 0, radial = 0 }, { z = 1, radial = 0 }]',
         'fit: found together with "bearings", expected it in each bearing'),
        ('bearings = [{ z = 0, fit = "12 H7/g6", radial = 0 }, { z = 1, radial = 0 }]',
         'bearings[1].radial: found together with "fit"'),
        ('bearings = [{ z = 0, fit = "12 H7/z6" }, { z = 1, radial = 0 }]',
         'bearings[1].fit: found "z6"'),
        ('bearings = [{ z = 0 }, { z = 1, radial = 0 }]', "[1].radial: missing"),
    ],
)  # fmt: skip
def test_invalid_fit_of_a_joint_is_rejected_with_one_line(tmp_path, clearance, message):
    with pytest.raises(BadInput) as error:
        spindle(tmp_path, f"clearance = {{ {clearance} }}")
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
def test_yield_of_a_bolted_slot_equals_hand_calculation(
    write_file, clearance, largest, share
):
    """A rigid plate can be bolted only if the length error is smaller than the
    clearance. The error is uniform up to 30 um, so the yield is the mean clearance
    divided by 30 um.

    For 500 draws, three standard errors are 0.066.
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
        ("12 H7/g6", "12 H7/h6", 'clearance.fit: found "12 H7/g6" for the parts "pin"'),
        ("length = 0.04", "length = -1", "clearance.length: found -1"),
    ],
)
def test_invalid_fit_of_a_frame_is_rejected_with_one_line(
    write_file, old, new, message
):
    with pytest.raises(BadInput) as error:
        read_robot(write_file(FRAMES.replace(old, new, 1)))
    assert message in str(error.value)
    assert "\n" not in str(error.value)
