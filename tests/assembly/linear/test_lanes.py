"""Many points in one call: results equal those of single points, with proof."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, together
from forcefit.assembly.linear.closure import linearise, virtual_joints
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.robots import BUILT_IN
from tests.robots_for_tests import (
    ROWS,
    assemble_at,
    random_robot,
    row,
    with_bounded_motion,
)

# some postures in blocks of two, four and eight, where their factors are kept
BLOCKS = [0] * 16 + [5] * 8 + [3] * 8 + [0] * 5 + [3, 7, 3, 7] + [0] * 16 + [7] * 9


@pytest.mark.parametrize("load", ["none", "each its own", "the same"])
def test_energy_of_a_point_is_independent_of_its_neighbours(grid, rng, load):
    """In another order, among other points, alone: bit-identical."""
    robot, postures = grid
    at = together([*postures, *(postures[i] for i in BLOCKS)])
    count = len(postures) + len(BLOCKS)
    errors = robot.errors * rng.uniform(0, 1, (count, 1, 1))
    errors[::7] = 0.0  # some need nothing, others many iterations
    wrenches = 30.0 * rng.normal(size=(count, 6))
    if load == "the same":  # but for some in the middle
        wrenches[:60], wrenches[63:] = wrenches[0], wrenches[100]
    if load == "none":
        wrenches[:] = 0.0
    whole = solve_assembly(at, wrenches, errors=errors)
    assert set(whole.method) == {"compiled"}
    for rows in [rng.permutation(count) for _ in range(3)] + [
        [i] for i in range(0, count, 5)
    ]:
        other = solve_assembly(at[rows], wrenches[rows], errors=errors[rows])
        for name in ROWS:
            assert np.array_equal(row(other, name), row(whole, name)[rows]), name


@pytest.mark.parametrize("loaded", [False, True])
def test_energy_with_motion_limits_equals_the_reference_method(loaded):
    """Equal to 1e-8 of the energy and the work, which both certificates allow."""
    held = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        home = home_posture(with_bounded_motion(random_robot(rng, joints=4), rng))
        load = rng.normal(size=6) if loaded else None
        one = solve_assembly(home, load)
        reference = solve_assembly(home, load, method="reference")
        held += bool(one.joints.bounded_motion)
        assert bool(reference.joints.bounded_motion) <= bool(one.joints.bounded_motion)
        allowed = 2e-8 * (reference.stored + abs(reference.work))
        allowed += 2e-12 * reference.energy_without_clearance + 1e-25
        assert abs(one.potential - reference.potential) <= allowed
        assert one.clearance_excess() <= 1e-9
    assert held >= 5


def test_postures_of_different_rank_do_not_depend_on_each_other(rng):
    """Rotations of three parallel hinges are independent unless they are in line."""
    home = home_posture(BUILT_IN["five_bar"]())
    robot, T = home.robot, np.repeat(home.transforms[None], 8, axis=0)
    T[::3, :, 1:3, 3] = 0.0
    free = virtual_joints(robot).free
    ranks = [
        np.linalg.matrix_rank(linearise(replace(home, transforms=own)).rows @ free)
        for own in T[:2]
    ]
    assert ranks == [2, 3]
    errors = 1e-4 * rng.normal(size=(8, len(robot.frames), 6))
    whole = assemble_at(robot, T, errors)
    for i in range(8):
        alone = assemble_at(robot, T[[i]], errors[[i]])
        for name in ROWS:
            np.testing.assert_array_equal(row(alone, name)[0], row(whole, name)[i])


@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margin_of_a_point_is_independent_of_its_neighbours(grid, rng, compliant):
    robot, postures = grid
    at = together([*postures, *(postures[i] for i in BLOCKS)])
    count = len(postures) + len(BLOCKS)
    errors = robot.errors * rng.uniform(0, 1, (count, 1, 1))
    errors[::5] = 0.0
    whole = zone_margin(at, compliant, errors)
    orders = [rng.permutation(count) for _ in range(3)]
    for order in orders + [[i] for i in range(0, count, 9)]:
        other = zone_margin(at[order], compliant, errors[order])
        for name in ("margin", "bound", "method"):
            assert np.array_equal(getattr(other, name), getattr(whole, name)[order])


@pytest.mark.parametrize("kappa", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("load", [None, [1.0, 2.0, 3.0, 30.0, 10.0, -100.0]])
def test_draws_at_one_posture_are_bit_identical_to_separate_points(
    grid, rng, kappa, load
):
    """One posture for all draws, or a posture for each."""
    robot, postures = grid
    errors = kappa * robot.errors * rng.uniform(-1, 1, (61, 1, 1))
    errors += kappa * robot.errors * rng.uniform(-1, 1, (61, *robot.errors.shape))
    errors[::9] = 0.0
    draws = solve_assembly(postures[3], load, errors=errors)
    points = solve_assembly([postures[3]] * 61, load, errors=errors)
    alone = [solve_assembly(postures[3], load, errors=errors[[i]]) for i in range(12)]
    for name in ROWS:
        assert np.array_equal(row(draws, name), row(points, name)), name
        for i, one in enumerate(alone):
            assert np.array_equal(row(one, name)[0], row(draws, name)[i]), name
