"""Batched bounds of (27) against one posture at a time, on many robots."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture, together
from assembly.linear.energy import solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reference.reduction import FreeMotion
from assembly.model.robot import Clearance, Frame, Robot
from tests.assembly.linear.test_pose_error import hinged_frame
from tests.robots_for_tests import (
    coaxial_beams,
    irsbot2_over,
)

PARTS = ("rotation_error", "translation_error")


@pytest.fixture(scope="module")
def grid():
    """The paper's robot with the first draw, at 15 poses of its workspace."""
    robot, postures = irsbot2_over(
        np.linspace(-0.3, 0.3, 5), np.linspace(-0.6, -0.2, 3)
    )
    return robot, together(postures)


def assert_overlap(batch, i, one, uncertain=2e-7):
    """Both brackets hold the truth; the two solutions of (22) differ by the root of
    their gaps, 1e-8 and less of the energy.
    """
    for name in PARTS:
        low, high = getattr(batch, name)[i]
        other = getattr(one, name)
        assert high - low <= 1e-6
        assert low <= other[1] + uncertain
        assert high >= other[0] - uncertain
        screw = getattr(batch, name.replace("error", "screw"))[i]
        half = screw[:3] if name.startswith("r") else screw[3:]
        assert np.linalg.norm(half) == pytest.approx(low, rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("reading", ["frozen", "free"])
@pytest.mark.parametrize("kappa", [0.0, 0.05, 0.2, 1.0])
def test_batch_brackets_what_one_at_a_time_brackets(grid, reading, kappa):
    robot, postures = grid
    at = replace(postures, robot=robot.with_errors(kappa * robot.errors))
    batch = bound_pose_error(solve_assembly(at), reading)
    assert set(batch.status) == {"ok"}
    for i in range(0, len(batch), 4):
        alone = solve_assembly(at[i], method="reference")
        one = bound_pose_error(alone, reading, method="reference")
        assert_overlap(batch, i, one)


def test_errors_of_their_own_another_point_and_tighter_tolerances(grid, rng):
    robot, postures = grid
    errors = rng.uniform(-0.3, 0.3, (3, 1, 1)) * robot.errors
    options = {
        "tolerance_rotation": 1e-8, "tolerance_translation": 1e-9,
        "offset": [0.1, -0.05, 0.2],
    }  # fmt: skip
    many = solve_assembly(postures[:3], errors=errors)
    batch = bound_pose_error(many, "free", **options)
    for i in range(3):
        own = robot.with_errors(errors[i])
        answer = solve_assembly(replace(postures[i], robot=own), method="reference")
        assert_overlap(
            batch, i, bound_pose_error(answer, "free", **options, method="reference")
        )
    assert np.diff(batch.rotation_error).max() <= 1e-8
    assert np.diff(batch.translation_error).max() <= 1e-9


@pytest.mark.parametrize("spin", [10.0, 1e-2, 3e-4, 1e-5, 0.0])
@pytest.mark.parametrize("reading", ["frozen", "free"])
def test_bounds_of_passive_joints_count_in_a_batch(spin, reading):
    """Compiled where no clearance comes near them, else set up in numpy."""
    posture = home_posture(hinged_frame(spin))
    one = bound_pose_error(
        solve_assembly(posture, method="reference"), reading, method="reference"
    )
    batch = bound_pose_error(solve_assembly([posture]), reading)
    assert_overlap(batch, 0, one)
    assert batch.one_by_one[0] == (0.0 < spin < 1e-3)
    loose = home_posture(hinged_frame(None))
    most = bound_pose_error(solve_assembly([loose]), reading)
    less = batch.rotation_error[0, 1] < 0.99 * most.rotation_error[0, 0]
    assert less == (spin < 1e-3)


def test_the_budget_goes_one_at_a_time():
    robot = coaxial_beams(np.array([0, 0, 0, 2e-4, 0, 0]))
    posture = home_posture(robot)
    batch = bound_pose_error(solve_assembly([posture]), "budget", energy_budget=0.5)
    one = bound_pose_error(solve_assembly(posture), "budget", 0.5, method="reference")
    assert batch.one_by_one[0]
    assert_overlap(batch, 0, one)


def test_a_platform_that_moves_freely_has_no_bound():
    robot = Robot("door", "tip", (
        Frame("hinge", joint="revolute"),
        Frame("tip", "hinge", [0.5, 0, 0], clearance=Clearance(radial=1e-4)),
    ))  # fmt: skip
    batch = bound_pose_error(solve_assembly([home_posture(robot)]))
    assert batch.one_by_one[0]
    assert np.isinf(batch.rotation_error[0]).all()


def test_what_cannot_be_assembled_has_no_bounds():
    rigid = (Frame("a", geometric_error=[0, 0, 0, 1e-3, 0, 0]), Frame("b"))
    robot = Robot("open", "a", rigid, (("a", "b"),))
    batch = bound_pose_error(solve_assembly([home_posture(robot)]))
    assert batch.status[0] == "cannot assemble"
    assert "stays open" in batch.reason[0]
    assert np.isnan(batch.rotation_error).all()
    assert batch[0].unproved == batch.unproved[0] == batch.reason[0]


def test_points_under_a_load_that_a_reading_cannot_carry_say_so():
    """A hinge that a soft spring holds turns freely in the reading free."""
    spring = np.diag([np.inf, np.inf, 1e2, *[np.inf] * 3])
    robot = Robot("sprung door", "tip", (
        Frame("hinge", joint="revolute", joint_stiffness=spring),
        Frame("tip", "hinge", [0.5, 0, 0], clearance=Clearance(radial=1e-4)),
    ))  # fmt: skip
    many = solve_assembly([home_posture(robot)] * 2, [0.0, 0, 0, 0, 10.0, 0])
    bounds = bound_pose_error(many, "free")
    assert bounds.status.tolist() == ["no equilibrium"] * 2
    assert "no joint or spring resists: it moves hinge rz" in bounds.reason[0]
    with pytest.raises(FreeMotion):
        bound_pose_error(many[0], "free")


def test_bad_arguments_are_named(grid):
    many = solve_assembly(grid[1][:2])
    for assembly in (many, many[0]):
        with pytest.raises(ValueError, match="assumption is 'loose', expected one of"):
            bound_pose_error(assembly, "loose")
