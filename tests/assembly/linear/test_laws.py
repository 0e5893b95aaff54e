"""Invariance to units, reference frames and loop cuts; reciprocity."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit import BeamLink, Frame, Robot, bound_pose_error, solve_exact, zone_margin
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.robots.irsbot2 import irsbot2
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform
from tests.robots_for_tests import in_millimetres, planar_four_bar, random_robot

REFUSALS = (CannotAssemble, FreeMotion, SolverFailed)


@pytest.mark.parametrize("seed", range(8))
def test_margins_do_not_depend_on_the_length_unit(seed):
    """An energy in N mm is 1000 times its value in N m."""
    robot = random_robot(np.random.default_rng(seed), legs=2)
    small = replace(robot, frames=tuple(
        replace(f, joint_stiffness=None) for f in robot.frames
    ))  # fmt: skip
    one, other = home_posture(small), home_posture(in_millimetres(small))
    try:
        here = solve_assembly(one)
    except REFUSALS as error:  # Both units raise the same error.
        with pytest.raises(type(error)):
            solve_assembly(other)
        return
    there = solve_assembly(other)
    floor = 1e-9 * here.energy_without_clearance
    assert there.energy / 1000 == pytest.approx(here.energy, rel=1e-7, abs=floor)
    a, b = zone_margin(one).margin, zone_margin(other).margin
    assert (a is None) == (b is None)
    if a is not None:
        assert b == pytest.approx(a, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_energy_and_pose_errors_do_not_depend_on_the_base_pose(seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, legs=2)
    turn, shift = rng.uniform(-2, 2, 3), rng.uniform(-1, 1, 3)
    root = Frame("root", translation=shift, rotation=turn)
    frames = tuple(
        replace(f, parent="root") if f.parent == "base" else f for f in robot.frames
    )
    moved = replace(robot, frames=(root, *frames))
    try:
        one = solve_assembly(home_posture(robot))
    except REFUSALS as error:
        with pytest.raises(type(error)):
            solve_assembly(home_posture(moved))
        return
    other = solve_assembly(home_posture(moved))
    floor = 1e-9 * one.energy_without_clearance
    assert other.energy == pytest.approx(one.energy, rel=1e-7, abs=floor)
    one_error = bound_pose_error(one, "frozen")
    other_error = bound_pose_error(other, "frozen")
    for name in ("rotation_error", "translation_error"):
        a, b = getattr(one_error, name), getattr(other_error, name)
        assert a[0] <= b[1] + 1e-9
        assert b[0] <= a[1] + 1e-9


def cut_at_the_crank(robot):
    """Return the four-bar with its loop cut at the end of the crank."""
    frame = {f.name: f for f in robot.frames}
    pin_b, rocker, end_b = frame["pin_b"], frame["rocker"], frame["end_b"]
    length = float(pin_b.translation[0])
    frames = (
        frame["crank"],
        Frame("crank_end", "crank", frame["pin_a"].translation,
              frame["pin_a"].rotation,
              geometric_error=frame["pin_a"].geometric_error),
        rocker,
        # the rocker's body, then the pin between rocker and coupler
        replace(end_b, name="pin", joint="revolute"),
        # the reversed coupler, then the pin at its near end
        Frame("near", "pin", [-length, 0, 0], joint="revolute", link=pin_b.link),
        Frame("near_end", "near"),
    )  # fmt: skip
    return Robot("cut", "crank_end", frames, (("crank_end", "near_end"),))


def test_energy_does_not_depend_on_the_loop_cut():
    """Out-of-plane errors of crank and rocker bend the coupler."""
    errors = np.zeros((6, 6))
    errors[1] = [1e-3, -2e-3, 0, 0, 0, 3e-4]
    errors[5] = [-2e-3, 1e-3, 0, 0, 0, -1e-4]
    robot = planar_four_bar(errors=errors)
    frames = {f.name: f for f in robot.frames}
    assert isinstance(frames["pin_b"].link, BeamLink)
    one = solve_assembly(home_posture(robot))
    other = solve_assembly(home_posture(cut_at_the_crank(robot)))
    assert one.energy > 1e-3
    assert other.energy == pytest.approx(one.energy, rel=1e-9)


def test_displacements_satisfy_betti_reciprocity(rng):
    """Without clearance, w1 . x2 = w2 . x1."""
    robot = irsbot2()
    tight = replace(robot, frames=tuple(
        replace(f, clearance=None) for f in robot.frames
    ))  # fmt: skip
    posture = home_posture(tight)
    for _ in range(5):
        first, second = rng.normal(size=(2, 6)) * [1, 1, 1, 10, 10, 10]
        one, other = (solve_assembly(posture, w) for w in (first, second))
        work = float(second @ one.platform_screw)
        assert float(first @ other.platform_screw) == pytest.approx(work, rel=1e-8)


def test_rigid_serial_robot_pose_equals_the_product_of_transforms():
    """The pose of a rigid robot equals the product of the transforms."""
    error = np.array([0.02, -0.01, 0.03, 1e-3, 2e-3, -3e-3])
    frames = (
        Frame("a", translation=[0.1, 0.2, 0.3], rotation=[0.3, 0.1, -0.2],
              geometric_error=error),
        Frame("b", "a", [0.4, 0, 0], [0, 0.7, 0], geometric_error=-error),
    )  # fmt: skip
    posture = home_posture(Robot("arm", "b", frames))
    found = solve_exact(posture).platform_screw
    small = [transform(s * error[3:], rotation_matrix(s * error[:3])) for s in (1, -1)]
    a, b = posture.robot.fixed_transforms
    actual = a @ small[0] @ b @ small[1]
    nominal = posture.transforms[1]
    turn = rotation_vector(actual[:3, :3] @ nominal[:3, :3].T)
    expected = np.concatenate([turn, actual[:3, 3] - nominal[:3, 3]])
    assert np.allclose(found, expected, rtol=0, atol=1e-14)
