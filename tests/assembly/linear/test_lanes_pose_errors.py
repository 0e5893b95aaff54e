"""Bounds of (27) side by side in C++ against numba's, and against each other."""

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear import moving_clearances
from assembly.linear.energy import minimise_energies
from assembly.linear.moving_clearances import Asked, compiled_bounds
from assembly.linear.pose_error import bound_pose_errors
from assembly.linear.solutions import FALLBACK, SOLVED
from assembly.robots import BUILT_IN
from forcefit.native.libraries import by_numba
from tests.robots_for_tests import random_robot, stack

HALVES = ("rotation", "translation")
READINGS = ("frozen", "free")


def both_bounds(monkeypatch, home, errors, asked):
    """Bounds in C++ alone, then by numba alone, of the same solutions of (22)."""
    robot, T = home.robot, np.repeat(home.transforms[None], len(errors), axis=0)
    off = np.full(len(errors), home.mismatch)
    energies = minimise_energies(robot, T, errors, off)
    given = robot, T, off, errors, energies, asked
    with monkeypatch.context() as patch:
        patch.setattr(moving_clearances, "_bound_left", lambda *left: None)
        lanes = compiled_bounds(*given)
    with by_numba():
        return lanes, compiled_bounds(*given)


def assert_brackets_share_a_point(lanes, numba, rounding=1e-15):
    """Where both are solved; what one leaves the other leaves."""
    assert np.array_equal(lanes.outcome, numba.outcome)
    solved = lanes.outcome == SOLVED
    for half in HALVES:
        one, other = getattr(lanes, half)[solved], getattr(numba, half)[solved]
        assert np.all(one[:, 0] <= other[:, 1] + rounding)
        assert np.all(other[:, 0] <= one[:, 1] + rounding)
        screws = getattr(lanes, f"{half}_screw")[solved]
        part = screws[:, :3] if half == "rotation" else screws[:, 3:]
        sizes = np.linalg.norm(part, axis=1)
        assert sizes == pytest.approx(one[:, 0], rel=1e-12, abs=1e-18)
    return np.count_nonzero(solved)


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("kappa", [0.0, 0.05, 0.2, 1.0])
def test_brackets_of_the_papers_robot_hold_numbas(grid, reading, kappa):
    robot, postures = grid
    T, off = stack(postures)
    errors = kappa * robot.errors
    energies = minimise_energies(robot, T, errors, off)
    lanes = bound_pose_errors(robot, T, reading, errors, off, energies)
    with by_numba():
        numba = bound_pose_errors(robot, T, reading, errors, off, energies)
    assert not (lanes.fallback | numba.fallback).any()
    for half in ("rotation_error", "translation_error"):
        one, other = getattr(lanes, half), getattr(numba, half)
        assert np.diff(one).max() <= 1e-6
        assert np.all(one[:, 0] <= other[:, 1] + 1e-15)
        assert np.all(other[:, 0] <= one[:, 1] + 1e-15)


@pytest.mark.parametrize("reading", READINGS)
def test_brackets_of_any_robot_hold_numbas(reading, rng, monkeypatch):
    """At another point of the platform, with and without bounds of passive joints."""
    homes = [home_posture(make()) for make in BUILT_IN.values()]
    for seed in range(60):
        draw = np.random.default_rng(seed)
        homes.append(home_posture(random_robot(draw, 1 + seed % 3, 1 + seed // 3 % 3)))
    asked, solved = Asked(reading, offset=(0.1, -0.05, 0.2)), 0
    for home in homes:
        own = home.robot.errors
        if not own.any():
            own = 1e-4 * rng.normal(size=own.shape)
        errors = own * np.array([0.0, 0.1, 0.5, -1.0])[:, None, None]
        lanes, numba = both_bounds(monkeypatch, home, errors, asked)
        solved += assert_brackets_share_a_point(lanes, numba)
    assert solved


@pytest.mark.parametrize("reading", READINGS)
def test_a_bound_does_not_depend_on_its_neighbours(grid, rng, reading):
    """Other order, other neighbours, alone: not a bit changes."""
    robot, postures = grid
    T, off = stack(postures)
    errors = robot.errors * rng.uniform(0, 1, (len(T), 1, 1))
    errors[::7] = 0.0
    whole = bound_pose_errors(robot, T, reading, errors, off)
    orders = [rng.permutation(len(T)) for _ in range(3)] + [[i] for i in range(8)]
    for order in orders:
        other = bound_pose_errors(robot, T[order], reading, errors[order], off[order])
        for name in ("rotation_error", "translation_error", "rotation_screw",
                     "translation_screw", "supports"):  # fmt: skip
            assert np.array_equal(getattr(other, name), getattr(whole, name)[order])


def test_what_is_not_bounded_side_by_side_numba_bounds(grid, monkeypatch):
    """And only that."""
    robot, postures = grid
    T, off = stack(postures[:4])
    energies = minimise_energies(robot, T, mismatch=off)
    hinged = minimise_energies(robot, T, None, off, "hinged")
    monkeypatch.setattr(moving_clearances, "minimise_energies", lambda *given: hinged)
    with by_numba():
        expected = bound_pose_errors(robot, T, "free", None, off, energies)

    def every_other(structure, T, mismatch, centres, loads, asked, out):
        for name in ("rotation", "translation"):
            getattr(out, name)[::2] = 7.0
        out.supports[:] = 9
        out.outcome[1::2] = FALLBACK
        return True

    monkeypatch.setattr(moving_clearances, "bounds_side_by_side", every_other)
    found = bound_pose_errors(robot, T, "free", None, off, energies)
    assert not found.fallback.any()
    assert np.all(found.rotation_error[::2] == 7.0)
    assert np.array_equal(found.rotation_error[1::2], expected.rotation_error[1::2])
    assert np.array_equal(found.supports[1::2], expected.supports[1::2])
