"""Bounds of (27) at many points, compared with the reference method."""

import numpy as np
import pytest

from forcefit import Clearance, Frame, Robot, bound_pose_error, solve_assembly
from forcefit.assembly.kinematics.posture import home_posture, together
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.robots import BUILT_IN
from tests.assembly.linear.test_pose_error import hinged_frame
from tests.robots_for_tests import random_robot

PARTS = ("rotation_error", "translation_error")
ASSUMPTIONS = ("frozen", "free")


def assert_overlap(batch, i, one, uncertain=2e-7, width=1e-6):
    """Assert that two intervals overlap, because both contain the true value."""
    for name in PARTS:
        low, high = getattr(batch, name)[i]
        other = getattr(one, name)
        assert high - low <= width
        assert low <= other[1] + uncertain
        assert high >= other[0] - uncertain
        screw = getattr(batch, name.replace("error", "screw"))[i]
        half = screw[:3] if name.startswith("r") else screw[3:]
        assert np.linalg.norm(half) == pytest.approx(low, rel=1e-12, abs=1e-18)


@pytest.mark.parametrize("assumption", ASSUMPTIONS)
def test_compiled_pose_error_bounds_agree_with_the_reference(assumption, rng):
    """The point is offset from the platform's origin."""
    homes = [home_posture(make()) for make in BUILT_IN.values()]
    for seed in range(12):
        draw = np.random.default_rng(seed)
        homes.append(home_posture(random_robot(draw, 1 + seed % 3, 1 + seed // 3 % 3)))
    at, compiled = (0.1, -0.05, 0.2), 0
    for home in homes:
        own = home.robot.errors
        if not own.any():
            own = 1e-4 * rng.normal(size=own.shape)
        errors = own * np.array([0.0, 0.1, 0.5, -1.0])[:, None, None]
        assemblies = solve_assembly(home, errors=errors)
        many = bound_pose_error(assemblies, assumption, offset=at)
        solved = np.flatnonzero((many.status == "ok") & ~many.one_by_one)
        compiled += len(solved)
        for i in solved[:2].tolist():
            one = bound_pose_error(
                assemblies[i], assumption, offset=at, method="reference"
            )
            assert_overlap(many, i, one, uncertain=1e-12)
    assert compiled


def test_pose_error_bounds_differ_by_at_most_the_tolerance(grid):
    robot, postures = grid
    errors = np.array([-0.3, 0.1, 0.2])[:, None, None] * robot.errors
    options = {
        "tolerance_rotation": 1e-8, "tolerance_translation": 1e-9,
        "offset": [0.1, -0.05, 0.2],
    }  # fmt: skip
    many = solve_assembly(postures[:3], errors=errors)
    batch = bound_pose_error(many, "free", **options)
    for i in range(3):
        one = bound_pose_error(many[i], "free", **options, method="reference")
        assert_overlap(batch, i, one, uncertain=1e-12, width=1e-8)
    assert np.diff(batch.translation_error).max() <= 1e-9


@pytest.mark.parametrize("assumption", ASSUMPTIONS)
def test_pose_error_bound_does_not_depend_on_other_points(grid, rng, assumption):
    """Results are bit-identical in another order and for single points."""
    robot, postures = grid
    at, count = together(postures), len(postures)
    errors = robot.errors * rng.uniform(0, 1, (count, 1, 1))
    errors[::7] = 0.0
    whole = bound_pose_error(solve_assembly(at, errors=errors), assumption)
    orders = [rng.permutation(count) for _ in range(3)] + [[i] for i in range(8)]
    for order in orders:
        some = solve_assembly(at[order], errors=errors[order])
        other = bound_pose_error(some, assumption)
        for name in ("rotation_error", "translation_error", "rotation_screw",
                     "translation_screw", "supports"):  # fmt: skip
            assert np.array_equal(getattr(other, name), getattr(whole, name)[order])


@pytest.mark.parametrize("spin", [10.0, 1e-2, 3e-4, 1e-5, 0.0])
@pytest.mark.parametrize("assumption", ["frozen", "free"])
def test_pose_errors_at_many_points_respect_motion_limits(spin, assumption):
    """Points where a clearance reaches the limit are solved by the reference method."""
    posture = home_posture(hinged_frame(spin))
    one = bound_pose_error(
        solve_assembly(posture, method="reference"), assumption, method="reference"
    )
    batch = bound_pose_error(solve_assembly([posture]), assumption)
    assert_overlap(batch, 0, one)
    assert batch.one_by_one[0] == (0.0 < spin < 1e-3)
    loose = home_posture(hinged_frame(None))
    most = bound_pose_error(solve_assembly([loose]), assumption)
    less = batch.rotation_error[0, 1] < 0.99 * most.rotation_error[0, 0]
    assert less == (spin < 1e-3)


def test_pose_error_of_an_unassemblable_robot_is_missing():
    rigid = (Frame("a", geometric_error=[0, 0, 0, 1e-3, 0, 0]), Frame("b"))
    robot = Robot("open", "a", rigid, (("a", "b"),))
    batch = bound_pose_error(solve_assembly([home_posture(robot)]))
    assert batch.status[0] == "cannot assemble"
    assert "stays open" in batch.reason[0]
    assert np.isnan(batch.rotation_error).all()
    assert batch[0].unproved == batch.unproved[0] == batch.reason[0]


def test_load_about_an_axis_that_is_free_by_assumption_is_rejected():
    """Under the assumption ``free``, a hinge with a spring rotates freely."""
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
