"""Unknowns of a robot with finite motions: what each moves, its unit, its size."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.exact.finite_robot import (
    LINK,
    SPRING,
    FiniteRobot,
    along_own,
    nominally_carried,
)
from assembly.exact.placement import place
from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import home_posture, place_robot
from assembly.linear.closure import virtual_joints
from assembly.model.links import joint_compliances, link_compliances
from assembly.model.robot import Frame, Robot
from stiffness.screws import rotation_matrix, transform
from tests.linkages_for_tests import four_bar
from tests.robots_for_tests import random_robot


def finite(posture):
    return FiniteRobot(posture, virtual_joints(posture.robot))


def with_all_motions(seed):
    """Some robot, its passive joints with a play too."""
    return finite(home_posture(random_robot(np.random.default_rng(seed), legs=3)))


@pytest.mark.parametrize("seed", range(4))
def test_springs_store_half_their_square_whatever_they_belong_to(seed):
    """Of a link's screw or a joint's it is y.y / 2: their columns L have L L' = C."""
    model = with_all_motions(seed)
    robot = model.posture.robot
    for kind, compliances in (
        (LINK, link_compliances(robot)), (SPRING, joint_compliances(robot)),
    ):  # fmt: skip
        for frame, C in enumerate(compliances):
            own = (model.motion == kind) & (model.frame == frame)
            own &= np.arange(len(own)) < model.springs.stop
            L = model.columns[own].T
            size = np.abs(C).max()
            assert np.abs(L @ L.T - C).max() <= 1e-12 * size


@pytest.mark.parametrize("seed", range(4))
def test_the_metric_is_the_squared_size_of_all_screws(seed, rng):
    """Angles, and translations in reference lengths."""
    model = with_all_motions(seed)
    assert model.size == size_of(model.posture.robot)
    x = rng.normal(size=len(model.frame)) / np.sqrt(np.diag(model.metric))
    at = place(model, x)
    scale = np.repeat([1.0, 1 / model.size], 3)
    prismatic = [f.joint == "prismatic" for f in model.posture.robot.frames]
    own = at.own / np.where(prismatic, model.size, 1.0)
    expected = ((at.screws * scale) ** 2).sum() + own @ own
    assert x @ model.metric @ x == pytest.approx(expected, rel=1e-12)
    assert np.array_equal(model.metric, model.metric.T)


def test_what_joints_carry_is_behind_their_coordinates():
    """Transforms are before: T exp(q about or along z), of one posture or of many."""
    posture = place_robot(four_bar(), joints={"crank": 0.9})
    carried = nominally_carried(posture)
    for T, q, after in zip(
        posture.transforms, posture.coordinates, carried, strict=True
    ):
        turn = transform(np.zeros(3), rotation_matrix([0, 0, q]))
        assert after == pytest.approx(T @ turn, abs=1e-15)
    many = replace(
        posture,
        transforms=np.stack([posture.transforms] * 2),
        coordinates=np.stack([posture.coordinates] * 2),
    )
    assert nominally_carried(many)[1] == pytest.approx(carried, abs=1e-15)
    slide = Robot("slide", "s", (Frame("s", joint="prismatic"),))
    moved = along_own(slide, np.array([0.25]))
    assert moved[0] == pytest.approx(transform([0, 0, 0.25], np.eye(3)), abs=1e-15)


def test_bodies_with_their_errors_are_moved_by_these_in_the_frames_axes():
    frame = Frame("a", translation=[0.3, 0.1, 0], rotation=[0.2, 0.5, -0.1],
                  geometric_error=[0.01, -0.02, 0.03, 1e-3, 2e-3, -3e-3])  # fmt: skip
    model = finite(home_posture(Robot("one", "a", (frame,))))
    nominal = transform(frame.translation, rotation_matrix(frame.rotation))
    off = transform([1e-3, 2e-3, -3e-3], rotation_matrix([0.01, -0.02, 0.03]))
    assert model.erring_bodies[0] == pytest.approx(nominal @ off, abs=1e-15)
