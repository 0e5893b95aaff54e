"""Robots that nothing forces: no energy, and rounded files are no gap."""

import numpy as np

from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import home_posture
from assembly.robots.hexapod import hexapod
from tests.assembly.kinematics.test_open_closures import parallelograms


def test_robot_without_errors_stays_where_it_is():
    robot = hexapod()
    answer = solve_exact(home_posture(robot.with_errors(0 * robot.errors)))
    assert answer.energy == 0.0
    assert np.abs(answer.platform_screw).max() < 1e-12


def test_closures_open_by_rounding_of_a_file_store_no_energy():
    """Cranks of six digits, open by up to 1e-6 m, are as closed as they can be."""
    posture = home_posture(parallelograms(digits=6))
    assert posture.mismatch > 1e-9
    assert solve_exact(posture).energy == 0.0
