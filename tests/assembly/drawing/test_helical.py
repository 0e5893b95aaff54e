"""Helical joints with a screw and a nut."""

import numpy as np
import pytest

from forcefit.assembly.exact.exact import solve_exact
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.kinematics.verdict import limits_passed
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.as_printed import energy_as_printed
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.model.error_distributions import tolerance_sources
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from tests.screws_for_tests import DIFFERENTIAL, LIFT, NUT

METHODS = ["compiled", "reference"]
LEAD = 0.005 / (2 * np.pi)  # [m/rad] lead of the screw


@pytest.fixture
def read(tmp_path):
    def robot(text=LIFT):
        (tmp_path / "lift.toml").write_text(text)
        return read_robot(tmp_path / "lift.toml")

    return robot


def test_screw_lift_has_one_degree_of_freedom(read):
    """The column and the screw constrain the same two rotations and one translation."""
    found = mobility(home_posture(read()))
    assert (found.freedoms, found.platform_freedoms) == (1, 1)
    assert (found.freedoms_drives_locked, found.redundant_constraints) == (0, 3)


def test_rotation_of_screw_by_360_degrees_moves_table_by_pitch(read):
    """A rotation of a right-hand screw about +z lowers the table."""
    for text, step in ((LIFT, -0.005), (LIFT.replace('"5 mm"', '"-5 mm"'), 0.005)):
        pose = place_robot(read(text), joints={"bearing": 2 * np.pi}).pose()
        expected = [0.3, 0, 0.4 + step, 0, 0, 0]
        assert list(pose.values()) == pytest.approx(expected, abs=1e-14)


