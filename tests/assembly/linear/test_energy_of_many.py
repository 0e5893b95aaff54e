"""Many points: each has its own errors, loads and way to be solved."""

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear.energy import solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reference.pose_error import reachable_screws
from assembly.model.robot import Clearance
from tests.robots_for_tests import coaxial_beams

LOAD = np.array([0.0, 0, 0, 100.0, 0, 0])
K = 1e6


def two_sets():
    """Beams that meet 1e-4 m and 3e-4 m apart along x."""
    sets = np.zeros((2, 6, 6))
    sets[:, 2, 3] = 1e-4, 3e-4
    return coaxial_beams(np.zeros(6), (K, K)), sets


@pytest.mark.parametrize("loaded", [(1, 0), (0, 1), (1, 1), (0, 0)])
def test_points_with_and_without_loads_have_their_own_errors(loaded):
    """Stored: k g^2 / 4 of the gap and F^2 / 4 k of the load, which do not mix."""
    robot, sets = two_sets()
    at = home_posture(robot)
    forces = np.array(loaded)[:, None] * LOAD
    found = solve_assembly([at] * 2, forces, errors=sets)
    expected = K * sets[:, 2, 3] ** 2 / 4 + forces[:, 3] ** 2 / (4 * K)
    assert found.energy == pytest.approx(expected, rel=1e-9)
    assert found.loaded.tolist() == [bool(one) for one in loaded]


def test_a_point_knows_its_own_errors():
    robot, sets = two_sets()
    found = solve_assembly(home_posture(robot), errors=sets)
    for i in range(2):
        assert (found[i].posture.robot.errors == sets[i]).all()
        assert found[i].energy == pytest.approx(K * sets[i, 2, 3] ** 2 / 4)


def test_supports_of_both_halves_are_counted():
    """What each search took, one after the other."""
    play = Clearance(radial=2e-5, axial=1e-5, tilt=1e-3)
    robot = coaxial_beams([0, 0, 0, 0, 1e-4, 0], clearance=play)
    assembly = solve_assembly(home_posture(robot), LOAD)
    at = (0.0, 0.3, 0.0)
    reachable = reachable_screws(assembly, "frozen").at_point(at)
    for method in ("compiled", "reference"):
        both = [reachable.farthest(part, 1e-6, method)[2] for part in (0, 3)]
        assert min(both) > 0
        found = bound_pose_error(assembly, offset=at, method=method)
        assert found.supports == sum(both)
