"""Solutions at many points, compared with solutions at single points."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, together
from forcefit.assembly.linear.closure import linearise, virtual_joints
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.robots import BUILT_IN
from tests.robots_for_tests import (
    ROWS,
    assemble_at,
    coaxial_beams,
    random_robot,
    row,
    with_bounded_motion,
)

K = 1e6


def pins(gaps):
    """Return a spring in series with a pin of clearance 1e-4 m, and gaps along x."""
    frames = (
        Frame("arm", translation=[0.5, 0, 0], link=MatrixLink(K * np.eye(6))),
        Frame("pin", "arm", clearance=Clearance(radial=1e-4)),
        Frame("end", "pin"),
        Frame("wall", translation=[0.5, 0, 0]),
    )
    home = home_posture(Robot("pins", "end", frames, (("end", "wall"),)))
    errors = np.zeros((len(gaps), 4, 6))
    errors[:, 3, 3] = gaps
    return home, errors


def rigid_pins(gaps):
    """Return a pin of clearance 1e-4 m without a spring."""
    home, errors = pins(gaps)
    frames = (Frame("arm", translation=[0.5, 0, 0]), *home.robot.frames[1:])
    robot = Robot("rigid", "end", frames, (("end", "wall"),))
    return home_posture(robot), errors


def test_points_can_be_selected_by_mask_slice_and_repeated_indices():
    """The energy is K (gap - 1e-4)^2 / 2 for gaps larger than the clearance."""
    gaps = np.array([0.5e-4, 2e-4, 3e-4, 1.5e-4])
    home, errors = pins(gaps)
    many = solve_assembly(home, errors=errors)
    by_hand = K * np.maximum(gaps - 1e-4, 0.0) ** 2 / 2
    assert many.energy == pytest.approx(by_hand, rel=1e-6, abs=1e-15)
    for rows in (gaps > 1e-4, slice(1, 3), [2, 2, 0]):
        some = many[rows]
        assert some.energy.tolist() == many.energy[rows].tolist()
        assert np.array_equal(some.wrenches, many.wrenches[rows])
        assert np.array_equal(some[0].wrenches, some.wrenches[0])
    assert many[-1].energy == many.energy[3]
    with pytest.raises(IndexError):
        many[4]


def test_selected_point_without_solution_has_its_status():
    home, errors = rigid_pins(np.array([0.5e-4, 2e-4, 0.1e-4]))
    many = solve_assembly(home, errors=errors)
    assert many.status.tolist() == ["ok", "cannot assemble", "ok"]
    twice = many[[1, 0, 1]]
    for some, i in ((many, 1), (twice, 0), (twice, 2)):
        assert np.isnan(some.energy[i])
        with pytest.raises(CannotAssemble, match="the loops stay open"):
            some[i]
    assert twice[1].energy == many[0].energy == 0.0


def test_solution_of_a_single_point_has_no_length():
    home, _ = pins([0.0])
    with pytest.raises(TypeError, match="Assembly of one point has no length"):
        len(solve_assembly(home))


@pytest.mark.parametrize("loaded", [(1, 0), (0, 1), (1, 1), (0, 0)])
def test_loaded_and_unloaded_points_use_their_own_errors(loaded):
    """The energies K g^2 / 4 of the gap and F^2 / 4 K of the load add up."""
    sets = np.zeros((2, 6, 6))
    sets[:, 2, 3] = 1e-4, 3e-4
    at = home_posture(coaxial_beams(np.zeros(6), (K, K)))
    forces = np.array(loaded)[:, None] * np.array([0.0, 0, 0, 100.0, 0, 0])
    found = solve_assembly([at] * 2, forces, errors=sets)
    expected = K * sets[:, 2, 3] ** 2 / 4 + forces[:, 3] ** 2 / (4 * K)
    assert found.energy == pytest.approx(expected, rel=1e-9)
    assert found.loaded.tolist() == [bool(one) for one in loaded]
    for one, errors in zip(found, sets, strict=True):
        assert (one.posture.robot.errors == errors).all()


def test_redundant_joint_motions_have_minimum_norm():
    """Each of two pins on a common axis rotates by half of the angle."""
    gap = [1e-3, 0, 2e-3, 1e-4, 0, 0]
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=MatrixLink(1e5 * np.eye(6))),
        Frame("pin", "one", joint="revolute"),
        Frame("mid", "pin"),
        Frame("second", "mid", [0, 0, 0.1], joint="revolute"),
        Frame("end", "second", [0, 0, -0.1]),
        Frame("wall", translation=[0.5, 0, 0], geometric_error=gap),
    )
    robot = Robot("pins", "mid", frames, (("end", "wall"),))
    home = home_posture(robot)
    batch = assemble_at(robot, home.transforms[None])
    one = solve_assembly(home, method="reference")
    assert batch.method[0] == "compiled"
    assert batch.platform_screw[0] == pytest.approx(one.platform_screw, abs=1e-14)
    # Each pin rotates by half of the 2e-3 rad about the common axis.
    assert batch.platform_screw[0, 2] == pytest.approx(1e-3, rel=1e-9)


def test_energy_of_stiff_and_soft_springs_in_series_is_accurate():
    """The compliances about the common axis are 1 and 1e-8 rad/(N m)."""
    soft = np.diag([1.0, 1e8, 1e8, 1e8, 1e8, 1e8])
    gap = np.array([1e-2, 1e-4, 0, 0, 0, 0])
    frames = (
        Frame("one", translation=[0.5, 0, 0], link=MatrixLink(soft)),
        Frame("end", "one", rotation=[0, 0, 0.3], link=MatrixLink(1e8 * np.eye(6))),
        Frame("wall", translation=[0.5, 0, 0], rotation=[0, 0, 0.3],
              geometric_error=gap),
    )  # fmt: skip
    robot = Robot("two", "end", frames, (("end", "wall"),))
    batch = assemble_at(robot, home_posture(robot).transforms[None])
    turned = np.array([
        gap[0] * np.cos(0.3) - gap[1] * np.sin(0.3),
        gap[0] * np.sin(0.3) + gap[1] * np.cos(0.3),
    ])
    # The compliances in series are 1 + 1e-8 about the soft axis, and 2e-8 otherwise.
    by_hand = turned[0] ** 2 / (1 + 1e-8) / 2 + turned[1] ** 2 / 2e-8 / 2
    assert batch.energy[0] == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize(
    ("shape", "errors", "message"),
    [
        ((2, 5, 4, 4), None, r"transforms of shape \(2, 5, 4, 4\)"),
        ((2, 6, 4, 4), (3, 6, 6), r"errors of shape \(3, 6, 6\), expected"),
        ((2, 6, 3, 4), None, r"transforms of shape \(2, 6, 3, 4\)"),
    ],
)
def test_transforms_or_errors_of_wrong_shape_are_rejected(shape, errors, message):
    robot = coaxial_beams(np.zeros(6))
    given = None if errors is None else np.zeros(errors)
    with pytest.raises(ValueError, match=message):
        assemble_at(robot, np.zeros(shape), given)


def test_nonfinite_values_are_rejected():
    robot = coaxial_beams(np.zeros(6))
    T = home_posture(robot).transforms[None].copy()
    with pytest.raises(ValueError, match="not all finite"):
        assemble_at(robot, T, np.full((6, 6), np.nan))
    T[0, 0, 0, 3] = np.inf
    with pytest.raises(ValueError, match="not all finite"):
        assemble_at(robot, T)


def test_empty_list_of_postures_gives_an_empty_solution():
    robot = coaxial_beams(np.zeros(6))
    assert len(assemble_at(robot, np.zeros((0, 6, 4, 4))).energy) == 0


# Repeated postures in blocks test the reuse of matrix factors.
BLOCKS = [0] * 16 + [5] * 8 + [3] * 8 + [0] * 5 + [3, 7, 3, 7] + [0] * 16 + [7] * 9


@pytest.mark.parametrize("load", ["none", "each its own", "the same"])
def test_energy_of_a_point_does_not_depend_on_other_points(grid, rng, load):
    """Results are bit-identical in another order and for single points."""
    robot, postures = grid
    at = together([*postures, *(postures[i] for i in BLOCKS)])
    count = len(postures) + len(BLOCKS)
    errors = robot.errors * rng.uniform(0, 1, (count, 1, 1))
    errors[::7] = 0.0  # points without errors need no iterations
    wrenches = 30.0 * rng.normal(size=(count, 6))
    if load == "the same":  # Three points in the middle have other loads.
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
    """The methods agree to 1e-8 of energy and work."""
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
    """The closure rank of three parallel hinges is smaller if they are collinear."""
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
def test_margin_of_a_point_does_not_depend_on_other_points(grid, rng, compliant):
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
def test_samples_at_one_posture_equal_separate_points(grid, rng, kappa, load):
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
