"""Problems side by side: each by itself, proved, and whatever its neighbours are."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture, together
from assembly.linear import energy, zone
from assembly.linear.closure import linearise, virtual_joints
from assembly.linear.energy import solve_assembly
from assembly.linear.lanes import assemble_side_by_side
from assembly.linear.robot_structure import structure_of
from assembly.linear.zone import zone_margin
from assembly.robots import BUILT_IN
from tests.robots_for_tests import (
    ROWS,
    assemble_at,
    proved,
    random_robot,
    row,
    stack,
    with_bounded_motion,
)


def test_multipliers_prove_the_bound_on_the_problem_as_it_is_written(grid):
    """By the complementary energy in numpy, which shares nothing with the lanes."""
    robot, postures = grid
    T, mismatch = stack(postures)
    lanes = assemble_at(robot, T, mismatch=mismatch)
    for i in (0, 11, 20, 33):
        one = solve_assembly(postures[i], method="reference")
        bound = replace(one, multipliers=lanes.multipliers[i]).bound
        assert bound == pytest.approx(proved(lanes)[i], rel=1e-9)


@pytest.mark.parametrize("kappa", [0.2, 1.0])
def test_an_answer_does_not_depend_on_its_neighbours(grid, rng, kappa):
    """Other order, other neighbours, alone: not a bit changes."""
    robot, postures = grid
    T, mismatch = stack(postures)
    errors = kappa * robot.errors * rng.uniform(0, 1, (len(T), 1, 1))
    errors[::7] = 0.0  # some need nothing, others many iterations
    whole = assemble_at(robot, T, errors, mismatch)
    for _ in range(4):
        order = rng.permutation(len(T))
        other = assemble_at(robot, T[order], errors[order], mismatch[order])
        for name in ROWS:
            assert np.array_equal(row(other, name), row(whole, name)[order])
    for i in range(0, len(T), 5):
        alone = assemble_at(robot, T[[i]], errors[[i]], mismatch[[i]])
        for name in ROWS:
            assert np.array_equal(row(alone, name)[0], row(whole, name)[i])


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_where_bounds_of_motions_matter_no_answer_depends_on_its_neighbours(
    seed, loaded
):
    """Draws of which some leave a bound: in other company, alone, by one posture."""
    rng = np.random.default_rng(seed)
    home = home_posture(with_bounded_motion(random_robot(rng, joints=4), rng))
    load = rng.normal(size=6) if loaded else None
    errors = 1e-4 * rng.normal(size=(11, len(home.robot.frames), 6))
    errors[::3] *= 1e-2
    whole = solve_assembly(home, load, errors=errors)
    assert set(whole.method) == {"compiled"}
    held = whole.held[0].tolist()
    assert held
    order = rng.permutation(len(errors))
    other = solve_assembly(home, load, errors=errors[order])
    for name in ROWS:
        np.testing.assert_array_equal(row(whole, name)[order], row(other, name))
    for i, one in enumerate(errors):
        alone = solve_assembly(home, load, errors=one[None])
        posture = replace(home, robot=home.robot.with_errors(one))
        single = solve_assembly(posture, load)
        for name in ROWS:
            np.testing.assert_array_equal(row(whole, name)[i], row(alone, name)[0])
        assert single.method == "compiled"
        assert (i in held) == bool(single.joints.bounded_motion)
        assert np.array_equal(single.clearances, whole[i].clearances)
        for name in ("energy", "platform_screw", "multipliers"):
            assert np.array_equal(getattr(single, name), getattr(whole, name)[i])


@pytest.mark.parametrize("loaded", [False, True])
def test_within_bounds_of_motions_the_energy_is_the_references(loaded):
    """Energies of each to 1e-8 of it and of the work: what both certificates allow."""
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


def test_postures_of_different_rank_stand_side_by_side(rng):
    """Three parallel hinges: their turns are independent unless they stand in line."""
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
def test_a_margin_does_not_depend_on_its_neighbours(grid, rng, compliant):
    robot, postures = grid
    at, count = together(postures), len(postures)
    errors = robot.errors * rng.uniform(0, 1, (count, 1, 1))
    errors[::5] = 0.0
    whole = zone_margin(at, compliant, errors)
    orders = [rng.permutation(count) for _ in range(4)] + [[i] for i in range(8)]
    for order in orders:
        other = zone_margin(at[order], compliant, errors[order])
        for name in ("margin", "bound", "method"):
            assert np.array_equal(getattr(other, name), getattr(whole, name)[order])


@pytest.mark.parametrize("compliant", ["rigid", "free"])
@pytest.mark.parametrize("kappa", [0.05, 0.2, 1.0])
def test_margins_are_proportional_to_the_errors_and_proved(grid, compliant, kappa):
    """All clearances scale with the margin: no solver has a say in that."""
    robot, postures = grid
    lanes = zone_margin(postures, compliant, kappa * robot.errors)
    whole = zone_margin(postures, compliant)
    assert set(lanes.method) == {"compiled"}
    assert lanes.margin == pytest.approx(kappa * whole.margin, rel=2e-8)
    assert np.all(lanes.bound >= lanes.margin * (1 - 1e-8))


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("each", [True, False])
def test_what_is_not_solved_side_by_side_the_reference_solves_with_its_own_errors(
    grid, count, each, monkeypatch
):
    """The last point is left out; errors are each point's own, or those of all."""
    robot, postures = grid
    at = postures[:count]
    errors = robot.errors * np.arange(1.0, 1 + (count if each else 1))[:, None, None]
    errors = errors if each else errors[0]
    expected = zone_margin(at, "free", errors)

    def all_but_the_last(structure, T, errors, mismatch, out):
        out[0][:-1], out[1][:-1] = expected.margin[:-1], expected.bound[:-1]
        out[3][:-1] = 0

    monkeypatch.setattr(zone, "margins_side_by_side", all_but_the_last)
    found = zone_margin(at, "free", errors)
    assert found.method.tolist() == ["compiled"] * (count - 1) + ["reference"]
    assert np.array_equal(found.margin[:-1], expected.margin[:-1])
    assert found.margin[-1] == pytest.approx(expected.margin[-1], rel=1e-7)
    assert found.bound[-1] <= found.margin[-1]


