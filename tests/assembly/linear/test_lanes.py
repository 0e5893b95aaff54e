"""Problems side by side in C++ against numba's kernels, and against each other."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear import energy, zone
from assembly.linear.assemblies import COMPILED
from assembly.linear.closure import linearise, virtual_joints
from assembly.linear.energy import minimise_energies
from assembly.linear.fallback import reference_assembly, reference_margin
from assembly.linear.lanes import (
    assemble_side_by_side,
    margins_side_by_side,
)
from assembly.linear.robot_structure import structure_of
from assembly.linear.zone import zone_margins
from assembly.robots import BUILT_IN
from forcefit.native.libraries import by_numba
from tests.robots_for_tests import NUMBERS, irsbot2_with, random_robot, stack

ROWS = (
    "outcome", "energy", "bound", "energy_without_clearance", "platform_screw",
    "closure_residual", "clearances", "motions", "multipliers",
)  # fmt: skip


def numbas_energies(*given):
    """Least energies by numba's kernel alone."""
    with by_numba():
        return minimise_energies(*given)


def assert_both_proved(lanes, numba):
    """Each energy is above the other's certified bound, and each proves its gap."""
    assert lanes.certified.all()
    assert numba.certified.all()
    rounding = 1e-12 * numba.energy_without_clearance + 1e-30
    assert np.all(lanes.energy >= numba.bound - rounding)
    assert np.all(numba.energy >= lanes.bound - rounding)
    assert lanes.energy_without_clearance == pytest.approx(
        numba.energy_without_clearance, rel=1e-7, abs=1e-30
    )
    assert lanes.closure_residual.max(initial=0.0) < 1e-11
    assert lanes.clearance_excess.max(initial=0.0) < 1e-14


@pytest.mark.parametrize("kappa", [0.0, 0.05, 0.1, 0.2, 0.5, 1.0])
def test_all_points_of_the_papers_robot_are_certified(grid, kappa):
    robot, postures = grid
    T, mismatch = stack(postures)
    lanes = minimise_energies(robot, T, kappa * robot.errors, mismatch)
    assert lanes.fallbacks() == {}
    assert_both_proved(lanes, numbas_energies(robot, T, kappa * robot.errors, mismatch))


def test_no_point_of_the_papers_robot_is_left_to_numba(grid, monkeypatch):
    """Rows that no spring enters are told from rounding, whatever their length."""
    left = []
    monkeypatch.setattr(energy, "_fill_by_numba", lambda *given: left.append(given))
    robot, postures = grid
    T, mismatch = stack(postures)
    for kappa in (0.1, 1.0):
        minimise_energies(robot, T, kappa * robot.errors, mismatch)
    assert not left


@pytest.mark.parametrize("name", sorted(BUILT_IN))
@pytest.mark.parametrize("size", [1e-6, 1e-5, 1e-4, 1e-3])
def test_every_built_in_robot_has_numbas_energies(name, size, rng):
    home = home_posture(BUILT_IN[name]())
    T = np.broadcast_to(home.transforms, (7, *home.transforms.shape))
    errors = size * rng.normal(size=(7, len(home.robot.frames), 6))
    if name == "irsbot2":  # its proximal loops are rigid and perfect
        errors[:, ~np.any(irsbot2_with(NUMBERS["cases"][0]).errors, axis=1)] = 0.0
    given = home.robot, T, errors, home.mismatch
    lanes, numba = minimise_energies(*given), numbas_energies(*given)
    assert lanes.fallbacks() == numba.fallbacks() == {}
    assert_both_proved(lanes, numba)


