"""Where the search for an equilibrium begins, what steps are given, where it ends."""

import numpy as np

from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import home_posture
from assembly.robots.hexapod import hexapod
from tests.assembly.kinematics.test_open_closures import parallelograms


def test_nothing_to_do_is_done_at_once():
    """A hexapod without errors: no step but the one that says so."""
    robot = hexapod()
    still = robot.with_errors(0 * robot.errors)
    answer = solve_exact(home_posture(still))
    assert answer.iterations == 1
    assert answer.energy == 0.0
    assert np.abs(answer.platform_screw).max() < 1e-12


def test_what_rounded_files_leave_open_is_no_gap():
    """Cranks of six digits, open by up to 1e-6 m, are as closed as they can be."""
    posture = home_posture(parallelograms(digits=6))
    assert posture.mismatch > 1e-9
    answer = solve_exact(posture)
    assert answer.iterations <= 2
    assert answer.energy == 0.0
