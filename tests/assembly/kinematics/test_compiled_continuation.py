"""Equations of the nominal closures, their derivatives, and the steps that solve them.

Called as Python: compiled, they are compared with C++ side by side.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.kinematics.compiled_continuation import (
    Free,
    Tree,
    _equations,
    _follow,
    _largest,
    _least_step,
    _newton,
    forward,
)
from assembly.kinematics.nominal import _tree, size_of
from assembly.model.robot import Frame, Robot
from stiffness.screws import rotation_matrix, transform
from tests.linkages_for_tests import CRANK, GROUND, five_bar, four_bar, four_bar_angles
from tests.robots_for_tests import random_robot

pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
NAN = np.nan


def some_robot(seed, legs=3):
    """Hinges, slides and fixed frames; a joint at the platform too."""
    robot = random_robot(np.random.default_rng(seed), legs, 3)
    frames = [
        replace(f, joint="revolute") if f.name == robot.platform else f
        for f in robot.frames
    ]
    return replace(robot, frames=tuple(frames))


def frames_of(robot, q):
    """Products of transforms, one after the other."""
    T, after = [], []
    for i, frame in enumerate(robot.frames):
        parent = robot.parents[i]
        before = np.eye(4) if parent < 0 else after[parent]
        T.append(before @ robot.fixed_transforms[i])
        motion = {
            "fixed": np.eye(4),
            "revolute": transform(np.zeros(3), rotation_matrix([0, 0, q[i]])),
            "prismatic": transform([0, 0, q[i]], np.eye(3)),
        }[frame.joint]
        after.append(T[i] @ motion)
    return np.array(T)


def free_of(robot, held=()):
    joints = np.array([
        i
        for i, frame in enumerate(robot.frames)
        if frame.joint != "fixed" and i not in held
    ])
    slides = [robot.frames[i].joint == "prismatic" for i in joints]
    columns = np.full(len(robot.frames), -1)
    columns[joints] = np.arange(len(joints))
    return Free(joints, np.where(slides, size_of(robot), 1.0), columns)


def equations(robot, q, pose, free):
    """Residuals, and their derivatives by the free joints as one matrix."""
    tree = Tree(**_tree(robot))
    R, p = forward(tree, q)
    r = np.zeros(6 * len(robot.closures) + 6)
    J = np.zeros((len(tree.moves), 6))
    _equations(tree, R, p, np.array(pose), free, r, J)
    dense = np.zeros((len(r), len(free.joints)))
    for g, (a, b) in enumerate(zip(tree.groups, tree.groups[1:], strict=False)):
        for e in range(a, b):
            column = free.columns[tree.moves[e, 0]]
            if column >= 0:
                dense[6 * g : 6 * g + 6, column] += J[e]
    return r, dense, J


@pytest.mark.parametrize("seed", range(3))
def test_frames_are_products_of_transforms(seed):
    robot = some_robot(seed)
    q = np.random.default_rng(seed).normal(size=len(robot.frames))
    R, p = forward(Tree(**_tree(robot)), q)
    T = frames_of(robot, q)
    assert T[:, :3, :3] == pytest.approx(R, abs=1e-14)
    assert T[:, :3, 3] == pytest.approx(p, abs=1e-14)


POSES = {
    "all": [0.1, -0.2, 0.3, 0.4, -0.5, 0.2],
    "place": [0.1, -0.2, 0.3, NAN, NAN, NAN],
    "turn": [NAN, NAN, NAN, 0.4, -0.5, 0.2],
    "some": [0.1, NAN, 0.3, NAN, -0.5, 0.2],
    "one turn": [NAN, NAN, NAN, NAN, NAN, 0.2],
    "one place": [NAN, 0.2, NAN, NAN, NAN, NAN],
    "none": [NAN] * 6,
}


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("seed", range(2))
def test_residuals_are_turns_and_gaps_per_length_between_what_should_meet(seed, pose):
    """Of two frames, then of the platform and its goal; rotations by scipy."""
    robot, goal = some_robot(seed), np.array(POSES[pose])
    q = 0.3 * np.random.default_rng(seed).normal(size=len(robot.frames))
    r, _, _ = equations(robot, q, goal, free_of(robot))
    T, size = frames_of(robot, q), size_of(robot)
    for k, pair in enumerate(robot.closures):
        a, b = (T[robot.index(name)] for name in pair)
        turn = Rotation.from_matrix(a[:3, :3] @ b[:3, :3].T).as_rotvec()
        assert r[6 * k : 6 * k + 3] == pytest.approx(turn, abs=1e-12)
        gap = (a[:3, 3] - b[:3, 3]) / size
        assert r[6 * k + 3 : 6 * k + 6] == pytest.approx(gap, abs=1e-14)
    platform = T[robot.index(robot.platform)]
    here = Rotation.from_matrix(platform[:3, :3])
    if np.isfinite(goal[3:]).all():
        turn = (here * Rotation.from_rotvec(goal[3:]).inv()).as_rotvec()
    else:
        turn = here.as_rotvec() - goal[3:]
    wanted = np.r_[turn, (platform[:3, 3] - goal[:3]) / size]
    assert r[-6:] == pytest.approx(np.nan_to_num(wanted, nan=0.0), abs=1e-12)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("seed", range(2))
def test_derivatives_of_residuals_are_their_differences(seed, pose):
    """Near closed frames, where a turn's derivative is the turn itself.

    The goal is where the platform is, but for 1e-7 of it, and so are the closures;
    slides count in reference lengths.
    """
    robot = some_robot(seed)
    q = np.array(robot.positions, dtype=float)
    T = frames_of(robot, q)[robot.index(robot.platform)]
    here = np.r_[T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_rotvec()]
    goal = np.where(np.isnan(POSES[pose]), NAN, here)
    held = [i for i, f in enumerate(robot.frames) if f.joint != "fixed"][1:2]
    free = free_of(robot, held)
    r, found, J = equations(robot, q, goal, free)
    assert np.abs(r).max() < 1e-12
    h = 1e-6
    for column, joint in enumerate(free.joints):
        step = np.zeros(len(q))
        step[joint] = h * free.unit[column]
        ahead, behind = (equations(robot, q + s * step, goal, free)[0] for s in (1, -1))
        assert found[:, column] == pytest.approx((ahead - behind) / (2 * h), abs=1e-8)
    tree = Tree(**_tree(robot))
    assert not J[np.isin(tree.moves[:, 0], held)].any()


@pytest.mark.parametrize("damped", [1e-9, 1e-3])
@pytest.mark.parametrize(("seed", "legs"), [(0, 2), (1, 3), (2, 4), (3, 3), (4, 2)])
def test_the_step_is_the_damped_least_squares_one(seed, legs, damped):
    """(J'J + c 1) x = J'r with c a part of the trace, by numpy."""
    robot = some_robot(seed, legs)
    rng = np.random.default_rng(seed)
    q = np.array(robot.positions) + 0.1 * rng.normal(size=len(robot.frames))
    free = free_of(robot)
    r, dense, J = equations(robot, q, POSES["all"], free)
    tree = Tree(**_tree(robot))
    x, _ = _least_step(tree, free, J, r, damped)
    N = dense.T @ dense
    damping = damped * np.trace(N) * np.eye(len(N))
    expected = np.linalg.solve(N + damping, dense.T @ r)
    assert x == pytest.approx(expected, rel=1e-5, abs=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize(("ratio", "determined"), [(0.5e4, False), (2e4, True)])
@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("weak", [0, 1, 2])
def test_a_joint_is_determined_by_ten_thousand_times_the_damping(
    weak, count, ratio, determined
):
    """Slides along axes of their own; a weak one has a pivot of so many dampings."""
    weak = min(weak, count - 1)
    frames = [
        Frame(f"s{i}", "base" if i == 0 else f"s{i - 1}", joint="prismatic")
        for i in range(count)
    ]
    robot = Robot("slides", "end", (*frames, Frame("end", f"s{count - 1}")))
    free, tree = free_of(robot), Tree(**_tree(robot))
    damped = 1e-6
    J = np.zeros((count, 6))
    for i in range(count):
        J[i, i] = 1.0
    J[weak] *= np.sqrt(ratio * damped * max(count - 1, 1e-30))
    if count == 1:
        J[0, 0], determined = 1.0, True
    x, found = _least_step(tree, free, J, np.r_[1.0, 2.0, 3.0, 0, 0, 0], damped)
    assert bool(found) == determined
    trace = (J**2).sum()
    for i in range(count):
        pivot = J[i, i] ** 2 + damped * trace
        assert x[i] == pytest.approx(J[i, i] * (i + 1) / pivot, rel=1e-9)


def test_the_largest_component_is_by_size_and_none_where_one_is_none():
    assert _largest(np.array([1.0, -3.0, 2.0])) == 3.0
    assert _largest(np.zeros(0)) == 0.0
    assert np.isnan(_largest(np.array([5.0, NAN, 7.0])))
    assert np.isnan(_largest(np.array([NAN, 1.0])))


def solved(robot, q, pose, held, near=False, jump=1.0, careful=False):
    q = np.array(q, dtype=float)
    return q, _newton(
        Tree(**_tree(robot)), q, np.array(pose), np.array(held), near, jump, careful
    )


def held_at(robot, **coordinates):
    held = np.full(len(robot.frames), NAN)
    for name, value in coordinates.items():
        held[robot.index(name)] = value
    return held


@pytest.mark.parametrize("careful", [False, True])
def test_newton_ends_where_the_triangle_is(careful):
    """A crank held 0.1 rad on: law of cosines; the tangent tells how far it moves."""
    robot = four_bar(0.5)
    start = np.array(robot.positions) + [0, -0.05, 0, 0.05, 0, 0]
    q, (fine, determined, ahead) = solved(
        robot, start, [NAN] * 6, held_at(robot, crank=0.6), careful=careful
    )
    coupler, rocker, _ = four_bar_angles(0.6)
    assert (fine, determined) == (True, True)
    assert q[0] == 0.6
    assert q[1] == pytest.approx(coupler - 0.6, abs=1e-9)
    assert q[3] == pytest.approx(rocker, abs=1e-9)
    if careful:
        assert ahead == pytest.approx(0.1)
    else:
        assert 0.1 <= ahead < 0.2


def test_newton_refuses_a_tangent_that_leads_too_far():
    """0.1 rad of the crank is more than the jump allowed; nothing is moved then."""
    robot = four_bar(0.5)
    start = np.array(robot.positions) + [0, -0.05, 0, 0.05, 0, 0]
    held = held_at(robot, crank=0.6)
    q, (fine, determined, ahead) = solved(robot, start, [NAN] * 6, held, jump=0.09)
    assert (fine, determined) == (False, True)
    assert ahead >= 0.1
    assert q[1:] == pytest.approx(start[1:], abs=1e-15)


def test_newton_tells_what_a_target_leaves_open():
    """Two drives of a five-bar and one coordinate asked: any elbow would do."""
    robot = five_bar()
    pose = np.full(6, NAN)
    pose[0] = 0.01
    q, (fine, determined, _) = solved(robot, robot.positions, pose, held_at(robot))
    assert (fine, determined) == (False, False)
    q, (fine, determined, _) = solved(
        robot, robot.positions, pose, held_at(robot), careful=True
    )
    assert fine
    assert frames_of(robot, q)[robot.index("right.tip"), 0, 3] == pytest.approx(0.01)


def test_on_the_way_near_is_enough_but_not_at_its_end():
    """Open by 5e-5 rad: nothing is done where a configuration only leads on."""
    robot = four_bar(0.5)
    _, rocker, _ = four_bar_angles(0.5)
    start = np.array(robot.positions) + [0, -0.05 + 2e-5, 0, 0.05, 0, 0]
    held = held_at(robot, crank=0.5)
    q, (fine, *_) = solved(robot, start, [NAN] * 6, held, near=True)
    assert fine
    assert q == pytest.approx(start, abs=1e-15)
    q, (fine, *_) = solved(robot, start, [NAN] * 6, held)
    assert fine
    assert q[3] == pytest.approx(rocker, abs=1e-9)
    assert np.abs(q - start).max() > 1e-6


@pytest.mark.parametrize("careful", [False, True])
def test_newton_ends_where_nothing_can_close(careful):
    """The two bars are 0.1 m too short for the crank's place."""
    robot = Robot("short", "end", (
        Frame("crank", joint="revolute", actuated=True),
        Frame("elbow", "crank", [CRANK, 0, 0], joint="revolute"),
        Frame("end", "elbow", [0.2, 0, 0]),
        Frame("rocker", translation=[GROUND, 0, 0], joint="revolute",
              position=np.pi),
        Frame("wrist", "rocker", [0.2, 0, 0], joint="revolute", position=np.pi),
        Frame("seat", "wrist"),
    ), (("end", "seat"),))  # fmt: skip
    start = np.array(robot.positions) + [0, 0.1, 0, -0.1, 0, 0]
    _, (fine, *_) = solved(
        robot, start, [NAN] * 6, held_at(robot, crank=0.0), careful=careful
    )
    assert not fine


@pytest.mark.parametrize(
    ("gap", "accepted"),
    [(0.0, True), (0.9e-5, True), (1.1e-5, False), (1e-3, False), (0.5, False)],
)
def test_what_no_joint_can_close_is_accepted_to_a_hundred_thousandth(gap, accepted):
    """Of the reference length, 2 m: what rounding leaves in files may be so much."""
    robot = Robot("gap", "far", (
        Frame("a"), Frame("b", translation=[2 * gap, 0, 0]),
        Frame("c", joint="revolute"), Frame("far", "c", [2.0, 0, 0]),
    ), (("a", "b"),))  # fmt: skip
    assert size_of(robot) == 2.0
    _, (fine, *_) = solved(robot, np.zeros(4), [NAN] * 6, held_at(robot), careful=True)
    assert fine == accepted


@pytest.mark.parametrize("target", [0.55, 1.5, 4.0, -3.0])
def test_a_crank_is_followed_as_far_as_it_is_asked_to_turn(target):
    """In the assembly mode of its start, whatever number of steps that takes."""
    robot = four_bar(0.5)
    coupler, rocker, _ = four_bar_angles(0.5)
    start = np.array([0.5, coupler - 0.5, 0, rocker, coupler - rocker, 0])
    q = np.zeros(6)
    tree, held = Tree(**_tree(robot)), held_at(robot, crank=target)
    assert _follow(tree, start, np.full(6, NAN), held, False, q) == 1.0
    coupler, rocker, _ = four_bar_angles(target)
    for found, angle in ((q[0] + q[1], coupler), (q[3], rocker)):
        assert np.exp(1j * found) == pytest.approx(np.exp(1j * angle), abs=1e-9)


def test_a_guess_takes_one_step_of_any_length():
    robot = four_bar(0.5)
    q, tree = np.zeros(6), Tree(**_tree(robot))
    start = np.array(robot.positions)
    held = held_at(robot, crank=0.5)
    assert _follow(tree, start, np.full(6, NAN), held, True, q) == 1.0
    assert q[3] == pytest.approx(four_bar_angles(0.5)[1], abs=1e-9)
    # a coordinate that is none closes nothing
    start[1] = NAN
    assert _follow(tree, start, np.full(6, NAN), held, True, q) == 0.0