def test_height_of_400_mm_requires_80_screw_rotations(read):
    at = place_robot(read(), pose={"tz": 0.8})
    angle = at.coordinates[at.robot.index("bearing")]
    assert angle == pytest.approx(-80 * 2 * np.pi, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_platform_compliance_is_lead_squared_over_drive_stiffness(method, read):
    C = platform_stiffness(home_posture(read()), method=method).compliance
    expected = np.zeros((6, 6))
    expected[5, 5] = LEAD**2 / 200
    assert expected[5, 5] == pytest.approx(3.16629e-9, rel=1e-6)
    assert np.abs(C - expected).max() < 1e-12 * expected[5, 5]


@pytest.mark.parametrize("method", METHODS)
def test_energy_of_loaded_lift_equals_energy_of_drive_spring(method, read):
    """The energy is F^2 lead^2 / (2 k)."""
    at, load = home_posture(read()), [0, 0, 0, 0, 0, 1000.0]
    found = solve_assembly(at, load, method=method)
    energy = 1e6 * LEAD**2 / 400
    assert found.energy == pytest.approx(energy, rel=1e-12)
    assert found.clearance_excess() < 1e-12
    assert found.platform_screw[5] == pytest.approx(1e3 * LEAD**2 / 200, rel=1e-12)
    assert solve_exact(at, load).energy == pytest.approx(energy, rel=1e-9)


def test_drive_rotation_under_weight_equals_hand_calculation(read):
    """The moment is m g times the lead."""
    found = solve_assembly(home_posture(read()), gravity=[0, 0, -9.81])
    turn = found.joint_screws[found.posture.robot.index("bearing"), 2]
    assert turn == pytest.approx(8 * 9.81 * LEAD / 200, rel=1e-12)


def test_natural_frequency_of_the_lift_equals_hand_calculation(read):
    found = natural_modes(home_posture(read()))
    expected = np.sqrt(200 / LEAD**2 / 8) / (2 * np.pi)
    assert found.frequencies == pytest.approx([expected], rel=1e-9)


def test_rotation_error_of_screw_moves_table_by_lead(read):
    """The linear model is exact, because all axes are parallel."""
    robot, errors = read(), np.zeros((6, 6))
    errors[robot.index("bearing"), 2] = 0.3
    at = home_posture(robot.with_errors(errors))
    expected = [0, 0, 0, 0, 0, -0.3 * LEAD]
    for found in (solve_assembly(at), solve_exact(at)):
        np.testing.assert_allclose(found.platform_screw, expected, rtol=0, atol=1e-12)
    drawn = linear_response(home_posture(robot)).solve(np.stack([errors, -errors]))
    np.testing.assert_allclose(drawn.platform_screw[:, 5], [-0.3 * LEAD, 0.3 * LEAD])


def test_differential_screw_moves_by_difference_of_pitches(read):
    """A rotation by 360 degrees moves the table by 5 mm - 4 mm."""
    robot = read(DIFFERENTIAL)
    pose = place_robot(robot, joints={"coarse": 2 * np.pi}).pose()
    assert pose["tz"] == pytest.approx(0.101, abs=1e-14)
    C = platform_stiffness(home_posture(robot)).compliance
    assert C[5, 5] == pytest.approx((0.001 / (2 * np.pi)) ** 2 / 50, rel=1e-9)


@pytest.mark.parametrize(("guide", "row", "most"), [
    ("revolute", 2, 25e-6 / 0.004 * 2 * np.pi), ("prismatic", 5, 25e-6),
])  # fmt: skip
def test_axial_clearance_of_a_nut_permits_translation_or_rotation(
    guide, row, most, read
):
    """An axial clearance of +-25 um permits 39.3 mrad for a pitch of 4 mm."""
    robot = read(NUT.replace('"revolute"', f'"{guide}"'))
    bound = bound_pose_error(solve_assembly(home_posture(robot)))
    error = bound.rotation_error if row == 2 else bound.translation_error
    assert most == pytest.approx([39.27e-3, 25e-6][row == 5], rel=1e-4)
    assert np.ravel(error) == pytest.approx([most, most], rel=1e-3)


def test_random_positions_of_a_nut_are_uniform(read):
    """The mean of |TZ| is half the axial clearance."""
    at = home_posture(read(NUT.replace('"revolute"', '"prismatic"')))
    sources = tolerance_sources(at.robot, [0, 0, 0, 0, 0, 1e-12])
    data = run_draws(Experiment(at, sources, clearance="uniform"), 400)
    sizes = data["translation"].values / 25e-6
    assert sizes.max() == pytest.approx(1.0, abs=0.02)
    assert sizes.mean() == pytest.approx(0.5, abs=1 / 23)


SPRUNG = LIFT.replace("pitch =", (
    "clearance = { radial = 1e-5, axial = 2e-5, tilt = 1e-4 }\n"
    "joint_stiffness = [2e4, 2e4, 0, 1e8, 1e8, 5e7]\npitch ="
))  # fmt: skip


@pytest.mark.parametrize("seed", [1, 2])
def test_energies_of_three_methods_agree_for_a_loaded_lift(seed, read):
    """In the problem of the paper, the thread is an additional constraint."""
    robot, rng = read(SPRUNG), np.random.default_rng(seed)
    robot = robot.with_errors(rng.normal(size=(len(robot.frames), 6)) * 1e-4)
    at, load = home_posture(robot), rng.normal(size=6) * 100
    found, expected = (solve_assembly(at, load, method=method) for method in METHODS)
    assert found.method == "compiled"
    assert found.energy == pytest.approx(expected.energy, rel=1e-9)
    energy, screw = energy_as_printed(at, load)
    assert energy == pytest.approx(expected.energy, rel=1e-5)
    np.testing.assert_allclose(screw, found.platform_screw, rtol=0, atol=1e-9)
    assert expected.energy > 1e-3


def test_predicted_reading_is_proportional_to_pitch(read):
    """A rotation error of 1 mrad moves the table by 1 mrad times the lead."""
    for pitch in (0.005, 0.009):
        robot = read(LIFT.replace('"5 mm"', str(pitch)))
        errors = np.zeros((6, 6))
        errors[robot.index("bearing"), 2] = 1e-3
        at = home_posture(robot.with_errors(errors))
        found = predict(as_declared(at, np.zeros(6))).deviation[0]
        assert found[5] == pytest.approx(-1e-3 * pitch / (2 * np.pi), rel=1e-9)


def test_nut_rotation_above_its_limit_is_reported(read):
    """A coordinate of 7 rad exceeds a limit of 6 rad."""
    robot = read(LIFT.replace("pitch =", "limits = [-6.0, 6.0]\npitch ="))
    at = place_robot(robot, joints={"bearing": -7.0})
    assert limits_passed(robot, at.coordinates) == "nut at 7 rad, limits -6 to 6"
