"""Linear solution of many measurements, compared with the cone solver."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forcefit.assembly.kinematics.posture import home_posture, together
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.load import loads_with_weight
from forcefit.assembly.measurement.conditions import as_declared
from forcefit.assembly.measurement.predict import predict
from forcefit.assembly.measurement.without_clearance import flexibility
from forcefit.assembly.model.robot import Clearance
from tests.robots_for_tests import coaxial_beams, planar_four_bar, random_robot

seeds = st.integers(0, 2**32 - 1)
STILL = np.zeros((1, 3))


def at_home(robot):
    """Return a single posture with a leading axis."""
    return together([home_posture(robot)])


def solved(robot, load, errors=None):
    """Solve a single measurement."""
    errors = robot.errors if errors is None else errors
    postures = at_home(robot)
    forces = loads_with_weight(postures, np.array(load, dtype=float)[None], STILL)
    return flexibility(postures).solve([0], errors.reshape(1, -1), forces)


def farthest(found, expected):
    """Return the largest difference relative to the largest component."""
    parts = np.asarray(found).reshape(-1, 2, 3), np.asarray(expected).reshape(-1, 2, 3)
    scale = np.abs(parts[1]).max(axis=(0, 2), keepdims=True) + 1e-300
    return np.abs((parts[0] - parts[1]) / scale).max()


def elastic_robot(seed, legs):
    """Return a random robot with elastic bodies and without clearance."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, legs, link_share=1.0)
    # The motion limits of prismatic joints are removed.
    tight = tuple(replace(f, clearance=None) for f in robot.frames)
    return replace(robot, frames=tight), rng


@settings(max_examples=20, deadline=None)
@given(seeds, st.integers(2, 3))
def test_linear_solution_of_a_loaded_robot_equals_the_cone_solver(seed, legs):
    """The tolerance 1e-6 allows for round-off at stiffness ratios of 1e6."""
    robot, rng = elastic_robot(seed, legs)
    load = rng.normal(size=6) * [5, 5, 5, 50, 50, 50]
    fast = solved(robot, load)
    assert fast.solved.all()
    slow = solve_assembly(home_posture(robot), load)
    assert farthest(fast.platform_screw[0], slow.platform_screw) < 1e-6
    assert farthest(fast.joint_wrenches[0], slow.joint_wrenches) < 1e-6


def rigid_four_bar(error):
    """Return a four-bar of rigid bars with an error at the rocker end."""
    robot = planar_four_bar()
    frames = [replace(f, link=None) for f in robot.frames]
    frames[-1] = replace(frames[-1], geometric_error=error)
    return replace(robot, frames=tuple(frames))


def test_rigid_four_bar_with_in_plane_errors_equals_closed_form():
    """The rocker is longer by a, and the crank is locked.

    The coupler pin moves by h along the coupler normal n, with h n . u = a for the
    rocker direction u.
    """
    a = 1e-5
    robot = rigid_four_bar([0, 0, 0, 0, 0, 0])
    placed = home_posture(robot)
    end = robot.index("end_b")
    pin_a, pin_b = (
        placed.transforms[robot.index(n)][:3, 3] for n in ("pin_a", "pin_b")
    )
    pivot = placed.transforms[robot.index("rocker")][:3, 3]
    u = (pin_b - pivot) / np.linalg.norm(pin_b - pivot)
    coupler = pin_b - pin_a
    n = np.array([-coupler[1], coupler[0], 0]) / np.linalg.norm(coupler)
    R = placed.transforms[end][:3, :3]
    error = np.concatenate([np.zeros(3), R.T @ (a * u)])
    found = solved(rigid_four_bar(error), np.zeros(6))
    assert found.solved.all()
    h = a / (n @ u)
    assert found.platform_screw[0, 3:] == pytest.approx(h * n, abs=1e-12 * 1e3 * a)


@pytest.mark.parametrize("size", [1e-4, 1e-6])
@pytest.mark.parametrize("row", [0, 1, 5])
def test_rigid_four_bar_with_out_of_plane_errors_is_not_solved(row, size):
    """The measurement remains unsolved."""
    robot = rigid_four_bar(size * np.eye(6)[row])
    assert not solved(robot, np.zeros(6)).solved.any()
    with pytest.raises(CannotAssemble):
        solve_assembly(home_posture(robot))
    told = predict(as_declared(at_home(robot)))
    assert np.isnan(told.deviation).all()
    assert told.reason[0]


def test_robot_with_clearance_is_rejected():
    robot = coaxial_beams(np.zeros(6), clearance=Clearance(radial=1e-5))
    with pytest.raises(ValueError, match="found a clearance, expected a robot without"):
        flexibility(at_home(robot))


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_responses_satisfy_betti_reciprocity(seed):
    """By Betti's theorem, w . (platform screw) = (joint wrench due to w) . error."""
    robot, rng = elastic_robot(seed, 2)
    load = rng.normal(size=6)
    columns = rng.normal(size=(6 * len(robot.frames), 3))
    carried = np.array([not f.name.endswith("tip") for f in robot.frames])
    columns *= np.repeat(carried, 6)[:, None]
    through = solved(robot, load, np.zeros((len(robot.frames), 6))).joint_wrenches[0]
    moved = flexibility(at_home(robot)).platform_of(columns)[0]
    scale = np.abs(through) @ np.abs(columns)
    assert np.abs(load @ moved - through @ columns).max() < 1e-7 * scale.max()
