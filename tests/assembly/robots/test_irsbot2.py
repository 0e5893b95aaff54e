"""IRSBot-2, compared with a reference reconstruction."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.posture import place_many, place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.random_errors import ErrorDraw, draw_errors, frames_named
from forcefit.assembly.robots.irsbot2 import (
    ERROR_FRAMES,
    ERROR_LEAST,
    ERROR_MOST,
    IRSBot2Parameters,
    drive_angle,
    irsbot2,
)
from forcefit.inputs.table import BadInput
from tests.robots_for_tests import NUMBERS, irsbot2_with, paper_frame

CASES = [
    pytest.param(case, point, id=f"{case['name']}-{point['x']}-{point['z']}")
    for case in NUMBERS["cases"]
    for point in case["points"]
]
POINTS = NUMBERS["cases"][0]["points"]


@pytest.fixture(scope="module")
def robot():
    return irsbot2()


@pytest.mark.parametrize("point", POINTS, ids=lambda p: f"{p['x']}-{p['z']}")
def test_frame_poses_equal_the_reference(robot, point):
    """The reference has a different home pose."""
    posture = place_robot(robot, pose={"tx": point["x"], "tz": point["z"]})
    T = {f.name: posture.transforms[i] for i, f in enumerate(robot.frames)}
    link, elbow = T["leg1.link_a"], T["leg1.elbow_a"]
    for found, expected in (
        (elbow[:3, 3], point["E_A"]),
        (link[:3, 3], point["F_A"]),
        (link[:3, 0], point["u_A"]),
        (link[:3, 2], point["z7_A"]),
        (T["leg1.elbow_a_first"][:3, 2], point["z6_A"]),
    ):
        assert np.abs(found - expected).max() < 1e-12
    column = posture.paths[robot.index("leg1.link_a"), :, 2]
    assert np.abs(column - point["M_1_8_column_RZ"]).max() < 1e-12
    turned = posture.coordinates[robot.index("leg1.drive")]
    home = drive_angle(IRSBot2Parameters(), 0.0, -0.5)
    # The z axis of the drive points along -y, so its angle is q of the paper.
    assert turned + home == pytest.approx(point["q_leg1"], abs=1e-12)


def test_mobility_and_overconstraint_of_irsbot2_equal_the_paper(robot):
    for x, z in [(0, -0.5), (0.4, -0.45), (-0.3, -0.2), (0.0, -0.7)]:
        found = mobility(place_robot(robot, pose={"tx": x, "tz": z}))
        assert (found.freedoms, found.locked_freedoms) == (2, 0)
        assert found.overconstraint == 8


@pytest.mark.parametrize(("case", "point"), CASES)
def test_energy_pose_and_wrenches_agree_with_the_reference(case, point):
    """The gap of the reference is about 1e-9 J."""
    robot = irsbot2_with(case)
    answer = solve_assembly(
        place_robot(robot, pose={"tx": point["x"], "tz": point["z"]})
    )
    assert answer.duality_gap() < 1e-10 * answer.energy + 1e-12
    assert answer.closure_residual() < 1e-13
    assert answer.clearance_excess() < 1e-12
    assert answer.energy == pytest.approx(point["energy"], rel=1e-9, abs=1e-11)
    # A duality gap of 1e-11 J corresponds to a relative error of 1e-5 of the screw.
    scale = np.abs(np.reshape(point["x_opt"], (2, 3))).max(axis=1).repeat(3)
    assert np.abs((answer.platform_screw - point["x_opt"]) / scale).max() < 1e-5
    # The scale is sqrt(2 E C_ii), the deformation if one link contains all energy.
    size = np.sqrt(2 * answer.energy * np.diag(np.linalg.inv(NUMBERS["K_E"])))
    link = answer.link_screws[robot.index("leg1.link_a")]
    assert np.abs((link - point["e_leg1_frame8"]) / size).max() < 1e-5
    for key, value in point["b_rz"].items():
        found = answer.joint_screws[robot.index(paper_frame(key)), 2]
        assert found == pytest.approx(value, abs=1e-5 * 2e-2)
    for key, value in point["link_wrench"].items():
        leg, letter = key.split("_")
        row = robot.index(f"{leg}.link_{letter.lower()}")
        at_platform = np.linalg.inv(answer.posture.paths[row]).T @ answer.wrenches[row]
        size = np.abs(np.reshape(value, (2, 3))).max(axis=1).repeat(3)
        assert np.abs((at_platform - value) / size).max() < 1e-5


@pytest.mark.parametrize(("case", "point"), CASES)
def test_zone_margin_agrees_with_the_reference(case, point):
    posture = place_robot(irsbot2_with(case), pose={"tx": point["x"], "tz": point["z"]})
    for compliant in ("rigid", "free"):
        zone = zone_margin(posture, compliant)
        expected = point[f"t_compliant_{compliant}"]
        # Most relative gaps are 1e-10, some are between 1e-9 and 1e-8.
        assert zone.bound == pytest.approx(zone.margin, rel=1e-8)
        assert zone.bound * (1 - 1e-9) <= expected <= zone.margin * (1 + 1e-9)
        assert zone.assemblable == (expected <= 1)


def test_equation_23_as_printed_doubles_the_wrench():
    """Eq. (23) adds w_E and w_B, each of which equals the wrench."""
    point = NUMBERS["cases"][0]["points"][0]
    answer = solve_assembly(
        place_robot(irsbot2_with(NUMBERS["cases"][0]), pose={"tx": 0, "tz": -0.5})
    )
    robot = answer.posture.robot
    for leg in ("leg1", "leg2"):
        row = robot.index(f"{leg}.link_a")
        true = np.linalg.inv(answer.posture.paths[row]).T @ answer.wrenches[row]
        assert np.allclose(point["seed_eq23_wrench"][leg], 2 * true, rtol=1e-8)


def test_energies_with_euler_and_timoshenko_links_are_equal():
    """The distal links transmit no shear force."""
    case = NUMBERS["cases"][0]
    energies = []
    for theory in ("euler", "timoshenko"):
        robot = irsbot2(IRSBot2Parameters(theory=theory)).with_errors(
            irsbot2_with(case).errors
        )
        posture = place_robot(robot, pose={"tx": 0.0, "tz": -0.5})
        energies.append(solve_assembly(posture).energy)
    assert energies[1] == pytest.approx(energies[0], rel=1e-9)
    point = case["points"][0]
    assert energies[1] == pytest.approx(point["energy_timoshenko"], rel=1e-10)


def test_random_errors_with_seed_1_equal_the_reference(robot):
    frames = frames_named(robot, ERROR_FRAMES)
    draw = ErrorDraw(frames, ERROR_LEAST, ERROR_MOST, seed=1)
    expected = irsbot2_with(NUMBERS["cases"][0]).errors
    assert np.abs(draw_errors(robot, draw) - expected).max() == 0.0
    signed = draw_errors(robot, ErrorDraw(frames, ERROR_LEAST, ERROR_MOST, 1, "signed"))
    assert np.array_equal(np.abs(signed), expected)
    assert 20 < np.sum(signed < 0) < 52  # of 72 random signs


def test_reached_grid_points_agree_with_the_reach_of_the_links(robot):
    """The points are one row of the half workspace."""
    x = np.arange(-0.7, 0.7001, 0.05)
    poses = np.full((len(x), 6), np.nan)
    poses[:, 0], poses[:, 2] = x, -0.4
    postures, reasons = place_many(robot, poses)
    for value, posture, reason in zip(x, postures, reasons, strict=True):
        reach = [np.hypot(s * value - 0.113, -0.4 - 0.003342) for s in (1, -1)]
        within = 0.11586 < min(reach) and max(reach) < 0.75786
        assert (posture is not None) == within
        assert bool(reason) != within


def test_home_pose_out_of_reach_is_rejected():
    with pytest.raises(BadInput, match=r"requires a reach of 0.9\d* m, the links"):
        irsbot2(z=-0.9)
