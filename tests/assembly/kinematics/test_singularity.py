"""Distances to singularities, compared with closed forms of linkages."""

import math
from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.mobility import mobility
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import (
    home_posture,
    place_many,
    place_many_joints,
    place_robot,
)
from forcefit.assembly.kinematics.singularity import find_singularities
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.robots import load_robot
from tests.linkages_for_tests import five_bar, four_bar


def at(robot, **options):
    """Return the singularity distances at one posture."""
    return find_singularities(robot, place_robot(robot, **options).transforms[None])


def five_bar_jacobian(T, robot):
    """Return the Jacobian from drives to tip, (2, 2) [m/rad].

    The length of the second arm d is constant, so d.v = d.(k x a) q' for the first arm
    a.
    """
    A, B = np.zeros((2, 2)), np.zeros((2, 2))
    tip = T[robot.index("left.tip"), :2, 3]
    for row, side in enumerate(("left", "right")):
        foot = T[robot.index(f"{side}.drive"), :2, 3]
        elbow = T[robot.index(f"{side}.elbow"), :2, 3]
        d, a = tip - elbow, elbow - foot
        A[row], B[row, row] = d, d @ [-a[1], a[0]]
    return A, B


@pytest.fixture(scope="module")
def five_bars():
    """Return the built-in five-bar and its transforms at random poses."""
    robot = load_robot("five_bar")
    rng = np.random.default_rng(1)
    poses = np.full((40, 6), np.nan)
    poses[:, 0] = rng.uniform(-0.05, 0.05, 40)
    poses[:, 1] = rng.uniform(0.08, 0.165, 40)
    postures, _ = place_many(robot, poses)
    return robot, np.array([p.transforms for p in postures if p is not None])


def test_five_bar_singularity_distances_equal_the_closed_form(five_bars):
    """The singular values of the Jacobian are the tangents of the angles a_i."""
    robot, T = five_bars
    found = find_singularities(robot, T)
    assert len(T) >= 30
    size = size_of(robot)
    for i in range(len(T)):
        A, B = five_bar_jacobian(T[i], robot)
        J = np.linalg.solve(A, B)
        # The platform is part of the right distal arm, so it also rotates.
        tip, elbow, foot = (
            T[i, robot.index(name), :2, 3]
            for name in ("left.tip", "right.elbow", "right.drive")
        )
        d, a = tip - elbow, elbow - foot
        relative = J - np.outer([-a[1], a[0]], [0.0, 1.0])
        turn = (d[0] * relative[1] - d[1] * relative[0]) / (d @ d)
        tangents = np.linalg.svd(np.vstack([turn, J / size]), compute_uv=False)
        assert found.parallel[i] == pytest.approx(math.cos(math.atan(tangents[0])))
        assert found.serial[i] == pytest.approx(math.sin(math.atan(tangents[-1])))
        assert found.condition[i] == pytest.approx(tangents[0] / tangents[-1])


def test_serial_singularity_of_aligned_arms_is_reported():
    """The left arms are collinear at the singularity.

    If their total length is shorter by e, their angle is proportional to sqrt(e).
    """
    robot = load_robot("five_bar")
    found = []
    for short in (1e-4, 1e-6):
        out = 0.18 - short
        pose = {"tx": -0.06 + out * math.cos(1.2), "ty": out * math.sin(1.2)}
        found.append(at(robot, pose=pose))
    assert found[0].serial[0] / found[1].serial[0] == pytest.approx(10, rel=0.05)
    assert found[1].parallel[0] > 0.05
    assert found[1].names(robot, near=0.02) == ["serial: left.drive"]


@pytest.mark.parametrize("angle", [0.3, 1.1, 2.5, 4.0])
def test_four_bar_singularity_distances_equal_the_closed_form(angle):
    """The coupler velocity is computed by differences of Hoeken's closed form."""
    robot = load_robot("four_bar")
    found = at(robot, joints={"crank": angle})

    def point(t):
        root = math.sqrt((5 + math.cos(t)) / (5 - 4 * math.cos(t)))
        x, y = 2 + 2 * root * math.sin(t), 2 * root * (2 - math.cos(t))
        return 0.1 * np.array([x, y])

    def coupler(t):  # from the crank pin along twice the coupler length
        x, y = point(t) - 0.1 * np.array([math.cos(t), math.sin(t)])
        return math.atan2(y, x)

    h = 1e-5
    speed = (point(angle + h) - point(angle - h)) / (2 * h)
    turn = (coupler(angle + h) - coupler(angle - h)) / (2 * h)
    tangent = math.hypot(turn, *(speed / size_of(robot)))
    assert found.parallel[0] == pytest.approx(math.cos(math.atan(tangent)), rel=1e-8)
    assert found.serial[0] == pytest.approx(math.sin(math.atan(tangent)), rel=1e-8)


