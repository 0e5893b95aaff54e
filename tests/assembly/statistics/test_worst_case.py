"""Bounds on margin and energy over all errors within tolerances."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.posture_margins import prepare_margins
from forcefit.assembly.statistics.worst_case import (
    bound_energy,
    bound_margin,
    random_corners,
    worst_corner,
)
from tests.robots_for_tests import coaxial_beams
from tests.tolerances_for_tests import PLAY, arm, pairs_of_bars, plan_for, rigid_pair

K = 1e6  # [N/m]
PLACES = [("one", 3), ("two", 3), ("one", 4), ("two", 4)]


def bars(clearance=None):
    """Return two bars in series with isotropic springs."""
    robot = coaxial_beams(np.zeros(6), (K, K), clearance=clearance)
    return home_posture(robot), plan_for(robot, PLACES, [1] * 4, {}).sources


@pytest.mark.parametrize("directions", [1, 2])
@pytest.mark.parametrize("radial", [0.0, PLAY])
def test_worst_energy_and_its_bound_equal_closed_forms(directions, radial):
    """The energy is k (hypot(t1 + t2, t3 + t4) - p)^2 / 4. The bound replaces the root
    by the sum of all tolerances.
    """
    posture, sources = bars(Clearance(radial=radial) if radial else None)
    prepared = linear_response(posture)
    t = np.array([3.0, 2.0, *((1.0, 4.0) if directions == 2 else (0, 0))]) * PLAY
    truth = K * (np.hypot(t[0] + t[1], t[2] + t[3]) - radial) ** 2 / 4
    corner = worst_corner(prepared, sources, t, random_corners(4, 4))
    assert corner.value == pytest.approx(truth, rel=1e-6)
    assert corner.signs[0] == -corner.signs[1]
    bound = bound_energy(prepared, sources, t)
    assert bound == pytest.approx(K * (t.sum() - radial) ** 2 / 4, rel=1e-5)
    assert bound >= corner.value * (1 - 1e-9)


def test_worst_margin_and_its_bound_equal_closed_forms():
    """The margin is hypot(t1 + t2, t3 + t4) / p; the bound is the sum of all t / p."""
    posture, sources = bars(Clearance(radial=PLAY))
    zone, t = prepare_margins(posture, "rigid"), np.array([3.0, 2, 1, 4]) * PLAY
    corner = worst_corner(zone, sources, t, random_corners(4, 4))
    assert corner.value == pytest.approx(np.hypot(5, 5), rel=1e-6)
    assert bound_margin(zone, sources, t) == pytest.approx(10.0, rel=1e-6)
    assert bound_margin(zone, sources, t * [1, 1, 0, 0]) == pytest.approx(5.0, rel=1e-6)


def test_worst_energy_and_margin_of_a_ball_are_within_their_bounds():
    """The errors along x, y and z are 3, 2 and 4 ball clearances. The worst case is the
    root of their sum of squares, and the bound is their sum.
    """
    robot = coaxial_beams(np.zeros(6), (K, K), clearance=Clearance(ball=PLAY))
    posture, t = home_posture(robot), np.array([3.0, 2.0, 4.0]) * PLAY
    places = [("two", 3), ("two", 4), ("two", 5)]
    sources = plan_for(robot, places, [1] * 3, {}).sources
    prepared, zone = linear_response(posture), prepare_margins(posture, "rigid")
    corners = random_corners(4, 3)
    worst = worst_corner(prepared, sources, t, corners).value
    truth = np.linalg.norm(t) - PLAY
    assert worst == pytest.approx(K * truth**2 / 4, rel=1e-6)
    largest = worst_corner(zone, sources, t, corners).value
    assert largest == pytest.approx(np.sqrt(29), rel=1e-6)
    bound = K * (t.sum() - PLAY) ** 2 / 4
    assert bound_energy(prepared, sources, t) == pytest.approx(bound, rel=1e-5)
    assert bound_margin(zone, sources, t) == pytest.approx(9.0, rel=1e-6)


def test_margin_bound_distributes_errors_over_several_clearances():
    """Two pins in series have clearances in the ratio 1 : 3, so each is used by the
    same fraction.
    """
    frames = (
        Frame("one", translation=[0.5, 0, 0]),
        Frame("two", "base", [0.5, 0, 0]),
        Frame("a", "one", clearance=Clearance(radial=PLAY, axial=PLAY)),
        Frame("b", "a", clearance=Clearance(radial=3 * PLAY, axial=3 * PLAY)),
    )
    robot = Robot("pins", "b", frames, (("b", "two"),))
    zone = prepare_margins(home_posture(robot), "rigid")
    for places, t, expected in (
        ([("one", 3)], [2.0], 0.5),
        ([("one", 5)], [3.0], 0.75),
        ([("one", 3), ("two", 5)], [2.0, 3.0], 0.75),
        ([("one", 3), ("two", 4), ("two", 3)], [2.0, 4.0, 1.0], 7 / 4),
    ):
        sources = plan_for(robot, places, [1] * len(places), {}).sources
        found = bound_margin(zone, sources, np.array(t) * PLAY)
        assert found == pytest.approx(expected, rel=1e-6)


def test_margin_bound_is_infinite_if_no_clearance_compensates_an_error():
    """The error is along the axis of a pin. A tolerance of 1e-14 m counts as zero."""
    robot = rigid_pair(radial=PLAY)
    posture = home_posture(robot)
    sources = plan_for(robot, [("one", 3), ("one", 5)], [1, 1], {}).sources
    zone = prepare_margins(posture, "rigid")
    for along_z, finite in ((0.0, True), (1e-14, True), (1e-9, False)):
        t = np.array([2 * PLAY, along_z])
        assert np.isfinite(bound_margin(zone, sources, t)) == finite
    assert bound_energy(linear_response(posture), sources, t) == np.inf


def test_energy_bound_is_infinite_in_rigid_directions():
    """The energy is k t^2 / 2 along the axis. The bodies are rigid across the axis,
    where a tolerance of 1e-14 m is treated as zero.
    """
    spring = np.diag([np.inf] * 3 + [K] + [np.inf] * 2)
    frames = (
        Frame("one", translation=[0.5, 0, 0], joint_stiffness=spring),
        Frame("two", "base", [0.5, 0, 0]),
    )
    robot = Robot("spring", "one", frames, (("one", "two"),))
    prepared = linear_response(home_posture(robot))
    stored = K * 4e-8 / 2
    for component in (4, 5):
        places = [("two", 3), ("two", component)]
        sources = plan_for(robot, places, [1, 1], {}).sources
        for across, bound in ((0.0, stored), (1e-14, stored), (1e-9, np.inf)):
            found = bound_energy(prepared, sources, np.array([2e-4, across]))
            assert found == pytest.approx(bound, rel=1e-6)


def test_energy_bound_subtracts_the_clearance_of_each_pair():
    """The gaps of two pairs of bars exceed their clearance p by 0.5 p and 9 p.

    The bound is k (0.5 + 9)^2 p^2 / 4.
    """
    robot = pairs_of_bars([K, K], PLAY)
    prepared = linear_response(home_posture(robot))
    sources = plan_for(robot, [("one0", 3), ("one1", 3)], [1, 1], {}).sources
    found = bound_energy(prepared, sources, np.array([1.5, 10.0]) * PLAY)
    assert found == pytest.approx(K * (9.5 * PLAY) ** 2 / 4, rel=1e-4)


def test_open_chain_has_zero_margin_and_energy_bounds():
    robot = arm(link=MatrixLink(np.eye(6) * K), radial=PLAY)
    posture = home_posture(robot)
    sources = plan_for(robot, [("tip", 3)], [1], {}).sources
    assert bound_margin(prepare_margins(posture, "rigid"), sources, np.ones(1)) == 0.0
    assert bound_energy(linear_response(posture), sources, np.ones(1)) == 0.0