def test_random_robots_have_numbas_energies_or_its_reasons():
    """What numba's kernel leaves to the fallback, these leave, for the same reason."""
    from assembly.linear.compiled_energy import assemble_all

    solved = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        robot = random_robot(rng, legs=1 + seed % 3, joints=1 + seed // 3 % 3)
        home = home_posture(robot)
        joints, structure = structure_of(robot)
        errors = np.array([robot.errors, 0.3 * robot.errors, -robot.errors])
        T = np.repeat(home.transforms[None], 3, axis=0)
        off = np.full(3, home.mismatch)
        lanes, numba = (rows_for(joints, robot, 3) for _ in range(2))
        assert assemble_side_by_side(structure, T, errors, off, lanes)
        none = np.zeros((0, 2, T.shape[1], 6))
        assemble_all(structure, T, errors, off, none, numba)
        left = numba.outcome >= COMPILED
        assert np.array_equal(lanes.outcome[left], numba.outcome[left])
        assert np.all(lanes.outcome[~left] < COMPILED)
        allowed = 2e-8 * numba.energy + 2e-12 * numba.without_clearance + 1e-30
        off = np.abs(lanes.energy - numba.energy)
        assert np.all(off[~left] <= allowed[~left])
        solved += np.sum(~left)
        for i in np.flatnonzero(~left).tolist():
            # the deformation of every spring holds the energy
            stored = 0.5 * np.sum(lanes.elastic[i] ** 2)
            assert stored == pytest.approx(lanes.energy[i], rel=1e-10, abs=1e-25)
    assert solved  # however many numba solves


def rows_for(joints, robot, count):
    """Arrays for answers of so many points, their springs' deformation included."""
    from assembly.linear.solutions import Solutions

    def zeros(*shape):
        return np.zeros((count, *shape))

    closures = 6 * len(robot.closures)
    return Solutions(
        np.zeros(count, dtype=np.int64), zeros(), zeros(), zeros(), zeros(), zeros(6),
        zeros(joints.cones.shape[1]), zeros(joints.free.shape[1]), zeros(closures),
        zeros(), zeros(len(joints.links)),
    )  # fmt: skip


def test_multipliers_prove_the_bound_on_the_problem_as_it_is_written(grid):
    """By the complementary energy in numpy, which shares nothing with the lanes."""
    robot, postures = grid
    T, mismatch = stack(postures)
    lanes = minimise_energies(robot, T, mismatch=mismatch)
    for i in (0, 11, 20, 33):
        one = reference_assembly(postures[i])
        proved = replace(one, multipliers=lanes.multipliers[i]).bound
        assert proved == pytest.approx(lanes.bound[i], rel=1e-9)


@pytest.mark.parametrize("kappa", [0.2, 1.0])
def test_an_answer_does_not_depend_on_its_neighbours(grid, rng, kappa):
    """Other order, other neighbours, alone: not a bit changes."""
    robot, postures = grid
    T, mismatch = stack(postures)
    errors = kappa * robot.errors * rng.uniform(0, 1, (len(T), 1, 1))
    errors[::7] = 0.0  # some need nothing, others many iterations
    whole = minimise_energies(robot, T, errors, mismatch)
    for _ in range(4):
        order = rng.permutation(len(T))
        other = minimise_energies(robot, T[order], errors[order], mismatch[order])
        for name in ROWS:
            assert np.array_equal(getattr(other, name), getattr(whole, name)[order])
    for i in range(0, len(T), 5):
        alone = minimise_energies(robot, T[[i]], errors[[i]], mismatch[[i]])
        for name in ROWS:
            assert np.array_equal(getattr(alone, name)[0], getattr(whole, name)[i])


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
    whole = minimise_energies(robot, T, errors)
    for i in range(8):
        alone = minimise_energies(robot, T[[i]], errors[[i]])
        for name in ROWS:
            assert np.array_equal(
                getattr(alone, name)[0], getattr(whole, name)[i], equal_nan=True
            )


@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margins_are_numbas_and_proved(grid, compliant):
    robot, postures = grid
    T, mismatch = stack(postures)
    for kappa in (0.05, 0.1, 0.2, 0.5, 1.0):
        given = robot, T, compliant, mismatch, kappa * robot.errors
        lanes = zone_margins(*given)
        with by_numba():
            numba = zone_margins(*given)
        assert not (lanes.fallback | numba.fallback).any()
        assert lanes.margin == pytest.approx(numba.margin, rel=2e-8)
        assert np.all(lanes.bound >= lanes.margin * (1 - 1e-8))
        assert np.all(lanes.bound <= numba.margin * (1 + 1e-11))


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("each", [True, False])
def test_what_is_not_solved_side_by_side_is_solved_with_its_own_errors(
    grid, count, each, monkeypatch
):
    """The last point is left out; errors are each point's own, or those of all."""
    robot, postures = grid
    T, mismatch = stack(postures[:count])
    errors = robot.errors * np.arange(1.0, 1 + (count if each else 1))[:, None, None]
    with by_numba():
        expected = zone_margins(robot, T, "free", mismatch, errors)

    def all_but_the_last(structure, T, errors, mismatch, out):
        out[0][:-1], out[1][:-1] = expected.margin[:-1], expected.bound[:-1]
        out[2][:-1] = 0
        return True

    monkeypatch.setattr(zone, "margins_side_by_side", all_but_the_last)
    found = zone_margins(robot, T, "free", mismatch, errors)
    assert np.array_equal(found.margin, expected.margin)
    assert not found.fallback.any()


@pytest.mark.parametrize("each", [True, False])
def test_what_no_loop_solves_is_solved_with_its_own_errors(grid, each, monkeypatch):
    """Errors of all points in one array, or each point's own."""
    robot, postures = grid
    T, mismatch = stack(postures[:3])
    errors = robot.errors * np.arange(1.0, 4.0)[:, None, None]
    errors = errors if each else errors[1]
    with by_numba():
        expected = zone_margins(robot, T, "free", mismatch, errors)
    monkeypatch.setattr(zone, "_solve_all", lambda *given: None)
    found = zone_margins(robot, T, "free", mismatch, errors)
    assert found.fallback.all()
    assert found.margin == pytest.approx(expected.margin, rel=1e-7)
    assert np.all(found.bound <= found.margin)


@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_margins_of_any_robot_are_numbas(compliant, rng):
    """Rounding decides what is left to the fallback: its margin is then compared."""
    from assembly.linear.compiled_zone import all_margins

    homes = [home_posture(make()) for make in BUILT_IN.values()]
    for seed in range(120):
        draw = np.random.default_rng(seed)
        homes.append(home_posture(random_robot(draw, 1 + seed % 3, 1 + seed // 3 % 3)))
    solved = 0
    for home in homes:
        _, structure = structure_of(home.robot, compliant)
        errors = 1e-4 * rng.normal(size=(5, len(home.robot.frames), 6))
        errors[2] = 0.0  # needs no clearance
        T = np.repeat(home.transforms[None], 5, axis=0)
        lanes, numba = ((*np.full((2, 5), np.nan), np.ones(5, int)) for _ in range(2))
        given = structure, T, errors, np.full(5, home.mismatch)
        assert margins_side_by_side(*given, lanes)
        all_margins(*given, *numba)
        for i in np.flatnonzero(lanes[2] == 0).tolist():
            expected = numba[0][i]
            if numba[2][i]:
                erring = replace(home, robot=home.robot.with_errors(errors[i]))
                expected = reference_margin(erring, compliant)[0]
            assert lanes[0][i] == pytest.approx(expected, rel=2e-8)
            solved += 1
    assert solved  # what they leave goes to the fallback, as numba's does


@pytest.mark.parametrize("compliant", ["rigid", "free"])
def test_a_margin_does_not_depend_on_its_neighbours(grid, rng, compliant):
    robot, postures = grid
    T, off = stack(postures)
    errors = robot.errors * rng.uniform(0, 1, (len(T), 1, 1))
    errors[::5] = 0.0
    whole = zone_margins(robot, T, compliant, off, errors)
    orders = [rng.permutation(len(T)) for _ in range(4)] + [[i] for i in range(8)]
    for order in orders:
        other = zone_margins(robot, T[order], compliant, off[order], errors[order])
        for name in ("margin", "bound", "fallback"):
            assert np.array_equal(getattr(other, name), getattr(whole, name)[order])


@pytest.mark.parametrize("kappa", [0.1, 0.5, 1.0])
def test_two_lanes_have_the_bits_of_many(grid, kappa):
    """Products and sums are rounded one by one, whatever the registers hold."""
    robot, postures = grid
    T, mismatch = stack(postures)
    errors = kappa * robot.errors
    many = minimise_energies(robot, T, errors, mismatch)
    margins = zone_margins(robot, T, "rigid", mismatch, errors)
    for i in range(0, len(T), 3):
        some = robot, T[i : i + 1], errors, mismatch[i : i + 1]
        one = minimise_energies(*some)
        for row in ROWS:
            assert np.array_equal(getattr(one, row)[0], getattr(many, row)[i]), row
        one = zone_margins(robot, T[i : i + 1], "rigid", mismatch[i : i + 1], errors)
        assert one.margin[0] == margins.margin[i]
        assert one.bound[0] == margins.bound[i]