def test_orthoglide_is_isotropic_at_home():
    """The Jacobian at home is the identity matrix (Chablat, Wenger 2003)."""
    robot = load_robot("orthoglide")
    found = find_singularities(robot, home_posture(robot).transforms[None])
    assert found.condition[0] == pytest.approx(1.0, abs=1e-9)
    assert found.serial[0] == pytest.approx(math.sqrt(0.5), abs=1e-9)


def test_arm_with_aligned_wrist_axes_is_serially_singular():
    """A wrist with aligned fourth and sixth axes loses a degree of freedom."""
    robot = load_robot("arm6")
    driven = [f.name for f in robot.frames if f.actuated]
    goals = np.full((2, len(robot.frames)), np.nan)
    rows = [robot.index(name) for name in driven]
    home = home_posture(robot).coordinates[rows]
    goals[:, rows] = home
    goals[1, rows[4]] = 0.0
    postures, _ = place_many_joints(robot, goals)
    found = find_singularities(robot, np.array([p.transforms for p in postures]))
    assert found.closure.tolist() == [1.0, 1.0]
    assert found.serial[0] > 0.05
    assert found.serial[1] < 1e-9
    assert found.names(robot, 0.02)[0] == ""
    assert found.names(robot, 0.02)[1].startswith("serial: ")


def test_singularity_distances_do_not_depend_on_robot_size(five_bars):
    """All lengths are multiplied by 1000."""
    robot, T = five_bars
    frames = [replace(f, translation=1000 * f.translation) for f in robot.frames]
    large = T.copy()
    large[..., :3, 3] *= 1000
    one = find_singularities(robot, T)
    other = find_singularities(replace(robot, frames=tuple(frames)), large)
    for kind in ("serial", "parallel", "closure"):
        assert getattr(other, kind) == pytest.approx(getattr(one, kind), rel=1e-9)


def parallelogram(angle):
    """Return a parallelogram linkage at a given crank angle."""

    def bar(name, parent, length, turn, **options):
        return Frame(name, parent, [length, 0, 0], [0, 0, turn], **options)

    pin = {"joint": "revolute"}
    frames = (
        bar("crank", "base", 0.0, angle, **pin, actuated=True),
        bar("crank_pin", "crank", 0.1, -angle, **pin),
        bar("coupler", "crank_pin", 0.3, 0.0),
        bar("rocker", "base", 0.3, angle, **pin),
        bar("rocker_pin", "rocker", 0.1, -angle, **pin),
        bar("rocker_end", "rocker_pin", 0.0, 0.0),
    )
    return Robot("parallelogram", "coupler", frames, (("coupler", "rocker_end"),))


def test_closure_singularity_of_a_flat_parallelogram_is_reported():
    """All four axes intersect one line at the singularity."""
    found = []
    for angle in (0.1, 0.01):
        robot = parallelogram(angle)
        found.append(find_singularities(robot, home_posture(robot).transforms[None]))
    assert found[0].closure / found[1].closure == pytest.approx(10.0, rel=0.02)
    assert found[0].closure < 0.1
    (name,) = found[1].names(robot, near=0.02)
    assert name.startswith("closure: ")
    assert name.removeprefix("closure: ") in {f.name for f in robot.frames}


def screws_by_hand(robot, T):
    """Return the platform motion per unit rate of each joint, (n, 6)."""
    size, screws = size_of(robot), np.zeros((len(robot.frames), 6))
    last = robot.index(robot.platform)
    for k, frame in enumerate(robot.frames):
        if frame.joint == "fixed":
            continue
        z, arm = T[k, :3, 2], T[last, :3, 3] - T[k, :3, 3]
        turning = np.concatenate([z, np.cross(z, arm) / size])
        sliding = np.concatenate([0 * z, z])
        screws[k] = sliding if frame.joint == "prismatic" else turning
    return screws


