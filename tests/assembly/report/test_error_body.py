"""Sets of possible platform errors."""

from itertools import product

import numpy as np
import pytest

from forcefit import Clearance, Frame, Robot, bound_pose_error, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.report.error_body import ErrorBody, error_body
from forcefit.assembly.report.plot import plot_assembly
from forcefit.assembly.robots.irsbot2 import irsbot2


def reach_of(*plays):
    frames, above = [], "base"
    for i, play in enumerate(plays):
        frames.append(Frame(f"j{i}", above, clearance=play))
        above = f"j{i}"
    robot = Robot("chain", "tip", (*frames, Frame("tip", above)))
    return reachable_screws(solve_assembly(home_posture(robot)), "frozen")


def test_error_body_of_a_joint_clearance_is_a_cylinder():
    """For a disc of radius r and an interval of half width h, the support function is r
    sin(polar) + h cos(polar).
    """
    body = error_body(reach_of(Clearance(radial=3e-5, axial=1e-5)), "translation", 150)
    flat = np.hypot(body.directions[:, 0], body.directions[:, 1])
    expected = 3e-5 * flat + 1e-5 * np.abs(body.directions[:, 2])
    assert np.allclose(body.heights, expected, rtol=1e-8)
    assert np.abs(body.points[:, 2]).max() == pytest.approx(1e-5, rel=1e-8)
    assert body.contains([2e-5, 2e-5, 0.9e-5])
    assert not body.contains([2.5e-5, 2.5e-5, 0])
    assert len(body.faces) > 10
    assert body.slack < 1e-12


def test_flat_error_body_has_points_and_no_faces():
    body = error_body(reach_of(Clearance(radial=3e-5)), "translation", 60)
    assert len(body.faces) == 0
    assert np.abs(body.points[:, 2]).max() < 1e-15
    assert np.hypot(*body.points[:, :2].T).max() == pytest.approx(3e-5, rel=1e-8)


def test_farthest_point_of_the_error_body_is_within_the_certified_bounds():
    answer = solve_assembly(place_robot(irsbot2(), pose={"tx": 0.1, "tz": -0.5}))
    body = error_body(reachable_screws(answer, "frozen"), "rotation", 100)
    found = bound_pose_error(answer, "frozen")
    farthest = np.linalg.norm(body.points, axis=1).max()
    assert farthest <= found.rotation_error[1] + 1e-12
    assert farthest > 0.9 * found.rotation_error[0]
    assert body.contains(found.rotation_screw[:3])


def test_free_platform_or_unknown_part_has_no_error_body():
    free = Robot("door", "tip", (Frame("h", joint="revolute"), Frame("tip", "h")))
    reach = reachable_screws(solve_assembly(home_posture(free)), "frozen")
    with pytest.raises(ValueError, match="moves freely"):
        error_body(reach, "rotation")
    with pytest.raises(ValueError, match="part is 'both'"):
        error_body(reach_of(Clearance(radial=1e-5)), "both")


def test_slack_of_an_error_body_equals_hand_calculation():
    """The points are four corners of a cube. The other corners are beyond them by 2 /
    sqrt(3).
    """
    corners = np.array(list(product([-1.0, 1.0], repeat=3)))
    even = corners[corners.prod(axis=1) > 0]
    directions = np.vstack([corners / np.sqrt(3), np.eye(3)])
    heights = np.abs(directions).sum(axis=1)
    body = ErrorBody("translation", even, np.zeros((0, 3), int), directions, heights)
    assert body.slack == pytest.approx(3 / np.sqrt(3) - 1 / np.sqrt(3))
    assert body.contains([0.9, -0.9, 0.9])
    assert not body.contains([0.0, 0.0, 1.1])


@pytest.mark.slow
def test_plot_contains_the_error_body_and_its_size():
    answer = solve_assembly(place_robot(irsbot2(), pose={"tx": 0.1, "tz": -0.5}))
    plotter = plot_assembly(answer, errors="translation", assumption="frozen")
    said = plotter.actors["body"].GetText(0)
    pixels = plotter.screenshot(return_img=True).astype(int)
    plotter.close()
    assert said.startswith("gold: possible translation errors (frozen), up to 0.38")
    gold = (pixels[..., 0] > 150) & (pixels[..., 1] > 110) & (pixels[..., 2] < 110)
    assert gold.sum() > 500
