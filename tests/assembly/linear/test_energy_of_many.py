"""Many points: each has its own errors, loads and way to be solved."""

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear import lanes, pose_error
from assembly.linear.energy import solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reference.pose_error import reachable_screws
from assembly.linear.robot_structure import structure_of
from assembly.model.robot import Clearance
from tests.robots_for_tests import coaxial_beams, planar_four_bar

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


def test_what_is_solved_compiled_is_bounded_compiled(monkeypatch):
    """A set is set up in numpy for loads alone; the search is compiled all the same."""
    robot = coaxial_beams([0, 0, 0, 0, 1e-4, 0], clearance=Clearance(radial=2e-5))
    asked = []
    monkeypatch.setattr(
        pose_error, "reachable_screws",
        lambda *given: asked.append(given) or reachable_screws(*given),
    )  # fmt: skip
    bound_pose_error(solve_assembly(home_posture(robot)))
    assert not asked
    found = bound_pose_error(solve_assembly(home_posture(robot), LOAD))
    assert len(asked) == 1
    assert found.method == "compiled"


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


def test_bounds_are_too_wide_beyond_what_was_asked():
    """Not where both are infinite: the platform moves without bound."""
    for bounds, wide in (
        ((1.0, 1.1), False), ((1.0, 1.3), True), ((np.inf, np.inf), False),
        ((1.0, np.inf), True),
    ):  # fmt: skip
        assert bool(pose_error._too_wide("rotation", bounds, 0.2, "rad")) == wide


def test_a_robots_addresses_are_found_again(monkeypatch):
    """Those of one robot stay when another one comes."""
    monkeypatch.setattr(lanes, "_known", {})  # as many as are kept may be known by now
    one, other = (structure_of(r)[1] for r in (two_sets()[0], planar_four_bar()))
    first = lanes._robot(one)
    lanes._robot(other)
    assert lanes._robot(one) is first
