"""Screws and nuts: a turn that is a shift as well."""

from pathlib import Path

import numpy as np
import pytest

from assembly.exact.exact import solve_exact
from assembly.exchange.convert import convert
from assembly.exchange.robot_files import load_robot
from assembly.files.robot_file import read_robot, write_robot
from assembly.kinematics.mobility import mobility
from assembly.kinematics.posture import home_posture, place_robot
from assembly.linear.energy import solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.platform_stiffness.platform_stiffness import platform_stiffness
from assembly.platform_stiffness.vibration import natural_modes
from forcefit.inputs.table import BadInput

CASES = Path(__file__).parents[4] / "shared" / "cases" / "robots_drawn"
LIFT = """
format = 2
name = "screw_lift"
platform = "table"
platform_at = [0.3, 0, 0.4]
[[body]]
name = "screw"
[[body]]
name = "table"
mass = 8
centre = [0.2, 0, 0.4]
[[joint]]
name = "bearing"
type = "revolute"
between = ["base", "screw"]
at = [0, 0, 0]
axis = [0, 0, 1]
actuated = true
drive_stiffness = 200
[[joint]]
name = "nut"
type = "helical"
pitch = "5 mm"
between = ["screw", "table"]
at = [0, 0, 0.4]
axis = [0, 0, 1]
[[joint]]
name = "column"
type = "cylindrical"
between = ["base", "table"]
at = [0.2, 0, 0.2]
axis = [0, 0, 1]
"""
LEAD = 0.005 / (2 * np.pi)  # [m/rad]


@pytest.fixture
def read(tmp_path):
    def robot(text=LIFT):
        (tmp_path / "lift.toml").write_text(text)
        return read_robot(tmp_path / "lift.toml")

    return robot


def test_a_screw_lift_has_one_freedom(read):
    """The table cannot turn: the column is beside the screw, three times too many."""
    found = mobility(home_posture(read()))
    assert (found.freedoms, found.platform_freedoms) == (1, 1)
    assert (found.freedoms_drives_locked, found.redundant_constraints) == (0, 3)


def test_a_nut_kept_from_turning_moves_by_the_pitch_in_a_turn(read):
    """Down where a right-hand screw turns as its axis points, up where a left-hand."""
    for text, step in ((LIFT, -0.005), (LIFT.replace('"5 mm"', '"-5 mm"'), 0.005)):
        pose = place_robot(read(text), joints={"bearing": 2 * np.pi}).pose()
        expected = [0.3, 0, 0.4 + step, 0, 0, 0]
        assert list(pose.values()) == pytest.approx(expected, abs=1e-14)


def test_a_pose_of_the_table_is_reached_by_the_screw(read):
    at = place_robot(read(), pose={"tz": 0.41})
    angle = at.coordinates[at.robot.index("bearing")]
    assert angle == pytest.approx(-0.01 / LEAD, rel=1e-12)


@pytest.mark.parametrize("method", ["compiled", "reference"])
def test_the_compliance_of_a_screw_is_its_drives_times_its_lead_squared(method, read):
    C = platform_stiffness(home_posture(read()), method=method).compliance
    expected = np.zeros((6, 6))
    expected[5, 5] = LEAD**2 / 200
    assert np.abs(C - expected).max() < 1e-12 * expected[5, 5]


@pytest.mark.parametrize("method", ["compiled", "reference"])
def test_a_screw_gives_way_under_a_load_with_a_proved_energy(method, read):
    """F^2 lead^2 / 2 k, and with finite motions the same: the table moves straight."""
    at, load = home_posture(read()), [0, 0, 0, 0, 0, 1000.0]
    found = solve_assembly(at, load, method=method)
    energy = 1e6 * LEAD**2 / 400
    assert found.energy == pytest.approx(energy, rel=1e-12)
    assert found.clearance_excess() < 1e-12
    assert found.platform_screw[5] == pytest.approx(1e3 * LEAD**2 / 200, rel=1e-12)
    assert solve_exact(at, load).energy == pytest.approx(energy, rel=1e-9)


def test_the_weight_of_a_table_turns_its_screw(read):
    """Of 8 kg, at rest: the drive carries m g times the lead."""
    found = solve_assembly(home_posture(read()), gravity=[0, 0, -9.81])
    turn = found.joint_screws[found.posture.robot.index("bearing"), 2]
    assert turn == pytest.approx(8 * 9.81 * LEAD / 200, rel=1e-12)


