"""Paths past limit points, against closed forms."""

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.platform_stiffness.arc_length import follow_load
from forcefit.assembly.platform_stiffness.platform_stiffness import platform_stiffness
from forcefit.assembly.robots import load_robot
from tests.assembly.platform_stiffness.test_deflection import FY, shallow_arch


def arch_force(height, half=1.0, rise=0.1, k=1e5):
    """Load on von Mises' truss at the height of its apex, downwards."""
    length = np.hypot(half, rise)
    return 2 * k * (length / np.hypot(half, height) - 1) * height


def test_path_of_a_shallow_arch_equals_its_closed_form_past_limit_points():
    """The path rises to the limit point, passes the flat arch, and falls again."""
    limit = arch_force(np.linspace(0, 0.1, 100_001)).max()
    curve = follow_load(shallow_arch(), FY, 0.0, -1.5 * limit)
    heights = 0.1 + curve.deflection
    np.testing.assert_allclose(-curve.loads, arch_force(heights), atol=1e-6 * limit)
    assert heights.min() < -0.1  # past both limit points
    assert (np.diff(heights) < 0).all()
    first, second = curve.events
    assert -first.load == pytest.approx(limit, rel=1e-9)
    assert -second.load == pytest.approx(-limit, rel=1e-9)
    assert {event.kind for event in curve.events} == {"critical"}
    assert all(event.what.startswith("limit point") for event in curve.events)
    assert (curve.stiffness[np.abs(heights) < 0.03] < 0).all()


def test_column_on_a_torsion_spring_has_a_branch_point_at_k_over_l():
    """A straight rigid bar stays in equilibrium; from k / L on it can also buckle."""
    K = np.diag([np.inf, np.inf, 50.0, np.inf, np.inf, np.inf])
    hinge = Frame("hinge", joint="revolute", joint_stiffness=K)
    bar = Frame("bar", "hinge", [0.4, 0, 0])
    curve = follow_load(home_posture(Robot("bar", "bar", (hinge, bar))), 3, 0.0, -200.0)
    (event,) = curve.events
    assert -event.load == pytest.approx(50.0 / 0.4, rel=1e-5)
    assert event.what.startswith("branch point, buckles: platform along [0 0 1.768 0 ")
    assert event.what.endswith("most in hinge joint")
    assert np.abs(curve.screws).max() < 1e-12


def test_two_bars_on_torsion_springs_have_branch_points_at_both_loads():
    """(3 - sqrt 5) k / 2L and (3 + sqrt 5) k / 2L: det [[2k - PL, -k], ..] = 0."""
    K = np.diag([np.inf, np.inf, 50.0, np.inf, np.inf, np.inf])
    foot = Frame("foot", joint_stiffness=K)
    knee = Frame("knee", "foot", [0.4, 0, 0], joint_stiffness=K)
    tip = Frame("tip", "knee", [0.4, 0, 0])
    posture = home_posture(Robot("bars", "tip", (foot, knee, tip), ()))
    curve = follow_load(posture, 3, 0.0, -400.0)
    loads = 50.0 / 0.4 * (3 + np.array([-1, 1]) * np.sqrt(5)) / 2
    np.testing.assert_allclose([-e.load for e in curve.events], loads, rtol=1e-5)
    for event in curve.events:
        assert event.what.startswith("branch point, buckles")


def test_rods_that_spin_freely_cause_no_events_on_the_path():
    """The delta has six rods; the tangent without load is the classical stiffness."""
    posture = home_posture(load_robot("delta"))
    curve = follow_load(posture, 5, 0.0, -500.0, count=4)
    classical = platform_stiffness(posture).along(np.eye(6)[5])[0]
    assert curve.stiffness[0] == pytest.approx(classical, rel=1e-8)
    assert not curve.events
    assert abs(curve.loads[-1]) >= 500.0
