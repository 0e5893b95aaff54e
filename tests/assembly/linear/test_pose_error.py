"""Bounds of (27), compared with closed forms and published bounds."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import Clearance, Frame, Robot, bound_pose_error, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.closure import linearise
from forcefit.assembly.linear.reference.pose_error import reachable_screws
from forcefit.assembly.model.clearance import CONES, clearance_bounds
from forcefit.assembly.robots.irsbot2 import irsbot2
from forcefit.assembly.solvers.method import METHODS
from tests.robots_for_tests import (
    NUMBERS,
    coaxial_beams,
    irsbot2_with,
    planar_four_bar,
    small_clearance,
)

CASES = [
    pytest.param(case, point, id=f"{case['name']}-{point['x']}-{point['z']}")
    for case in NUMBERS["cases"]
    for point in case["points"]
]


def serial(*clearances, arm=0.3):
    """Return a chain of fixed joints with clearance at distances ``arm`` along x."""
    frames, above = [], "base"
    for i, clearance in enumerate(clearances):
        shift = [arm * bool(i), 0, 0]
        frames.append(Frame(f"j{i}", above, shift, clearance=clearance))
        above = f"j{i}"
    frames.append(Frame("tip", above, [arm, 0, 0]))
    return Robot("serial", "tip", tuple(frames))


def bounds(robot, assumption="frozen", **options):
    answer = solve_assembly(home_posture(robot))
    tight = {"tolerance_rotation": 1e-9, "tolerance_translation": 1e-9}
    return bound_pose_error(answer, assumption, **tight | options)


def assert_holds(bracket, value, tolerance):
    """Assert that the bounds enclose the value and differ by at most the tolerance."""
    low, high = bracket
    assert high - low <= tolerance
    slip = 1e-9 * value
    assert low <= value + slip
    assert high >= value - slip


def test_pose_error_of_one_joint_equals_its_clearances():
    """The arm of 0.3 m adds a translation by spin along y and by tilt along z."""
    clearance = Clearance(radial=2e-5, axial=1e-5, tilt=4e-4, spin=3e-4)
    found = bounds(serial(clearance))
    assert_holds(found.rotation_error, 5e-4, 1e-9)
    # The components are r cos a, r sin a + 0.3 spin, and axial + 0.3 tilt.
    a = np.linspace(0, 2 * np.pi, 2_000_001)
    sizes = np.hypot(2e-5 * np.cos(a), 2e-5 * np.sin(a) + 0.3 * 3e-4)
    expected = np.hypot(sizes.max(), 1e-5 + 0.3 * 4e-4)
    assert_holds(found.translation_error, expected, 1e-9)


def test_clearances_of_parallel_axes_add_up():
    found = bounds(serial(Clearance(radial=1e-5), Clearance(radial=2e-5)))
    assert_holds(found.translation_error, 3e-5, 1e-9)
    assert_holds(found.rotation_error, 0.0, 1e-9)


def test_pose_error_at_an_offset_point_includes_the_rotation():
    found = bounds(serial(Clearance(tilt=1e-3)), offset=[0.2, 0, 0])
    assert_holds(found.translation_error, 0.5e-3, 1e-9)


def test_free_platform_has_an_infinite_pose_error():
    robot = Robot(
        "door", "tip", (Frame("hinge", joint="revolute"), Frame("tip", "hinge"))
    )
    found = bounds(robot)
    assert np.isinf(found.rotation_error).all()
    limited = Robot("door", "tip", (
        Frame("hinge", joint="revolute", clearance=Clearance(spin=0.01)),
        Frame("tip", "hinge", [0.5, 0, 0]),
    ))  # fmt: skip
    found = bounds(limited)
    assert_holds(found.rotation_error, 0.01, 1e-9)
    assert_holds(found.translation_error, 0.005, 1e-9)


@pytest.mark.parametrize("spin", [1.0, 1e-3, 1e-4, 1e-6, 1e-9, 0.0])
def test_pose_error_includes_the_motion_limit_of_a_passive_joint(spin):
    """The largest translations are y = radial + L spin and z = axial + L tilt."""
    clearance = Clearance(radial=1e-5, axial=2e-5, tilt=3e-4, spin=spin)
    hub = Frame("hub", joint="revolute", clearance=clearance)
    found = bounds(Robot("arm", "tool", (hub, Frame("tool", "hub", [0.2, 0, 0]))))
    far = np.hypot(1e-5 + 0.2 * spin, 2e-5 + 0.2 * 3e-4)
    assert_holds(found.translation_error, far, 1e-7 * spin + 1e-9)
    assert_holds(found.rotation_error, np.hypot(spin, 3e-4), 1e-7 * spin + 1e-9)


def test_translation_error_on_a_bearing_axis_is_bounded():
    """At height h on the bearing axis, the bounds are radial + h tilt and axial.

    At points outside the axis, the translation error is infinite.
    """
    clearance = Clearance(radial=1e-5, axial=2e-5, tilt=3e-4)
    hub = Frame("hub", joint="revolute", clearance=clearance)
    robot = Robot("spindle", "tool", (hub, Frame("tool", "hub", [0, 0, 0.4])))
    found = bounds(robot)
    assert np.isinf(found.rotation_error).all()
    assert_holds(found.translation_error, np.hypot(1e-5 + 0.4 * 3e-4, 2e-5), 1e-9)
    found = bounds(robot, offset=[0, 1e-3, 0])
    assert np.isinf(found.translation_error).all()
    slide = replace(hub, joint="prismatic", clearance=Clearance(tilt=3e-4))
    found = bounds(replace(robot, frames=(slide, robot.frames[1])))
    assert_holds(found.rotation_error, 3e-4, 1e-9)
    assert np.isinf(found.translation_error).all()


def hinged_frame(spin):
    """Return a four-bar with clearance in its pins and motion limits on two pins."""
    clearance = small_clearance(spin=spin)
    robot = planar_four_bar()
    limited = {"pin_a": clearance, "rocker": clearance, "pin_b": small_clearance()}
    return replace(robot, frames=tuple(
        replace(f, clearance=limited.get(f.name)) for f in robot.frames
    ))  # fmt: skip


def feasible(posture, cp):
    """Return the clearance screws and constraints of the closed nominal robot."""
    robot, lin = posture.robot, linearise(posture)
    c = cp.Variable((len(robot.frames), 6))
    moved = 1e-4 * cp.reshape(c, (6 * len(robot.frames),), order="C")
    within = [lin.rows @ moved * 1e4 == 0]
    for j, row in enumerate(clearance_bounds(robot)):
        for k, rows in enumerate(CONES):
            if np.isfinite(row[k]):
                part = cp.hstack([c[j, r] for r in rows])
                within.append(cp.norm(part) <= row[k] * 1e4)
    return lin.platform @ moved, within


@pytest.mark.parametrize("spin", [1.0, 3e-4, 1e-4, 1e-5, 1e-8])
def test_screws_that_attain_the_bounds_satisfy_the_closures(spin, rng):
    """The closures and support functions are computed by cvxpy to 1e-6."""
    import cvxpy as cp

    from forcefit.assembly.linear.reference.as_printed import OPTIMAL, _solve

    posture = home_posture(hinged_frame(spin))
    answer = solve_assembly(posture)
    found = bound_pose_error(answer, tolerance_translation=1e-9)
    x, within = feasible(posture, cp)
    for screw in (found.rotation_screw, found.translation_screw):
        off = cp.Problem(cp.Minimize(cp.sum_squares(1e4 * (x - screw))), within)
        _solve(off, OPTIMAL)
        assert off.value < 1e-10
    reach = reachable_screws(answer, "frozen")
    for direction in rng.normal(size=(4, 6)) * [0.1, 0.1, 0.1, 1, 1, 1]:
        most = cp.Problem(cp.Maximize(1e4 * direction @ x), within)
        _solve(most, OPTIMAL)
        height = reach.support(direction).height
        assert height == pytest.approx(most.value / 1e4, rel=1e-6, abs=1e-11)


@pytest.mark.parametrize("asked", [{}, {"energy_budget": 0.5}])
def test_energy_budget_of_two_springs_bounds_the_displacement(asked):
    """For a displacement x of the common point, E - E* = (k1 + k2)/2 |x - x*|^2."""
    k1, k2, gap, eta = 1e6, 3e6, 2e-4, asked.get("energy_budget", 0.05)
    robot = coaxial_beams(np.array([0, 0, 0, gap, 0, 0]), (k1, k2))
    least = k1 * k2 / (k1 + k2) * gap**2 / 2
    radius = np.sqrt(2 * eta * least / (k1 + k2))
    found = bounds(robot, "budget", **asked)
    assert_holds(found.translation_error, gap * k2 / (k1 + k2) + radius, 1e-9)
    assert_holds(found.rotation_error, radius, 1e-9)  # all six stiffnesses are equal


@pytest.mark.parametrize("limit", [4.1, 1.5, 0.5])
def test_pose_error_of_a_closed_chain_respects_motion_limits(limit):
    """With the closure q + E = v_1 + v_2 + v_3, |v| <= E and |q| <= limit E, the
    largest rotation q + E of the platform is min(3, limit + 1) E.
    """
    E, loose = 1e-3, Clearance(spin=1e-3)
    robot = Robot("pin", "end", (
        Frame("pin", joint="revolute", clearance=Clearance(spin=limit * E),
              geometric_error=[0, 0, E, 0, 0, 0]),
        Frame("end", "pin", [1.0, 0, 0]),
        Frame("a", clearance=loose), Frame("b", "a", clearance=loose),
        Frame("c", "b", clearance=loose), Frame("stop", "c", [1.0, 0, 0]),
    ), (("end", "stop"),))  # fmt: skip
    for method in METHODS:
        found = bounds(robot, "free", method=method)
        assert_holds(found.rotation_error, min(3, limit + 1) * E, 1e-9)


@pytest.mark.parametrize("stiffness", [1e6, 1e-6, 1e-12])
def test_frozen_assumption_fixes_the_clearance_of_a_loaded_joint(stiffness):
    robot = coaxial_beams(
        np.array([0, 0, 0, 3e-4, 0, 0]), (stiffness, stiffness),
        clearance=Clearance(radial=1e-4, axial=2e-5),
    )  # fmt: skip
    answer = solve_assembly(home_posture(robot))
    found = bounds(robot)
    # The radial clearance is loaded and therefore fixed. The axial clearance is
    # unloaded, but the fixed springs prevent its motion.
    size = float(np.linalg.norm(answer.platform_screw[3:]))
    assert_holds(found.translation_error, size, 1e-9)


def test_unknown_assumption_and_loaded_budget_are_rejected():
    many = solve_assembly(
        [home_posture(coaxial_beams(np.zeros(6)))], [1, 0, 0, 0, 0, 0]
    )
    for answer in (many, many[0]):
        with pytest.raises(ValueError, match="assumption is 'loose', expected one of"):
            bound_pose_error(answer, "loose")
    with pytest.raises(ValueError, match="expected an assembly without load"):
        bound_pose_error(many[0], "budget")


@pytest.mark.parametrize(("case", "point"), CASES)
@pytest.mark.parametrize(("key", "assumption"), [("rigid", "frozen"), ("free", "free")])
def test_pose_error_bounds_agree_with_published_bounds(case, point, key, assumption):
    """Both intervals contain the true value, so they overlap."""
    pose = {"tx": point["x"], "tz": point["z"]}
    for name, robot in (("full", irsbot2_with(case)), ("clear", irsbot2())):
        answer = solve_assembly(place_robot(robot, pose=pose))
        found = bound_pose_error(answer, assumption)
        for letter, bracket in (
            ("R", found.rotation_error),
            ("T", found.translation_error),
        ):
            low, high = point[f"{name}_{key}_{letter}"]
            assert bracket[1] - bracket[0] <= 1e-6
            assert bracket[0] <= high + 1e-7
            assert bracket[1] >= low - 1e-7
