"""Known results of the example robots with bodies and joints."""

from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.exchange.convert import convert
from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.sweeps.parameters import load_design

DRAWN = Path(__file__).parents[3] / "examples" / "drawn"
# degrees of freedom of the robot, of the platform, and of the robot with locked drives;
# number of redundant constraints
EXAMPLES = {
    "three_upu": (3, 3, 0, 0), "tricept": (3, 3, 0, 0), "agile_eye": (3, 3, 0, 6),
}  # fmt: skip


@pytest.mark.parametrize("name", EXAMPLES)
def test_example_robots_have_mobility_of_the_literature(name):
    found = mobility(home_posture(load_robot(DRAWN / f"{name}.toml")))
    assert (
        found.freedoms, found.platform_freedoms, found.freedoms_drives_locked,
        found.redundant_constraints,
    ) == EXAMPLES[name]  # fmt: skip


def test_tricept_stiffness_along_z_equals_hand_calculation():
    """The stiffness is 3 k cos^2(inclination) for three legs of stiffness k."""
    robot = load_robot(DRAWN / "tricept.toml")
    K = platform_stiffness(home_posture(robot)).stiffness
    assert K[5, 5] == pytest.approx(3 * 1.5e8 * 81 / 85, rel=1e-12)


def test_tricept_platform_rotates_with_its_tube():
    """The z axis of the platform is parallel to the tube."""
    robot = load_robot(DRAWN / "tricept.toml")
    at = place_robot(robot, {"tx": 0.1, "ty": -0.05, "tz": -0.9}).platform
    along = at[:3, 3] / np.linalg.norm(at[:3, 3])
    assert at[:3, 2] == pytest.approx(-along, abs=1e-9)


def test_agile_eye_rotates_about_its_centre():
    robot = load_robot(DRAWN / "agile_eye.toml")
    at = place_robot(robot, joints={"leg1.drive": 0.2, "leg3.drive": -0.1})
    assert at.platform[:3, 3] == pytest.approx([0, 0, 0], abs=1e-12)
    assert np.linalg.norm(list(at.pose().values())[3:]) > 0.1


@pytest.mark.parametrize("ending", ["toml", "xml", "urdf"])
def test_example_robot_is_converted_to_other_formats(ending, tmp_path):
    """The platform position is equal after reading the output files."""
    found = convert(DRAWN / "three_upu.toml", tmp_path / f"upu.{ending}")
    assert found.difference < 1e-12
    back = load_robot(tmp_path / f"upu.{ending}")
    expected = home_posture(load_robot(DRAWN / "three_upu.toml")).platform
    assert np.abs(home_posture(back).platform[:3, 3] - expected[:3, 3]).max() < 1e-12


def test_parameters_of_all_legs_can_be_varied():
    """The stiffness along z is 3 k cos^2(inclination) for a leg stiffness k."""
    design = load_design(DRAWN / "three_upu.toml")
    values = {"slide.joint_stiffness.tz": 1e3}
    names = design.find("rod.link.beam.radius")
    assert names == [f"leg{k}.rod.link.beam.radius" for k in (1, 2, 3)]
    robot = design.robot({path: 1e3 for path in design.find(next(iter(values)))})
    K = platform_stiffness(home_posture(robot)).stiffness
    assert K[5, 5] == pytest.approx(3e3 * 45**2 / (45**2 + 16**2), rel=1e-3)
