"""Energies of many points against the reference, on every kind of robot."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear.certificate import unproved
from assembly.linear.energy import solve_assembly
from assembly.linear.reference.energy import CannotAssemble
from assembly.model.robot import Frame, MatrixLink, Robot
from assembly.robots import BUILT_IN
from tests.robots_for_tests import (
    NUMBERS,
    assemble_at,
    coaxial_beams,
    irsbot2_with,
    proved,
    random_robot,
)


def assert_same(batch, i, one):
    """Within what the two certificates allow: least energies lie in both intervals."""
    assert unproved(one) == ""
    allowed = batch.duality_gap()[i] + one.duality_gap()
    allowed += 1e-12 * one.energy_without_clearance
    assert abs(batch.energy[i] - one.energy) <= allowed + 1e-30
    assert batch.energy_without_clearance[i] == pytest.approx(
        one.energy_without_clearance, rel=1e-7, abs=1e-30
    )
    assert proved(batch)[i] <= one.energy * (1 + 1e-12) + 1e-30


@pytest.mark.parametrize("name", sorted(BUILT_IN))
@pytest.mark.parametrize("size", [1e-6, 1e-3])
def test_every_built_in_robot_gives_the_references_answer(name, size, rng):
    home = home_posture(BUILT_IN[name]())
    robot = home.robot
    T = np.broadcast_to(home.transforms, (3, *home.transforms.shape))
    errors = size * rng.normal(size=(3, len(robot.frames), 6))
    if name == "irsbot2":  # its proximal loops are rigid and perfect
        errors[:, ~np.any(irsbot2_with(NUMBERS["cases"][0]).errors, axis=1)] = 0.0
    batch = assemble_at(robot, T, errors, home.mismatch)
    assert batch.certified.all()
    assert set(batch.method) == {"compiled"}
    for i in range(3):
        one = solve_assembly(
            replace(home, robot=robot.with_errors(errors[i])), method="reference"
        )
        assert_same(batch, i, one)
        if not len(batch.joints.group):
            assert batch.platform_screw[i] == pytest.approx(one.platform_screw)


def test_random_robots_give_the_single_answer_or_fall_back():
    compiled = 0
    for seed in range(120):
        rng = np.random.default_rng(seed)
        robot = random_robot(rng, legs=1 + seed % 3, joints=1 + seed // 3 % 3)
        home = home_posture(robot)
        batch = assemble_at(robot, home.transforms[None], None, home.mismatch)
        compiled += batch.method[0] == "compiled"
        if batch.status[0] != "ok":
            assert batch.status[0] == "cannot assemble"
            with pytest.raises(CannotAssemble) as error:
                solve_assembly(home, method="reference")
            assert batch.reason[0] == str(error.value)
            assert np.isnan(batch.energy[0])
            assert not batch.certified[0]
            continue
        one = solve_assembly(home, method="reference")
        assert_same(batch, 0, one)
        if batch.method[0] == "compiled":
            assert batch.certified[0]
            if not len(one.clearances):  # nothing left to choose
                size = np.abs(one.platform_screw).max() + 1e-12
                off = np.abs(batch.platform_screw[0] - one.platform_screw)
                assert off.max() < 1e-9 * size
    assert compiled


def test_free_motions_that_are_not_unique_are_the_least():
    """Two pins on one axis share its turn: half each, like the single answer."""
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
    # the pin below the platform turns half the 2e-3 rad about their common axis
    assert batch.platform_screw[0, 2] == pytest.approx(1e-3, rel=1e-9)


def test_stiff_and_soft_springs_in_series_keep_the_stiff_one():
    """1 and 1e-8 rad/(N m) about one axis, across it 1e-8 twice."""
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
    # by hand: 1 + 1e-8 about the soft axis, 2e-8 across
    by_hand = turned[0] ** 2 / (1 + 1e-8) / 2 + turned[1] ** 2 / 2e-8 / 2
    assert batch.energy[0] == pytest.approx(by_hand, rel=1e-12)


def test_the_certificate_refuses_a_spoilt_point(grid):
    """Springs 1.5e-8 too long, multipliers 2e-4 too small or not a number."""
    robot, postures = grid
    T = postures[0].transforms[None].copy()
    good = assemble_at(robot, T)
    worse = replace(good, elastic=good.elastic * (1 + 1.5e-8))
    assert good.certified.all()
    assert not worse.certified.any()
    weaker = replace(good, multipliers=good.multipliers * (1 - 2e-4))
    assert not weaker.certified.any()
    unknown = replace(good, multipliers=good.multipliers * np.nan)
    assert not unknown.certified.any()


@pytest.mark.parametrize(
    ("shape", "errors", "message"),
    [
        ((2, 5, 4, 4), None, r"transforms of shape \(2, 5, 4, 4\)"),
        ((2, 6, 4, 4), (3, 6, 6), r"errors of shape \(3, 6, 6\), expected"),
        ((2, 6, 3, 4), None, r"transforms of shape \(2, 6, 3, 4\)"),
    ],
)
def test_wrong_shapes_are_refused(shape, errors, message):
    robot = coaxial_beams(np.zeros(6))
    given = None if errors is None else np.zeros(errors)
    with pytest.raises(ValueError, match=message):
        assemble_at(robot, np.zeros(shape), given)


def test_values_that_are_not_finite_are_refused():
    robot = coaxial_beams(np.zeros(6))
    T = home_posture(robot).transforms[None].copy()
    with pytest.raises(ValueError, match="not all finite"):
        assemble_at(robot, T, np.full((6, 6), np.nan))
    T[0, 0, 0, 3] = np.inf
    with pytest.raises(ValueError, match="not all finite"):
        assemble_at(robot, T)


def test_no_points_are_no_answers():
    robot = coaxial_beams(np.zeros(6))
    assert len(assemble_at(robot, np.zeros((0, 6, 4, 4))).energy) == 0


def test_a_single_answer_closes_and_has_the_least_wrenches(grid):
    """Springs of a compiled answer close to rounding; wrenches are the reference's."""
    _, postures = grid
    for posture in postures[::9]:
        answer, reference = (
            solve_assembly(posture),
            solve_assembly(posture, method="reference"),
        )
        assert answer.closure_residual() < 1e-14
        assert answer.stored == pytest.approx(reference.stored, rel=1e-8)
        size = np.linalg.norm(reference.closure_wrenches, axis=0)
        off = np.abs(answer.closure_wrenches - reference.closure_wrenches)
        # known to the root of the gap, 1e-4 of the springs
        assert np.all(off < 2e-3 * size)
        assert answer.ranks == reference.ranks
