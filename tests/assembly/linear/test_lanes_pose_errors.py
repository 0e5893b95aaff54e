"""Bounds of (27) side by side: against the reference's, and against each other."""

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear import moving_clearances
from assembly.linear.energy import solve_assembly
from assembly.linear.lanes import bounds_side_by_side
from assembly.linear.pose_error import bound_pose_error, bound_pose_errors
from assembly.linear.robot_structure import structure_of
from assembly.linear.solutions import FALLBACK, SOLVED, Bounds, Centres, ClearanceLoads
from assembly.model.robot import Clearance
from assembly.robots import BUILT_IN
from tests.robots_for_tests import assemble_at, coaxial_beams, random_robot, stack

HALVES = ("rotation", "translation")
READINGS = ("frozen", "free")
RADIUS = 1e-3


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("kappa", [0.0, 0.05, 0.2, 1.0])
def test_brackets_of_the_papers_robot_are_as_narrow_as_asked(grid, reading, kappa):
    robot, postures = grid
    T, off = stack(postures)
    lanes = bound_pose_errors(robot, T, reading, kappa * robot.errors, off)
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
        robot, T = home.robot, np.repeat(home.transforms[None], 4, axis=0)
        off = np.full(4, home.mismatch)
        energies = assemble_at(robot, T, errors, off)
        many = bound_pose_errors(robot, T, reading, errors, off, energies, offset=at)
        solved = np.flatnonzero((many.status == "ok") & ~many.one_by_one)
        compiled += len(solved)
        for i in solved[:2].tolist():
            # of the same solution of (22)
            one = bound_pose_error(energies[i], reading, offset=at, method="reference")
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


def test_what_is_not_bounded_side_by_side_the_reference_bounds(grid, monkeypatch):
    """And only that."""
    robot, postures = grid
    T, off = stack(postures[:4])
    energies = assemble_at(robot, T, mismatch=off)

    def every_other(structure, T, mismatch, centres, loads, asked, out):
        for name in HALVES:
            getattr(out, name)[::2] = 7.0
        out.supports[:] = 9
        out.outcome[1::2] = FALLBACK

    monkeypatch.setattr(moving_clearances, "bounds_side_by_side", every_other)
    found = bound_pose_errors(robot, T, "free", None, off, energies)
    assert found.one_by_one.tolist() == [False, True, False, True]
    assert np.all(found.rotation_error[::2] == 7.0)
    for i in (1, 3):
        one = bound_pose_error(
            solve_assembly(postures[i], method="reference"), "free", method="reference"
        )
        assert found.rotation_error[i] == pytest.approx(one.rotation_error, abs=2e-6)


def judged(force, reach):
    """A pin in a hole pressed with a force [N] at so much of its radius; energy 1 J.

    Whether it is clear if the pin is held, and whether nothing then moves.
    """
    robot = coaxial_beams([0.0] * 6, clearance=Clearance(radial=RADIUS))
    moving, posture = structure_of(robot, "rigid")[1], home_posture(robot)
    structure = structure_of(robot)[1]
    assert structure.starts.tolist() == moving.starts.tolist() == [0, 2]
    # multipliers of the scaled closures: of x, what the cone's columns feel is this
    row = np.zeros((1, 6 * len(robot.closures)))
    row[0, 3] = force * structure.size
    clearances = np.array([[0.6, 0.8]]) * reach
    loads = ClearanceLoads(
        structure, row, clearances, np.ones(1), np.ones(1), np.zeros(1, np.int64)
    )
    motions = np.zeros((1, len(moving.free_bound)))
    centres = Centres(np.zeros((1, 6)), clearances, motions)
    out = Bounds(
        *np.zeros((2, 1, 2)), *np.zeros((2, 1, 6)), *np.zeros((2, 1), np.int64)
    )
    asked = np.zeros(3), np.full(2, 1e-9)
    T = posture.transforms[None].copy()
    bounds_side_by_side(moving, T, np.zeros(1), centres, loads, asked, out)
    decided = out.outcome[0] == SOLVED
    return decided, decided and out.supports[0] == 0


@pytest.mark.parametrize(
    ("force", "reach", "expected"),
    [
        # load force x radius over energy, slack 1 - reach; apart by a hundred
        (1.0, 1.0, (True, True)),
        (1.0, 1.0 - 0.9e-5, (True, True)),
        (1.0, 1.0 - 1.1e-5, (False, False)),
        (1.0, 1.0 - 0.9e-3, (False, False)),
        (1.0, 1.0 - 1.1e-3, (False, False)),
        (1.0, 0.85, (True, False)),
        (0.0, 0.0, (True, False)),
        (0.0, 1.0, (True, False)),
        # both are rounding: nothing holds it, and that is no doubt
        (0.5e-6, 1.0 - 0.5e-9, (True, False)),
        (1.0, np.nan, (False, False)),
        (np.nan, 0.5, (False, False)),
    ],
)
def test_held_free_or_in_doubt_by_a_factor_of_a_hundred(force, reach, expected):
    assert judged(force, reach) == expected
