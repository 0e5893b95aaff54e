"""Bounds of (27) side by side: against the reference's, and against each other."""

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture, together
from assembly.linear import moving_clearances
from assembly.linear.energy import solve_assembly
from assembly.linear.lanes import REFERENCE
from assembly.linear.pose_error import bound_pose_error
from assembly.robots import BUILT_IN
from tests.robots_for_tests import random_robot

HALVES = ("rotation", "translation")
READINGS = ("frozen", "free")


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("kappa", [0.0, 0.05, 0.2, 1.0])
def test_brackets_of_the_papers_robot_are_as_narrow_as_asked(grid, reading, kappa):
    robot, postures = grid
    errors = np.array([kappa * robot.errors] * len(postures))
    lanes = bound_pose_error(solve_assembly(postures, errors=errors), reading)
    assert not lanes.one_by_one.any()
    for half in HALVES:
        bounds = getattr(lanes, f"{half}_error")
        assert np.diff(bounds).max() <= 1e-6
        screws = getattr(lanes, f"{half}_screw")
        part = screws[:, :3] if half == "rotation" else screws[:, 3:]
        sizes = np.linalg.norm(part, axis=1)
        assert sizes == pytest.approx(bounds[:, 0], rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("reading", READINGS)
def test_brackets_of_any_robot_share_a_point_with_the_references(reading, rng):
    """At another point of the platform, with and without bounds of passive joints."""
    homes = [home_posture(make()) for make in BUILT_IN.values()]
    for seed in range(24):
        draw = np.random.default_rng(seed)
        homes.append(home_posture(random_robot(draw, 1 + seed % 3, 1 + seed // 3 % 3)))
    at, compiled = (0.1, -0.05, 0.2), 0
    for home in homes:
        own = home.robot.errors
        if not own.any():
            own = 1e-4 * rng.normal(size=own.shape)
        errors = own * np.array([0.0, 0.1, 0.5, -1.0])[:, None, None]
        assemblies = solve_assembly(home, errors=errors)
        many = bound_pose_error(assemblies, reading, offset=at)
        solved = np.flatnonzero((many.status == "ok") & ~many.one_by_one)
        compiled += len(solved)
        for i in solved[:2].tolist():
            # of the same solution of (22)
            one = bound_pose_error(
                assemblies[i], reading, offset=at, method="reference"
            )
            for half in HALVES:
                low, high = getattr(many, f"{half}_error")[i]
                other = getattr(one, f"{half}_error")
                assert low <= other[1] + 1e-12
                assert other[0] <= high + 1e-12
    assert compiled


@pytest.mark.parametrize("reading", READINGS)
def test_a_bound_does_not_depend_on_its_neighbours(grid, rng, reading):
    """Other order, other neighbours, alone: not a bit changes."""
    robot, postures = grid
    at, count = together(postures), len(postures)
    errors = robot.errors * rng.uniform(0, 1, (count, 1, 1))
    errors[::7] = 0.0
    whole = bound_pose_error(solve_assembly(at, errors=errors), reading)
    orders = [rng.permutation(count) for _ in range(3)] + [[i] for i in range(8)]
    for order in orders:
        some = solve_assembly(at[order], errors=errors[order])
        other = bound_pose_error(some, reading)
        for name in ("rotation_error", "translation_error", "rotation_screw",
                     "translation_screw", "supports"):  # fmt: skip
            assert np.array_equal(getattr(other, name), getattr(whole, name)[order])


def test_what_is_not_bounded_side_by_side_the_reference_bounds(grid, monkeypatch):
    """And only that."""
    robot, postures = grid
    assemblies = solve_assembly(postures[:4])

    def every_other(structure, T, mismatch, centres, held, loads, asked, out):
        rotation, translation, *_, supports, outcome = out
        rotation[::2] = translation[::2] = 7.0
        supports[:] = 9
        outcome[1::2] = REFERENCE

    monkeypatch.setattr(moving_clearances, "bounds_side_by_side", every_other)
    found = bound_pose_error(assemblies, "free")
    assert found.one_by_one.tolist() == [False, True, False, True]
    assert np.all(found.rotation_error[::2] == 7.0)
    for i in (1, 3):
        one = bound_pose_error(
            solve_assembly(postures[i], method="reference"), "free", method="reference"
        )
        assert found.rotation_error[i] == pytest.approx(one.rotation_error, abs=2e-6)
