"""Sizes and resultants of dead loads, of one condition or of many."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.exact.dead_load import (
    dead_loads,
    dead_loads_of_rows,
    largest_wrench,
    load_magnitudes,
    work_gradient,
    wrenches_on_frames,
)
from assembly.exact.finite_robot import FiniteRobot
from assembly.exact.placement import place
from assembly.kinematics.posture import home_posture
from assembly.linear.closure import virtual_joints
from assembly.model.robot import Frame
from tests.assembly.exact.test_dead_load import heavy, on_a_hinge, some_loads
from tests.assembly.exact.test_placement import moved_unknowns
from tests.robots_for_tests import random_robot, with_bodies


def arm_of_one_body():
    """A hinge at the base and a body of 2 m to the tip, which is the platform."""
    arm = Frame("arm", "hinge", [2.0, 0, 0])
    posture = on_a_hinge(10.0, arm)
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    return posture, place(model, np.zeros(1))


def test_the_size_of_loads_is_the_largest_moment_about_the_platform():
    """Forces times the reference length of 2 m, of the platform or of any body."""
    posture, here = arm_of_one_body()
    assert largest_wrench(here, dead_loads(posture)) == 0.0
    on_tip = dead_loads(posture, [1.0, -7.0, 0, 3.0, 0, 0])
    assert largest_wrench(here, on_tip) == pytest.approx(7.0)
    on_tip = dead_loads(posture, [1.0, -5.0, 0, 3.0, 0, 0])
    assert largest_wrench(here, on_tip) == pytest.approx(6.0)
    # on the body at the hinge, 2 m from the platform
    bodies = np.zeros((2, 6))
    bodies[1] = [0, 0, 1.0, 0, -4.0, 0]
    assert largest_wrench(here, dead_loads(posture, bodies=bodies)) == pytest.approx(8)
    both = dead_loads(posture, [0, 0, 9.0, 0, 0, 0], bodies)
    assert largest_wrench(here, both) == pytest.approx(9.0)


def test_magnitudes_of_loads_add_up_where_loads_cancel():
    """A moment of 6 N m against 3 N at 2 m: nothing, of twice 6 N m."""
    posture, here = arm_of_one_body()
    bodies = np.zeros((2, 6))
    bodies[1, 4] = 3.0
    loads = dead_loads(posture, [0, 0, -6.0, 0, 0, 0], bodies)
    unit = 1 / np.sqrt(10.0)  # rad per unknown
    assert work_gradient(here, loads) == pytest.approx([0.0], abs=1e-12)
    assert load_magnitudes(here, loads) == pytest.approx([12.0 * unit], rel=1e-12)
    # of one load alone they are its generalised force
    for one in (dead_loads(posture, bodies=bodies), dead_loads(posture, loads.load)):
        sizes = np.abs(work_gradient(here, one))
        assert load_magnitudes(here, one) == pytest.approx(sizes, rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_loads_are_no_larger_than_their_magnitudes(seed):
    rng = np.random.default_rng(seed)
    posture = home_posture(heavy(random_robot(rng, legs=3), rng))
    model, x, _ = moved_unknowns(posture, rng, 0.1)
    there = place(model, x)
    loads = dead_loads(posture, *some_loads(posture, rng))
    sizes = load_magnitudes(there, loads)
    size = sizes.max()
    assert (np.abs(work_gradient(there, loads)) <= sizes + 1e-12 * size).all()
    opposite = replace(
        loads, load=-loads.load, bodies=-loads.bodies, carried=-loads.carried
    )
    assert load_magnitudes(there, opposite) == pytest.approx(sizes, rel=1e-12)


def test_what_a_frame_holds_is_all_that_hangs_on_it():
    """Moments and forces at points, summed up the tree; joints hold no own body."""
    rng = np.random.default_rng(4)
    robot = with_bodies(random_robot(rng, legs=2), rng)
    posture = home_posture(robot)
    model, x, _ = moved_unknowns(posture, rng, 0.1)
    there, load = place(model, x), np.r_[np.zeros(3), rng.normal(size=3)]
    bodies, gravity = rng.normal(size=(len(robot.frames), 6)), np.array([1.0, -2, -9])
    bodies[:, :3] = 0.0
    body, joint = wrenches_on_frames(there, dead_loads(posture, load, bodies, gravity))
    origin, own = posture.platform[:3, 3], []
    for i, frame in enumerate(robot.frames):
        T = there.body_ends[i]
        weight, at = frame.mass * gravity, T[:3, :3] @ frame.centre_of_mass + T[:3, 3]
        parts = [(at, weight), (T[:3, 3], bodies[i, 3:])]
        if frame.name == robot.platform:
            parts.append((there.platform[:3, 3], load[3:]))
        own.append(sum(np.r_[np.cross(p - origin, f), f] for p, f in parts))
    for i, frame in enumerate(robot.frames):
        behind = [
            own[k] for k in range(len(robot.frames)) if robot.on_path[k, i] and k != i
        ]
        held = np.sum(behind, axis=0) if behind else np.zeros(6)
        scale = np.abs(own).sum()
        assert joint[i] == pytest.approx(held, abs=1e-12 * scale), frame.name
        assert body[i] == pytest.approx(held + own[i], abs=1e-12 * scale)


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.1, -0.2, 0.05)])
def test_loads_of_many_conditions_are_those_of_each(point):
    """Weights with the errors of each row, loads and gravity of each."""
    rng = np.random.default_rng(3)
    robot = heavy(random_robot(rng, legs=2), rng)
    rows = 3
    errors = 1e-2 * rng.normal(size=(rows, len(robot.frames), 6))
    load, gravity = rng.normal(size=(rows, 6)), 9.8 * rng.normal(size=(rows, 3))
    postures = [home_posture(robot.with_errors(one)) for one in errors]
    many = replace(
        postures[0],
        transforms=np.stack([p.transforms for p in postures]),
        coordinates=np.stack([p.coordinates for p in postures]),
    )
    found = dead_loads_of_rows(many, errors, load, gravity, np.array(point))
    for k, posture in enumerate(postures):
        one = dead_loads(posture, load[k], gravity=gravity[k], point=point)
        for name in ("load", "bodies", "carried"):
            expected = getattr(one, name)
            size = np.abs(expected).max()
            assert getattr(found, name)[k] == pytest.approx(expected, abs=1e-12 * size)
    assert np.abs(found.carried).max() > 0
    still = dead_loads_of_rows(many, errors, load, 0 * gravity, np.zeros(3))
    assert np.array_equal(still.load, load)
    assert not still.beyond_platform
