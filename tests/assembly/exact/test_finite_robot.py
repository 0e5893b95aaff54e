"""Unknowns of a robot with finite motions: what each moves, its unit, its size."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.exact.finite_robot import (
    CLEARANCE,
    LINK,
    OWN,
    SPRING,
    FiniteRobot,
    along_own,
    nominally_carried,
)
from assembly.exact.placement import place
from assembly.kinematics.closure_rates import closure_signs
from assembly.kinematics.nominal import size_of
from assembly.kinematics.posture import home_posture, place_robot
from assembly.linear.closure import virtual_joints
from assembly.model.links import joint_compliances, link_compliances
from assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from stiffness.screws import rotation_matrix, transform
from tests.linkages_for_tests import four_bar
from tests.robots_for_tests import random_robot


def finite(posture):
    return FiniteRobot(posture, virtual_joints(posture.robot))


def with_all_motions(seed):
    """Some robot, its passive joints with a play too."""
    return finite(home_posture(random_robot(np.random.default_rng(seed), legs=3)))


@pytest.mark.parametrize("seed", range(4))
def test_every_unknown_is_one_screw_of_one_frame(seed):
    """Its column is that of the virtual joints; springs, plays, then free motions."""
    model = with_all_motions(seed)
    joints = model.joints
    every = np.hstack([joints.elastic, joints.cones, joints.free])
    again = np.zeros_like(every)
    for k, (frame, column) in enumerate(zip(model.frame, model.columns, strict=True)):
        again[6 * frame : 6 * frame + 6, k] = column
    assert np.array_equal(again, every)
    springs, plays = joints.elastic.shape[1], joints.cones.shape[1]
    assert model.springs == slice(0, springs)
    assert model.bounded == slice(springs, springs + plays)


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


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_only_a_passive_joint_without_a_spring_moves_along_its_own_axis(seed):
    model = with_all_motions(seed)
    count = 0
    for k in range(model.springs.stop, len(model.frame)):
        frame = model.posture.robot.frames[model.frame[k]]
        own = frame.passive and not frame.compliant
        axis = 5 if frame.joint == "prismatic" else 2
        along = own and model.columns[k][axis] != 0
        assert model.motion[k] == (OWN if along else CLEARANCE)
        count += along
    assert count > 0


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


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_in_their_units_free_motions_have_size_one(seed):
    model = with_all_motions(seed)
    free = slice(model.bounded.stop, None)
    in_units = np.diag(model.metric)[free] * model.units[free] ** 2
    assert in_units == pytest.approx(np.ones(len(in_units)), rel=1e-13)
    assert len(in_units) > 0
    assert (model.units[: model.bounded.stop] == 1.0).all()


@pytest.mark.parametrize("seed", range(2))
def test_unknowns_are_on_the_chains_of_their_frames(seed):
    """Of each closure's two, of the platform's; signs where they do not share it."""
    model = with_all_motions(seed)
    robot = model.posture.robot

    def chain(name):
        names = {name}
        while (name := robot.frame(name).parent) != "base":
            names.add(name)
        return np.array([robot.frames[i].name in names for i in model.frame])

    first, second = model.chains
    for k, (a, b) in enumerate(robot.closures):
        assert np.array_equal(first[k], chain(a))
        assert np.array_equal(second[k], chain(b))
        assert [robot.frames[i].name for i in model.closed_frames[k]] == [a, b]
    signs = first.astype(int) - second
    assert np.array_equal(model.signs, signs)
    assert np.array_equal(model.signs, closure_signs(robot)[:, model.frame])
    assert np.array_equal(model.on_platform, chain(robot.platform))


def test_an_unknown_comes_before_what_it_moves():
    """Link, then play, then spring, then the joint's own; half within a motion."""
    robot = Robot("row", "end", (
        Frame("a", translation=[0.3, 0, 0], link=MatrixLink(1e3 * np.eye(6)),
              joint="revolute", clearance=Clearance(axial=1e-4)),
        Frame("end", "a", [0.1, 0, 0], link=MatrixLink(1e3 * np.eye(6))),
        Frame("beside", translation=[0.2, 0, 0], link=MatrixLink(1e3 * np.eye(6))),
    ))  # fmt: skip
    model = finite(home_posture(robot))
    rank = {"a": 0, "end": 1}
    for i, p in enumerate(model.comes_before):
        for j, found in enumerate(p):
            one, other = (robot.frames[model.frame[k]].name for k in (i, j))
            if "beside" in (one, other):
                expected = 0.5 * (one == other)
            else:
                places = [
                    4 * rank[robot.frames[model.frame[k]].name] + model.motion[k]
                    for k in (i, j)
                ]
                expected = float(np.heaviside(places[1] - places[0], 0.5))
            assert found == expected


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
