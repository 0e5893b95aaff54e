"""K_C of many postures at once is that of one at a time."""

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture, place_many
from assembly.model.robot import Frame, MatrixLink, Robot
from assembly.platform_stiffness.linear_tangent import without_clearance
from assembly.platform_stiffness.many_stiffnesses import platform_stiffnesses
from assembly.robots import BUILT_IN, load_robot
from tests.robots_for_tests import random_robot

UNIT = np.eye(6)


def assert_same(many, row, one):
    """Entries over sqrt(C_ii C_jj); both keep compliances of very different sizes."""
    C = one.compliance
    if one.free.size:
        np.testing.assert_array_equal(many.compliance[row], C)
        assert many.singular[row].free_text == one.free_text
        return
    size = np.sqrt(np.diag(C)) + 1e-300
    np.testing.assert_allclose(
        many.compliance[row] / np.outer(size, size), C / np.outer(size, size),
        atol=1e-9,
    )  # fmt: skip
    finite = np.isfinite(one.eigen.values)
    np.testing.assert_array_equal(np.isfinite(many.eigen_stiffnesses[row]), finite)
    np.testing.assert_allclose(
        many.eigen_stiffnesses[row, finite], one.eigen.values[finite], rtol=1e-6
    )
    for axis in UNIT[size > 1e-300]:
        shares = many.shares(axis)
        for part, share in one.shares(axis).items():
            assert shares[part][row] == pytest.approx(share, abs=1e-9)


@pytest.mark.parametrize("name", BUILT_IN)
def test_at_home_it_is_that_of_one_posture(name):
    posture = home_posture(load_robot(name))
    many = platform_stiffnesses(posture.robot, posture.transforms[None])
    assert set(many.method) == {"compiled"}
    assert_same(many, 0, without_clearance(posture))


def test_a_posture_does_not_depend_on_its_neighbours(rng):
    """To the last bit: alone, or in another order."""
    robot = load_robot("irsbot2")
    poses = np.full((19, 6), np.nan)
    poses[:, 0], poses[:, 2] = np.linspace(-0.3, 0.3, 19), -0.45
    T = np.array([p.transforms for p in place_many(robot, poses)[0]])
    together = platform_stiffnesses(robot, T).compliance
    order = rng.permutation(len(T))
    shuffled = platform_stiffnesses(robot, T[order]).compliance
    assert np.array_equal(shuffled, together[order])
    for i in (0, 7, 18):
        assert np.array_equal(
            platform_stiffnesses(robot, T[i : i + 1]).compliance[0], together[i]
        )


def test_over_a_workspace_it_is_that_of_each_posture():
    robot = load_robot("irsbot2")
    poses = np.full((6, 6), np.nan)
    poses[:, 0], poses[:, 2] = np.linspace(-0.3, 0.3, 6), -0.45
    postures, _ = place_many(robot, poses)
    many = platform_stiffnesses(robot, np.array([p.transforms for p in postures]))
    for row, posture in enumerate(postures):
        assert_same(many, row, without_clearance(posture))


@pytest.mark.parametrize("seed", range(30))
def test_of_random_robots_it_is_the_same(seed):
    """Some have free motions, some rigid directions; ranks are told alike."""
    rng = np.random.default_rng(seed)
    posture = home_posture(random_robot(rng, legs=int(rng.integers(1, 4))))
    many = platform_stiffnesses(
        posture.robot, posture.transforms[None], posture.mismatch
    )
    assert_same(many, 0, without_clearance(posture))


def test_a_free_motion_has_no_number():
    frames = (
        Frame("slide", joint="prismatic", link=MatrixLink(UNIT)),
        Frame("tip", "slide"),
    )
    posture = home_posture(Robot("slider", "tip", frames))
    many = platform_stiffnesses(posture.robot, posture.transforms[None])
    free = np.isnan(many.compliance[0])
    assert free[5].all()
    np.testing.assert_allclose(many.compliance[0, :5, :5], np.eye(5))
    np.testing.assert_allclose(many.eigen_stiffnesses[0], [0, 1, 1, 1, 1, 1])
    assert [many.along(axis)[0] for axis in UNIT] == [1, 1, 1, 1, 1, 0]
    assert many.singular[0].free_text == (
        "nothing resists the platform's motion [0 0 0 0 0 1] [rad, m]"
    )


def test_stiffness_of_what_gives_way_along_x_alone_is_infinite_across_it():
    """A sprung slide along x, turned by a rounded right angle."""
    K = np.diag([np.inf] * 5 + [1e5])
    frames = (
        Frame("slide", rotation=[0, np.pi / 2, 0], joint="prismatic",
              joint_stiffness=K),
        Frame("tip", "slide", rotation=[0, -np.pi / 2, 0]),
    )  # fmt: skip
    posture = home_posture(Robot("slide", "tip", frames))
    many = platform_stiffnesses(posture.robot, posture.transforms[None])
    along = np.array([many.along(axis)[0] for axis in UNIT])
    assert along[3] == pytest.approx(1e5, rel=1e-9)
    assert np.isinf(np.delete(along, 3)).all()