@pytest.mark.parametrize("kappa", [0.05, 0.3, 1.0])
@pytest.mark.parametrize("load", [None, [1.0, 2.0, 3.0, 30.0, 10.0, -100.0]])
def test_draws_at_one_posture_have_the_bits_of_points(grid, rng, kappa, load):
    """One row for all, where some draws wait for others, or a row for each."""
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


@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margins_at_one_posture_have_the_bits_of_points(grid, rng, compliant):
    robot, postures = grid
    errors = robot.errors * rng.uniform(-1, 1, (61, *robot.errors.shape))
    errors[:20:7] = 0.0
    draws = zone_margin(postures[3], compliant, errors=errors)
    points = zone_margin([postures[3]] * 61, compliant, errors=errors)
    for name in ("margin", "bound", "forces"):
        assert np.array_equal(getattr(draws, name), getattr(points, name)), name


def test_forces_on_clearances_prove_the_margin(grid, rng):
    """Their sizes on all cones add up to 1, and they grow no work but the errors'."""
    robot, postures = grid
    joints, structure = structure_of(robot, springs=False, own_axes_free=True)
    errors = robot.errors * rng.uniform(-1, 1, (9, *robot.errors.shape))
    found = zone_margin(postures[3], "free", errors=errors)
    sizes = np.add.reduceat(found.forces**2, structure.starts[:-1], axis=1)
    assert np.sqrt(sizes).sum(axis=1) == pytest.approx(1.0, rel=1e-12)
    # multipliers of the closures with these forces and none on free motions
    A = linearise(postures[3]).rows
    columns = A @ np.hstack([joints.cones, joints.free])
    asked = np.pad(found.forces, ((0, 0), (0, joints.free.shape[1])))
    q, _, _, _ = np.linalg.lstsq(columns.T, asked.T, rcond=1e-10)
    assert np.abs(columns.T @ q - asked.T).max() < 1e-8 * np.abs(found.forces).max()
    work = np.einsum("mk,mi,ki->k", -q, A, errors.reshape(9, -1))
    assert work == pytest.approx(found.bound, rel=1e-7)


@pytest.mark.parametrize("load", ["none", "each its own", "the same"])
def test_a_posture_that_stays_changes_no_bit(grid, rng, load):
    """What is kept of it while only errors and loads change, and forgotten after."""
    robot, postures = grid
    # whole blocks of two, four and eight lanes, and mixed ones
    stays = [0] * 16 + [5] * 8 + [3] * 8 + [0] * 5 + [3, 7, 3, 7] + [0] * 16 + [7] * 9
    T, off = stack([postures[i] for i in stays])
    count, n = len(stays), len(robot.frames)
    errors = robot.errors * rng.uniform(0, 1, (count, 1, 1))
    errors[::6] = 0.0
    loads = 30.0 * rng.normal(size=(count, 2, n, 6))
    if load == "the same":  # but for those in the middle of what stays
        loads[:10], loads[12:] = loads[0], loads[40]
    joints, structure = structure_of(robot)

    def solved(rows):
        out, own = energy._empty(joints, len(rows)), loads[rows]
        assemble_side_by_side(
            structure, T[rows], errors[rows], off[rows],
            None if load == "none" else own, out,
        )  # fmt: skip
        return out

    whole = solved(np.arange(count))
    assert (whole["outcome"] < energy._LEFT).any()
    orders = [rng.permutation(count), *([i] for i in (0, 9, 11, 16, 20, 27, 30, 50))]
    for order in orders:
        for name, rows in solved(np.array(order)).items():
            assert np.array_equal(rows, whole[name][order], equal_nan=True)
