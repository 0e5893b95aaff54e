"""The picture of a robot: bodies meet where they should, and pixels are drawn."""

import numpy as np

from assembly.energy import solve_assembly
from assembly.plot import displaced_bodies, robot_plotter
from assembly.posture import place_robot
from tests.robots_for_tests import NUMBERS, irsbot2_with


def _assembly():
    robot = irsbot2_with(NUMBERS["cases"][0])
    return solve_assembly(place_robot(robot, pose={"tx": 0.1, "tz": -0.5}))


def test_displaced_chains_meet_at_every_closure():
    """The tree walk is another road to eqs (16)-(20) than the closure's matrix."""
    answer = _assembly()
    robot = answer.posture.robot
    screws = displaced_bodies(answer).end_screws
    for a, b in robot.closures:
        gap = screws[robot.index(a)] - screws[robot.index(b)]
        assert np.abs(gap).max() < 1e-12
    tip = screws[robot.index(robot.platform)]
    assert np.abs(tip - answer.platform_screw).max() < 1e-13


def test_the_picture_shows_links_bodies_and_the_exaggeration():
    plotter = robot_plotter(_assembly(), exaggeration=20)
    said = plotter.actors["caption"].GetText(2)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    assert said.startswith("displacements x 20;")
    assert pixels.shape == (800, 1100, 3)
    red = (pixels[..., 0] > 150) & (pixels[..., 1] < 80)
    blue = (pixels[..., 2] > 110) & (pixels[..., 0] < 80)
    assert red.sum() > 500
    assert blue.sum() > 500
