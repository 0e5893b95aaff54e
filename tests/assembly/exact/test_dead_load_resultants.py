"""Sizes and resultants of dead loads, of one condition or of many."""

import numpy as np
import pytest

from assembly.exact.dead_load import (
    dead_loads,
    dead_loads_of_rows,
    wrenches_on_frames,
)
from assembly.exact.placement import place
from assembly.kinematics.posture import home_posture, together
from tests.assembly.exact.test_dead_load import heavy
from tests.assembly.exact.test_placement import moved_unknowns
from tests.robots_for_tests import random_robot, with_bodies


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
    many = together(postures)
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