def way_to(robot, name):
    """Return the indices of the frames between the base and a frame."""
    way = []
    while name != "base":
        way.append(robot.index(name))
        name = robot.frames[way[-1]].parent
    return way


@pytest.mark.parametrize("name", ["five_bar", "3rrr", "orthoglide", "arm6", "delta"])
def test_singular_motions_satisfy_the_closures(name):
    """The motions have unit norm with the smallest possible platform or drive rates."""
    robot = load_robot(name)
    driven = [k for k, f in enumerate(robot.frames) if f.actuated]
    home = home_posture(robot)
    goals = np.full((2, len(robot.frames)), np.nan)
    goals[:, driven] = home.coordinates[driven]
    goals[1, driven] += 0.02 * np.arange(1, len(driven) + 1)
    postures, _ = place_many_joints(robot, goals)
    T = np.array([p.transforms for p in postures])
    found = find_singularities(robot, T)
    for k in range(2):
        screws = screws_by_hand(robot, T[k])
        path = way_to(robot, robot.platform)
        for rates, drives, platform in (
            (found.serial_joints[k], math.sqrt(1 - found.serial[k] ** 2),
             found.serial[k]),
            (found.parallel_joints[k], found.parallel[k],
             math.sqrt(1 - found.parallel[k] ** 2)),
        ):  # fmt: skip
            moved = rates[path] @ screws[path]
            assert np.linalg.norm(rates[driven]) == pytest.approx(drives, abs=1e-7)
            assert np.linalg.norm(moved) == pytest.approx(platform, abs=1e-7)
            for first, second in robot.closures:
                one, other = (way_to(robot, end) for end in (first, second))
                apart = rates[one] @ screws[one] - rates[other] @ screws[other]
                assert np.abs(apart).max() < 1e-7
        rates = found.parallel_joints[k]
        np.testing.assert_allclose(
            rates[path] @ screws[path], found.parallel_screws[k], atol=1e-7
        )


def test_platform_that_no_joint_moves_has_no_serial_singularity():
    turning = {"joint": "revolute", "actuated": True}
    robot = Robot("still", "tip", (
        Frame("tip"), Frame("one", **turning),
        Frame("two", "one", [1, 0, 0], **turning),
    ))  # fmt: skip
    found = find_singularities(robot, home_posture(robot).transforms[None])
    assert (found.serial[0], found.parallel[0], found.closure[0]) == (1.0, 1.0, 1.0)
    assert found.serial_joints.tolist() == [[0.0, 0.0, 0.0]]
    assert found.parallel_screws.tolist() == [[0.0] * 6]
    assert found.names(robot, near=0.5) == [""]


TURNING = {"joint": "revolute", "actuated": True}


def side_by_side(*joints):
    """Return parallel chains of one joint each; the first joint is driven."""
    frames, closures = [], []
    for k, joint in enumerate(joints):
        frames += [Frame(f"j{k}", joint=joint, actuated=k == 0),
                   Frame(f"end{k}", f"j{k}", [0.1, 0, 0])]  # fmt: skip
        closures += [("end0", f"end{k}")] if k else []
    return Robot("bundle", "end0", tuple(frames), tuple(closures))


@pytest.mark.parametrize(("robot", "counts"), [
    # An open arm has as many degrees of freedom as joints.
    (Robot("arm", "tip", (Frame("a", **TURNING), Frame("b", "a", [1, 0, 0], **TURNING),
                          Frame("tip", "b"))), (2, 0, 0)),
    # Three of the six closure equations of a planar loop are independent.
    (four_bar(), (1, 0, 3)), (four_bar(mode=-1.0), (1, 0, 3)),
    # The tip can rotate about its two pins.
    (five_bar(), (3, 1, 3)),
    # The joints have a common motion, and two of twelve equations are independent.
    (side_by_side("prismatic", "prismatic", "prismatic"), (1, 0, 10)),
    # The joints have no common motion.
    (side_by_side("revolute", "prismatic"), (0, 0, 4)),
    (side_by_side("revolute", "fixed"), (0, 0, 5)),
])  # fmt: skip
def test_mobility_of_simple_linkages_equals_known_counts(robot, counts):
    """The counts are for free drives, locked drives and redundant equations."""
    found = mobility(home_posture(robot))
    assert (found.freedoms, found.locked_freedoms, found.overconstraint) == counts