def test_the_frequency_of_a_table_is_that_of_its_mass_on_the_screw(read):
    found = natural_modes(home_posture(read()))
    expected = np.sqrt(200 / LEAD**2 / 8) / (2 * np.pi)
    assert found.frequencies == pytest.approx([expected], rel=1e-9)


NUT = """
format = 2
platform = "nut"
platform_at = [0, 0, 0]
[[body]]
name = "nut"
[[joint]]
name = "thread"
type = "helical"
pitch = "4 mm"
between = ["base", "nut"]
at = [0, 0, 0]
axis = [0, 0, 1]
clearance = { axial = "25 um" }
[[joint]]
name = "guide"
type = "revolute"
between = ["base", "nut"]
at = [0, 0, 0]
axis = [0, 0, 1]
"""


@pytest.mark.parametrize(("guide", "row", "most"), [
    ("revolute", 2, 25e-6 / 0.004 * 2 * np.pi), ("prismatic", 5, 25e-6),
])  # fmt: skip
def test_backlash_is_along_the_thread(guide, row, most, read):
    """Tr 16 x 4 of 50 um from flank to flank: 25 um, or 39.3 mrad if only turned."""
    robot = read(NUT.replace('"revolute"', f'"{guide}"'))
    bound = bound_pose_error(solve_assembly(home_posture(robot)))
    error = bound.rotation_error if row == 2 else bound.translation_error
    assert np.ravel(error) == pytest.approx([most, most], rel=1e-3)


def test_a_driven_screw_is_elastic_along_its_thread(read):
    """K in its freedom: C = s s^T / k of the unit screw s = (0 0 1 0 0 lead)."""
    text = NUT[: NUT.index("clearance")] + "actuated = true\ndrive_stiffness = 50\n"
    C = platform_stiffness(home_posture(read(text))).compliance
    s = np.array([0, 0, 1, 0, 0, 0.004 / (2 * np.pi)])
    assert np.abs(C - np.outer(s, s) / 50).max() < 1e-14


@pytest.mark.parametrize("seed", [1, 2])
def test_compiled_and_reference_agree_on_a_screw_with_errors(seed, read):
    """A loop with springs, clearance and errors, under a load."""
    text = LIFT.replace("pitch =", (
        "clearance = { radial = 1e-5, axial = 2e-5, tilt = 1e-4 }\n"
        "joint_stiffness = [2e4, 2e4, 0, 1e8, 1e8, 5e7]\npitch ="
    ))  # fmt: skip
    robot = read(text)
    rng = np.random.default_rng(seed)
    robot = robot.with_errors(rng.normal(size=(len(robot.frames), 6)) * 1e-4)
    at, load = home_posture(robot), rng.normal(size=6) * 100
    found, expected = (
        solve_assembly(at, load, method=method) for method in ("compiled", "reference")
    )
    assert found.method == "compiled"
    assert found.energy == pytest.approx(expected.energy, rel=1e-9)
    assert expected.energy > 1e-3


def test_a_screw_is_written_and_read_again(read, tmp_path):
    robot = read()
    write_robot(robot, tmp_path / "frames.toml")
    again = read_robot(tmp_path / "frames.toml")
    assert again.frame("nut").pitch == robot.frame("nut").pitch == 0.005
    assert convert(tmp_path / "lift.toml", tmp_path / "c.toml").difference < 1e-12


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_other_programs_files_hold_no_screws(ending, read, tmp_path):
    read()
    with pytest.raises(BadInput, match=r'helical joints \("nut"\), which only robot'):
        convert(tmp_path / "lift.toml", tmp_path / f"lift.{ending}")
    assert not (tmp_path / f"lift.{ending}").exists()


def test_the_motion_of_a_nut_has_no_bound(read):
    text = LIFT.replace("pitch =", "clearance = { spin = 1e-3 }\npitch =")
    with pytest.raises(BadInput, match="spin: found one on a helical joint, exp"):
        read(text)


def test_the_example_file_loads():
    path = CASES / "screw.toml"
    if not path.exists():
        pytest.skip(f"{path} is not here")
    assert home_posture(load_robot(path)).mismatch < 1e-14
