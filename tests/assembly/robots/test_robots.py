"""Built-in robots: laws that hold for all, and a published or closed-form fact each.

Laws use every robot of the table; facts know one robot and compute the answer by a road
of their own.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from assembly.files.robot_file import read_robot, write_robot
from assembly.kinematics.posture import POSE, home_posture, place_robot
from assembly.linear.energy import solve_assembly
from assembly.linear.mobility import mobility
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reference import reference_energy
from assembly.linear.zone import zone_margin
from assembly.model.clearance import clearance_bounds
from assembly.model.links import joint_compliances, link_compliances
from assembly.model.random_errors import frames_named
from assembly.model.robot import BeamLink, Clearance, Robot, beam_axis
from assembly.robots import BUILT_IN, load_robot
from assembly.robots.delta import DeltaParameters, drive_angle
from assembly.robots.five_bar import FiveBarParameters
from assembly.robots.hexapod import HexapodParameters
from assembly.robots.irsbot2 import ERROR_FRAMES
from assembly.robots.planar import arm_angle
from forcefit.inputs.table import BadInput
from stiffness.screws import rotation_matrix, skew

# freedoms, the same with the drives locked, overconstraint: published counts
COUNTS = {
    "irsbot2": (2, 0, 8),  # two loops of a parallelogram, 3 each, and 2 legs
    "four_bar": (1, 0, 3),  # one planar loop
    "five_bar": (2, 0, 3),  # one planar loop
    "3rrr": (3, 0, 6),  # two planar loops
    "hexapod": (6, 0, 0),
    "delta": (9, 6, 0),  # 3 translations, and 6 rods that spin
    "orthoglide": (3, 0, 12),  # 3 parallelograms, 3 each, and 6 couples for 3 turns
    "arm6": (6, 0, 0),
}
# joints with play, each counted once: all that are not driven, and the arm's drives
PLAYING = {
    "irsbot2": 8, "four_bar": 3, "five_bar": 3, "3rrr": 6,
    "hexapod": 12, "delta": 12, "orthoglide": 18, "arm6": 6,
}  # fmt: skip
# boxes of platform poses, about those the robots are used in
WORKSPACE = {
    "irsbot2": {"tx": (-0.3, 0.3), "tz": (-0.6, -0.35)},
    "four_bar": {"tx": (0.02, 0.38)},
    "five_bar": {"tx": (-0.03, 0.03), "ty": (0.13, 0.15)},
    "3rrr": {"tx": (-0.05, 0.05), "ty": (-0.05, 0.05), "rz": (-0.3, 0.3)},
    "hexapod": {
        "tx": (-0.06, 0.06), "ty": (-0.06, 0.06), "tz": (0.5, 0.58),
        "rx": (-0.15, 0.15), "ry": (-0.15, 0.15), "rz": (-0.15, 0.15),
    },
    "delta": {"tx": (-0.4, 0.4), "ty": (-0.4, 0.4), "tz": (-1.1, -0.8)},
    "orthoglide": {"tx": (-0.08, 0.08), "ty": (-0.08, 0.08), "tz": (-0.08, 0.08)},
    "arm6": {
        "tx": (0.5, 0.65), "ty": (-0.25, -0.05), "tz": (-0.1, 0.1),
        "rx": (-0.2, 0.2), "ry": (1.4, 1.7), "rz": (-0.2, 0.2),
    },
}  # fmt: skip
ELASTIC_DRIVES = [n for n in COUNTS if n != "irsbot2"]  # whose own has none
WITHOUT_SPRINGY_PASSIVE_JOINTS = sorted(set(COUNTS) - {"irsbot2"})
LOAD = [3.0, -2.0, 1.0, 40.0, -30.0, 20.0]  # [N m, N]


@pytest.fixture(params=BUILT_IN, scope="module")
def name(request):
    return request.param


@pytest.fixture(scope="module")
def robot(name):
    return BUILT_IN[name]()


def random_pose(name, rng):
    """A platform pose in the robot's workspace."""
    return {key: rng.uniform(*box) for key, box in WORKSPACE[name].items()}


def drives(robot):
    """Names of the actuated joints."""
    return [frame.name for frame in robot.frames if frame.actuated]


def joints_of(posture):
    """Coordinates of the actuated joints by name."""
    robot = posture.robot
    return {n: posture.coordinates[robot.index(n)] for n in drives(robot)}


def with_random_errors(robot, rng, rotation=1e-3, translation=2e-4):
    """The robot with errors that can be closed: on the paper's, at its own frames."""
    errors = np.zeros((len(robot.frames), 6))
    rows = np.arange(len(robot.frames))
    if robot.name == "irsbot2":
        rows = [robot.index(n) for n in frames_named(robot, ERROR_FRAMES)]
    size = [rotation] * 3 + [translation] * 3
    errors[rows] = rng.uniform(-1, 1, (len(rows), 6)) * size
    return robot.with_errors(errors)


def only_drives_give(robot):
    """The robot with rigid bodies and no play."""
    bare = (replace(f, link=None, clearance=None) for f in robot.frames)
    return replace(robot, frames=tuple(bare))


def only_play(robot):
    """The robot with nothing elastic at all."""
    kept = {f.name: f.clearance for f in robot.frames}
    frames = (
        replace(f, link=None, joint_stiffness=None, clearance=kept[f.name])
        for f in robot.frames
    )
    return replace(robot, frames=tuple(frames))


def platform_compliance(posture):
    """(6, 6) platform screws of unit loads: 1 N m and 1 N each."""
    loaded = (solve_assembly(posture, load) for load in np.eye(6))
    return np.column_stack([answer.platform_screw for answer in loaded])


def drive_jacobian(posture, step=1e-4):
    """(6, drives) platform screw per unit of each drive, by central differences."""
    robot, here = posture.robot, joints_of(posture)
    R = posture.platform[:3, :3]
    columns = []
    for key, value in here.items():
        after, before = (
            place_robot(robot, joints=here | {key: value + s}).platform
            for s in (step, -step)
        )
        spin = (after - before)[:3, :3] @ R.T / (2 * step)
        shift = (after - before)[:3, 3] / (2 * step)
        columns.append([spin[2, 1], spin[0, 2], spin[1, 0], *shift])
    return np.array(columns).T


# Laws


def test_the_home_pose_closes(robot):
    assert home_posture(robot).mismatch < 1e-12


def test_every_joint_plays_once(name, robot):
    playing = [f for f in robot.frames if f.clearance is not None]
    assert len(playing) == PLAYING[name]
    assert all(f.clearance.radial > 0 and f.clearance.axial > 0 for f in playing)


def test_beams_run_from_the_parents_origin_to_the_frames(robot):
    """At home, also where a slide lies between and the length is written out."""
    origins = home_posture(robot).transforms[:, :3, 3]
    beams = [f for f in robot.frames if isinstance(f.link, BeamLink)]
    assert beams
    for frame in beams:
        row = robot.index(frame.name)
        parent = robot.parents[row]
        start = origins[parent] if parent >= 0 else np.zeros(3)
        length, axis = beam_axis(frame)
        R = home_posture(robot).transforms[row, :3, :3]
        assert np.abs(origins[row] - start - length * R @ axis).max() < 1e-12


def test_freedoms_and_overconstraint_are_the_published_ones(name, robot, rng):
    """At home and elsewhere: the home pose could be a special one."""
    postures = [home_posture(robot)]
    postures += [place_robot(robot, pose=random_pose(name, rng)) for _ in range(3)]
    for posture in postures:
        found = mobility(posture)
        counts = (found.freedoms, found.locked_freedoms, found.overconstraint)
        assert counts == COUNTS[name]


def test_a_robot_is_the_same_after_writing_and_reading(robot, tmp_path):
    """Files keep all digits, so nothing but a turn's round trip may change."""
    write_robot(robot, tmp_path / "robot.toml")
    again = read_robot(tmp_path / "robot.toml")
    assert again.closures == robot.closures
    assert [f.name for f in again.frames] == [f.name for f in robot.frames]
    change = home_posture(again).transforms - home_posture(robot).transforms
    assert np.abs(change).max() == 0.0
    for table in (link_compliances, joint_compliances, clearance_bounds):
        assert np.array_equal(table(again), table(robot))


def test_pose_to_joints_and_back(name, robot, rng):
    """Both ends are solved to 1e-10, and no pose here is near a singular one."""
    for _ in range(4):
        pose = random_pose(name, rng)
        there = place_robot(robot, pose=pose)
        found = there.pose()
        assert max(abs(found[key] - pose[key]) for key in pose) < 1e-9
        back = place_robot(robot, joints=joints_of(there))
        assert np.abs(back.platform - there.platform).max() < 1e-8
        assert max(there.mismatch, back.mismatch) < 1e-9


def test_a_perfect_robot_closes_at_no_cost(name, robot, rng):
    posture = place_robot(robot, pose=random_pose(name, rng))
    answer = solve_assembly(posture)
    assert answer.energy < 1e-20
    assert np.abs(answer.platform_screw).max() < 1e-9
    assert zone_margin(posture).margin < 1e-9


def test_small_errors_are_closed_and_certified(name, robot, rng):
    faulty = with_random_errors(robot, rng)
    answer = solve_assembly(place_robot(faulty, pose=random_pose(name, rng)))
    assert answer.relative_gap() < 1e-6
    assert answer.closure_residual() < 1e-11
    assert answer.clearance_excess() < 1e-9
    assert (answer.energy > 1e-9) == (COUNTS[name][2] > 0)  # forced only if need be


@pytest.mark.parametrize("load", [None, LOAD], ids=["free", "loaded"])
def test_energies_equal_the_printed_problem(name, robot, rng, load):
    """Of 1e-6 J or more here; just constrained robots store none without a load."""
    faulty = with_random_errors(robot, rng)
    posture = place_robot(faulty, pose=random_pose(name, rng))
    answer = solve_assembly(posture, load)
    expected, screw = reference_energy(posture, load)
    assert answer.energy == pytest.approx(expected, rel=1e-6, abs=1e-10)
    if load is not None:
        work = float(np.dot(load, answer.platform_screw))
        assert work == pytest.approx(float(np.dot(load, screw)), rel=1e-6)


def test_order_of_frames_and_sense_of_closures_do_not_matter(name, robot, rng):
    """The same equations in another order."""
    pose = random_pose(name, rng)
    faulty = with_random_errors(robot, rng)
    order = rng.permutation(len(faulty.frames))
    pairs = tuple((b, a) for a, b in reversed(faulty.closures))
    shuffled = tuple(faulty.frames[i] for i in order)
    other = Robot(faulty.name, faulty.platform, shuffled, pairs)
    one, two = (
        solve_assembly(place_robot(r, pose=pose), LOAD) for r in (faulty, other)
    )
    assert two.energy == pytest.approx(one.energy, rel=1e-6)
    assert two.potential == pytest.approx(one.potential, rel=1e-6)
    margins = [zone_margin(answer.posture).margin for answer in (one, two)]
    assert margins[0] == pytest.approx(margins[1], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("name", ELASTIC_DRIVES)
def test_elastic_drives_give_j_c_jt(name, rng):
    """Salisbury (1980): C = J diag(1 / k) J^T; J here by differences of postures.

    Central differences leave 1e-8 of J times its third derivative over J.
    """
    robot = only_drives_give(BUILT_IN[name]())
    posture = place_robot(robot, pose=random_pose(name, rng))
    own = [(robot.index(n), robot.frame(n).own_axis) for n in drives(robot)]
    soft = joint_compliances(robot)
    gives = np.diag([soft[row, axis, axis] for row, axis in own])
    J = drive_jacobian(posture)
    expected = J @ gives @ J.T
    found = platform_compliance(posture)
    for part in (slice(0, 3), slice(3, 6)):  # rad, then m
        size = max(np.abs(expected[part, part]).max(), 1e-12)
        assert np.abs((found - expected)[part, part]).max() < 1e-5 * size


@pytest.mark.parametrize("name", WITHOUT_SPRINGY_PASSIVE_JOINTS)
def test_an_error_along_a_drive_moves_the_platform_as_the_drive_would(name, rng):
    """Encoder offsets: no energy, and the drive's column of J, by differences."""
    robot = BUILT_IN[name]()
    tight = replace(
        robot, frames=tuple(replace(f, clearance=None) for f in robot.frames)
    )
    posture = place_robot(tight, pose=random_pose(name, rng))
    size = [1.0] * 3 + [np.abs(posture.platform[:3, 3]).max()] * 3
    for drive, column in zip(drives(robot), drive_jacobian(posture).T, strict=True):
        errors = np.zeros((len(robot.frames), 6))
        row, axis = robot.index(drive), robot.frame(drive).own_axis
        errors[row, axis] = 1e-3
        faulty = replace(posture, robot=tight.with_errors(errors))
        answer = solve_assembly(faulty)
        assert answer.energy < 1e-20
        left = answer.platform_screw / 1e-3 - column
        assert np.abs(left / size).max() < 1e-5 * max(np.abs(column / size).max(), 1.0)


def test_a_load_here_moves_there_as_a_load_there_moves_here(name, robot, rng):
    """Maxwell and Betti: without play the compliance is symmetric.

    The paper's soft joints turn by half a radian per unit load before others take it
    up; rounding of that is 1e-16 rad, 1e-9 of the 1e-7 rad that remain.
    """
    tight = replace(
        robot, frames=tuple(replace(f, clearance=None) for f in robot.frames)
    )
    C = platform_compliance(place_robot(tight, pose=random_pose(name, rng)))
    size = np.sqrt(np.diag(C))
    assert size.min() > 0.0
    assert np.abs((C - C.T) / np.outer(size, size)).max() < 1e-8
    assert np.linalg.eigvalsh(C / np.outer(size, size)).min() > 0.0


@pytest.mark.parametrize("name", sorted(set(BUILT_IN) - {"hexapod"}))
def test_out_of_reach_is_refused(name):
    """Ten metres away; the hexapod's struts have no ends of stroke."""
    robot = BUILT_IN[name]()
    with pytest.raises(BadInput, match="cannot be reached"):
        place_robot(robot, pose={next(iter(WORKSPACE[name])): 10.0})


# Four-bar


def test_hoekens_crank_turns_fully_and_its_point_follows_the_law_of_cosines():
    """Grashof: 1 + 2.5 < 2 + 2.5, and the shortest is the crank."""
    robot = BUILT_IN["four_bar"]()
    foot = np.array([0.2, 0.0])
    for angle in np.linspace(0.0, 2 * math.pi, 13):
        posture = place_robot(robot, joints={"crank": angle})
        pin = 0.1 * np.array([math.cos(angle), math.sin(angle)])
        ground = foot - pin
        # between the line to the foot and the coupler, in the triangle of 2.5 and 2.5
        reach = np.hypot(*ground)
        beside = math.acos((reach**2 + 0.25**2 - 0.25**2) / (2 * reach * 0.25))
        coupler = math.atan2(ground[1], ground[0]) + beside
        point = pin + 0.5 * np.array([math.cos(coupler), math.sin(coupler)])
        assert np.abs(posture.platform[:2, 3] - point).max() < 1e-12
    ends = [place_robot(robot, joints={"crank": a}) for a in (0.0, 2 * math.pi)]
    assert np.abs(ends[0].transforms - ends[1].transforms).max() < 1e-12


@pytest.mark.parametrize(("degrees", "x"), [(90, 0.4), (180, 0.2), (270, 0.0)])
def test_hoekens_point_is_on_its_line_three_times(degrees, x):
    """At four cranks from the ground link, by Thales exactly."""
    robot = BUILT_IN["four_bar"]()
    posture = place_robot(robot, joints={"crank": math.radians(degrees)})
    assert posture.platform[:2, 3] == pytest.approx([x, 0.4], abs=1e-12)


def test_hoekens_point_stays_near_its_line_over_half_a_turn():
    """From the closed form, 2 sqrt((5 + c) / (5 - 4c)) (2 - c) with c = cos t.

    A fine grid of c in [-1, 0] finds its largest distance from 4.
    """
    robot = BUILT_IN["four_bar"]()
    c = np.linspace(-1.0, 0.0, 100001)
    largest = np.abs(2 * np.sqrt((5 + c) / (5 - 4 * c)) * (2 - c) - 4).max() * 0.1
    angles = np.linspace(math.pi / 2, 3 * math.pi / 2, 41)
    heights = [
        place_robot(robot, joints={"crank": a}).platform[1, 3] for a in angles
    ]  # fmt: skip
    off = np.abs(np.array(heights) - 0.4).max()
    assert 0.99 * largest < off <= largest + 1e-12
    assert off < 0.01 * 0.4  # of a line 0.4 m long


# Five-bar


def test_five_bar_tip_is_where_two_circles_meet(rng):
    P = FiveBarParameters()
    robot = BUILT_IN["five_bar"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("five_bar", rng))
        elbows = [
            np.array([x, 0.0]) + 0.09 * np.array([math.cos(q), math.sin(q)])
            for x, q in zip((-P.base / 2, P.base / 2), joints_of(posture).values(),
                            strict=True)
        ]  # fmt: skip
        apart = elbows[1] - elbows[0]
        along = apart / np.hypot(*apart)
        height = math.sqrt(0.09**2 - (apart @ apart) / 4)
        tip = (elbows[0] + elbows[1]) / 2 + height * np.array([-along[1], along[0]])
        assert np.abs(posture.platform[:2, 3] - tip).max() < 1e-11


# 3-RRR


def half_angle_solutions(foot, tip, near, far):
    """Both drive angles, by the tangent of the half angle (Gosselin, Angeles 1988)."""
    x, y = tip - foot
    # x^2 + y^2 + near^2 - far^2 = 2 near (x cos q + y sin q)
    e = (x * x + y * y + near**2 - far**2) / (2 * near)
    root = math.sqrt(x * x + y * y - e * e)
    return [2 * math.atan2(y + s * root, x + e) for s in (1, -1)]


def test_3rrr_drives_follow_gosselin_and_angeles(rng):
    robot = BUILT_IN["3rrr"]()
    angles = np.radians([90, 210, 330])
    corners = np.column_stack([np.cos(angles), np.sin(angles)])
    for _ in range(5):
        pose = random_pose("3rrr", rng)
        posture = place_robot(robot, pose=pose)
        R = rotation_matrix([0, 0, pose["rz"]])[:2, :2]
        tips = [pose["tx"], pose["ty"]] + 0.08 * corners @ R.T
        found = joints_of(posture).values()
        for q, foot, tip in zip(found, 0.3 * corners, tips, strict=True):
            both = half_angle_solutions(foot, tip, 0.16, 0.16)
            away = [abs(math.remainder(q - angle, 2 * math.pi)) for angle in both]
            assert min(away) < 1e-10


def only_radial(robot):
    """The robot's play, its radial part alone: everything stays in the plane."""
    bare = (
        replace(f, clearance=f.clearance and Clearance(radial=f.clearance.radial))
        for f in robot.frames
    )
    return replace(robot, frames=tuple(bare))


def farthest_corner(lines, plays):
    """Largest turn and shift of the platform if each line gives by plus or minus."""
    signs = np.array(list(itertools.product([-1, 1], repeat=len(plays))))
    screws = np.linalg.solve(lines, (signs * plays).T).T
    turns, shifts = np.split(
        screws, [len(plays) // 2 if len(plays) == 6 else 1], axis=1
    )
    return [np.linalg.norm(part, axis=1).max() for part in (turns, shifts)]


def test_3rrr_pose_error_is_the_farthest_corner_of_a_prism(rng):
    """(27) in closed form: 3 lines that give by 2c each, 8 corners."""
    robot = only_radial(BUILT_IN["3rrr"]())
    posture = place_robot(robot, pose=random_pose("3rrr", rng))
    play = robot.frame("leg1.pin").clearance.radial
    lines = arm_lines(posture)
    found = bound_pose_error(
        solve_assembly(posture), tolerance_rotation=1e-9, tolerance_translation=1e-9
    )
    turn, shift = farthest_corner(lines, np.full(3, 2 * play))
    for (low, high), expected in (
        (found.rotation_error, turn),
        (found.translation_error, shift),
    ):
        assert low <= expected * (1 + 1e-8)
        assert high >= expected * (1 - 1e-8)
        assert high - low < 1e-8


def arm_lines(posture):
    """(3, 3) unit wrenches [MZ FX FY] of the second arms, at the platform's origin."""
    T, index = posture.transforms, posture.robot.index
    lines = []
    for leg in ("leg1", "leg2", "leg3"):
        elbow, end = (T[index(f"{leg}.{n}"), :2, 3] for n in ("elbow", "pin"))
        u = (end - elbow) / np.hypot(*(end - elbow))
        b = end - posture.platform[:2, 3]
        lines.append([b[0] * u[1] - b[1] * u[0], *u])
    return np.array(lines)


def test_3rrr_reaches_as_far_as_its_pins_play(rng):
    """The support of the reachable errors, w.x <= sum of |f| 2c over the legs.

    A leg's second arm passes a force f along itself; its two pins give by c each.
    The wrench on the platform is the sum of the arms' forces, f = J^-T w.
    """
    posture = place_robot(only_play(BUILT_IN["3rrr"]()), pose=random_pose("3rrr", rng))
    play = posture.robot.frame("leg1.pin").clearance.radial
    lines = arm_lines(posture)
    for w in rng.normal(size=(4, 3)) * [0.1, 1.0, 1.0]:
        forces = np.linalg.solve(lines.T, w)
        answer = solve_assembly(posture, [0, 0, w[0], w[1], w[2], 0])
        found = w @ answer.platform_screw[2:5]
        assert found == pytest.approx(np.abs(forces).sum() * 2 * play, rel=1e-8)
        assert answer.energy == 0.0


def test_planar_legs_out_of_reach_are_refused_with_the_reach():
    with pytest.raises(BadInput, match=r"5r: the home pose needs a reach of 3 m"):
        arm_angle("5r", [0, 0], [3, 0], 1.0, 1.0, 1)


# Hexapod

MERLET = np.array([  # [cm] joint centres on the base, then on the platform
    [-9.7, 9.1], [9.7, 9.1], [12.76, 3.9], [3, -13], [-3, -13], [-12.76, 3.9],
    [-3, 7.3], [3, 7.3], [7.822, -1.052], [4.822, -6.248], [-4.822, -6.248],
    [-7.822, -1.052],
]).reshape(2, 6, 2)  # fmt: skip


def strut_lines(posture):
    """(6, 6) unit wrenches of the struts at the platform's origin, and lengths."""
    a, b = np.pad(MERLET / 100, ((0, 0), (0, 0), (0, 1)))
    arms = b @ posture.platform[:3, :3].T
    along = posture.platform[:3, 3] + arms - a
    lengths = np.linalg.norm(along, axis=1)
    n = along / lengths[:, None]
    return np.hstack([np.cross(arms, n), n]), lengths


def test_hexapod_struts_are_as_long_as_the_inverse_kinematics_says(rng):
    robot = BUILT_IN["hexapod"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("hexapod", rng))
        _, lengths = strut_lines(posture)
        found = np.array(list(joints_of(posture).values()))
        assert np.abs(found - lengths).max() < 1e-12


def test_hexapod_stiffness_is_the_sum_over_its_struts(rng):
    """Gosselin (1990), K = sum k w w^T, with the drive and the tube in series."""
    P = HexapodParameters()
    robot = BUILT_IN["hexapod"]()
    tight = (replace(f, clearance=None) for f in robot.frames)
    robot = replace(robot, frames=tuple(tight))
    _, home = strut_lines(home_posture(robot))
    area = math.pi * (P.radius**2 - P.inner_radius**2)
    k = 1 / (1 / P.drive + home / (P.young * area))
    for _ in range(3):
        posture = place_robot(robot, pose=random_pose("hexapod", rng))
        w, _ = strut_lines(posture)
        expected = np.linalg.inv(np.einsum("k,ki,kj->ij", k, w, w))
        found = platform_compliance(posture)
        size = np.sqrt(np.diag(expected))
        assert np.abs((found - expected) / np.outer(size, size)).max() < 1e-9


def test_hexapod_struts_carry_forces_along_themselves_only(rng):
    """Between a cardan and a ball joint, whatever the load."""
    posture = place_robot(BUILT_IN["hexapod"](), pose=random_pose("hexapod", rng))
    w, _ = strut_lines(posture)
    forces = np.linalg.solve(w.T, LOAD)
    answer = solve_assembly(posture, LOAD)
    for k, force in enumerate(forces, 1):
        found = answer.wrenches[posture.robot.index(f"leg{k}.strut")]
        expected = [0, 0, 0, 0, 0, force]
        assert np.abs(found - expected).max() < 1e-9 * np.abs(forces).max()


def assert_pose_error_is_of_64_corners(posture, lines, joints):
    """(27) in closed form: six lines give by their joints' play along them.

    The platform's errors are J^-1 of a box, the farthest at one of its corners.
    """
    robot, T = posture.robot, posture.transforms
    plays = np.zeros(6)
    for k, (line, ends) in enumerate(zip(lines, joints, strict=True)):
        for name in ends:
            u = T[robot.index(name), :3, :3].T @ line[3:]
            play = robot.frame(name).clearance
            plays[k] += play.radial * np.hypot(u[0], u[1]) + play.axial * abs(u[2])
    turn, shift = farthest_corner(lines, plays)
    found = bound_pose_error(solve_assembly(posture))
    for (low, high), expected in (
        (found.rotation_error, turn),
        (found.translation_error, shift),
    ):
        assert low <= expected * (1 + 1e-8)
        assert high >= expected * (1 - 1e-8)
        assert high - low <= 1e-6


def test_hexapod_pose_error_is_the_farthest_of_64_corners(rng):
    posture = place_robot(BUILT_IN["hexapod"](), pose=random_pose("hexapod", rng))
    lines, _ = strut_lines(posture)
    joints = [(f"leg{k}.cardan_2", f"leg{k}.ball_3") for k in range(1, 7)]
    assert_pose_error_is_of_64_corners(posture, lines, joints)


# Delta


@pytest.mark.parametrize(
    ("position", "degrees"),
    [
        ((0.0, 0.0, -0.9), (-20.5, -20.5, -20.5)),
        ((0.3, 0.5, -1.1), (47.5, -11.6, 21.4)),
    ],
)
def test_delta_drives_are_those_of_williams_examples(position, degrees):
    """Printed to a tenth of a degree."""
    pose = dict(zip(POSE, position, strict=False))
    posture = place_robot(BUILT_IN["delta"](), pose=pose)
    found = np.degrees(list(joints_of(posture).values()))
    assert np.abs(found - degrees).max() < 0.05


def test_delta_platform_is_where_three_spheres_meet(rng):
    base, platform = 0.567 * math.sqrt(3) / 6, 0.076 * math.sqrt(3) / 3
    robot = BUILT_IN["delta"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("delta", rng))
        centres = []
        angles = joints_of(posture).values()
        for azimuth, q in zip(np.radians([-90, 30, 150]), angles, strict=True):
            out = base - platform + 0.524 * math.cos(q)
            centres.append([
                out * math.cos(azimuth),
                out * math.sin(azimuth),
                -0.524 * math.sin(q),
            ])
        found = lower_meeting_point(np.array(centres), 1.244)
        assert np.abs(posture.platform[:3, 3] - found).max() < 1e-10


def test_delta_drive_angle_is_the_drives_coordinate(rng):
    robot = BUILT_IN["delta"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("delta", rng))
        for azimuth, q in zip((-90, 30, 150), joints_of(posture).values(), strict=True):
            found = drive_angle(
                DeltaParameters(), math.radians(azimuth), posture.platform[:3, 3]
            )
            assert found == pytest.approx(q, abs=1e-11)


def lower_meeting_point(centres, radius):
    """Of three equal spheres: below the circumcentre of their centres."""
    a, b = centres[1] - centres[0], centres[2] - centres[0]
    normal = np.cross(a, b)
    middle = np.cross((a @ a) * b - (b @ b) * a, normal) / (2 * normal @ normal)
    down = normal / np.linalg.norm(normal) * -np.sign(normal[2])
    return centres[0] + middle + math.sqrt(radius**2 - middle @ middle) * down


def test_delta_platform_keeps_its_orientation_and_its_rods_stay_parallel(rng):
    robot = BUILT_IN["delta"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("delta", rng))
        assert np.abs(posture.platform[:3, :3] - np.eye(3)).max() < 1e-11
        at = {f.name: T[:3, 3] for f, T in
              zip(robot.frames, posture.transforms, strict=True)}  # fmt: skip
        for leg in ("leg1", "leg2", "leg3"):
            one, two = (at[f"{leg}.{r}_low_1"] - at[f"{leg}.{r}_high_1"] for r in "ab")
            assert np.abs(one - two).max() < 1e-11
            assert np.linalg.norm(one) == pytest.approx(1.244, abs=1e-11)
            apart = at[f"{leg}.a_low_1"] - at[f"{leg}.b_low_1"]
            assert np.linalg.norm(apart) == pytest.approx(0.131, abs=1e-11)


def test_delta_without_the_spins_of_its_rods_has_three_freedoms():
    """Where a rod cannot turn in its upper ball joint, it still does in the lower."""
    robot = BUILT_IN["delta"]()
    frames = (
        replace(f, joint="fixed") if f.name.endswith("high_3") else f
        for f in robot.frames
    )
    found = mobility(home_posture(replace(robot, frames=tuple(frames))))
    assert (found.freedoms, found.locked_freedoms) == (3, 0)


def test_delta_out_of_reach_is_refused_with_the_reach():
    with pytest.raises(BadInput, match=r"delta: a leg needs a reach of 2\.0\d* m"):
        drive_angle(DeltaParameters(), 0.0, np.array([0.0, 0.0, -2.0]))


def test_delta_pose_error_is_the_farthest_of_64_corners(rng):
    """Its six rods hold the platform as six struts would."""
    posture = place_robot(BUILT_IN["delta"](), pose=random_pose("delta", rng))
    T, index = posture.transforms, posture.robot.index
    rods = [f"leg{k}.{r}" for k in (1, 2, 3) for r in "ab"]
    lines = []
    for rod in rods:
        high, low = (T[index(f"{rod}_{end}_3"), :3, 3] for end in ("high", "low"))
        n = (low - high) / np.linalg.norm(low - high)
        lines.append([*np.cross(low - posture.platform[:3, 3], n), *n])
    joints = [(f"{rod}_high_3", f"{rod}_low_3") for rod in rods]
    assert_pose_error_is_of_64_corners(posture, np.array(lines), joints)


# Orthoglide


def test_orthoglide_legs_keep_their_length(rng):
    robot = BUILT_IN["orthoglide"]()
    for _ in range(5):
        posture = place_robot(robot, pose=random_pose("orthoglide", rng))
        p = posture.platform[:3, 3]
        slides = np.array(list(joints_of(posture).values()))
        # (p_x - r_x)^2 + p_y^2 + p_z^2 = L^2, and so on
        left = (p - slides) ** 2 + p @ p - p**2 - 0.310**2
        assert np.abs(left).max() < 1e-12
        assert np.abs(posture.platform[:3, :3] - np.eye(3)).max() < 1e-11


def test_orthoglide_moves_as_its_slides_do_at_the_isotropic_point():
    """Chablat, Wenger (2003): the Jacobian is the identity there."""
    J = drive_jacobian(home_posture(BUILT_IN["orthoglide"]()))
    assert np.abs(J[3:] - np.eye(3)).max() < 1e-7
    assert np.abs(J[:3]).max() < 1e-7


def test_orthoglide_gives_as_its_drives_do_at_the_isotropic_point():
    posture = home_posture(only_drives_give(BUILT_IN["orthoglide"]()))
    found = platform_compliance(posture) * 5e7
    assert np.abs(found[3:, 3:] - np.eye(3)).max() < 1e-9
    assert np.abs(found[:3]).max() < 1e-9


# Serial arm


def denavit_hartenberg(theta, d, a, alpha):
    """(4, 4) element by element, as textbooks print it."""
    c, s, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array([
        [c, -s * ca, s * sa, a * c],
        [s, c * ca, -c * sa, a * s],
        [0, sa, ca, d],
        [0, 0, 0, 1],
    ])


PUMA = [  # d, a [m], alpha [rad]
    (0, 0, math.pi / 2), (0, 0.4318, 0), (0.15005, 0.0203, -math.pi / 2),
    (0.4318, 0, math.pi / 2), (0, 0, -math.pi / 2), (0, 0, 0),
]  # fmt: skip


def test_arm_stands_where_denavit_and_hartenberg_put_it(rng):
    robot = BUILT_IN["arm6"]()
    for _ in range(5):
        q = np.array(robot.positions[:6]) + rng.uniform(-1.0, 1.0, 6)
        expected = np.eye(4)
        for theta, row in zip(q, PUMA, strict=True):
            expected = expected @ denavit_hartenberg(theta, *row)
        joints = {f"joint{k + 1}": value for k, value in enumerate(q)}
        found = place_robot(robot, joints=joints).platform
        assert np.abs(found - expected).max() < 1e-12


@pytest.mark.parametrize(
    ("joints", "position", "approach"),
    [
        ((0, math.pi / 4, math.pi, 0, math.pi / 4, 0), (0.5963, -0.1501, -0.01435),
         (1, 0, 0)),
        ((0, 0, 0, 0, 0, 0), (0.4521, -0.15005, 0.4318), (0, 0, 1)),
    ],
    ids=["nominal", "zero"],
)  # fmt: skip
def test_arm_reaches_corkes_poses(joints, position, approach):
    """Printed to four or five digits."""
    named = {f"joint{k + 1}": value for k, value in enumerate(joints)}
    T = place_robot(BUILT_IN["arm6"](), joints=named).platform
    assert np.abs(T[:3, 3] - position).max() < 6e-5
    assert np.abs(T[:3, 2] - approach).max() < 1e-12


def arm_jacobian(posture):
    """(6, 6) by the joints' axes, at the flange in base axes."""
    z, p = posture.transforms[:6, :3, 2], posture.transforms[:6, :3, 3]
    return np.hstack([z, np.cross(z, posture.platform[:3, 3] - p)]).T


def test_arm_under_load_gives_by_its_drives(rng):
    """C = J K^-1 J^T to rounding, with the Jacobian of the axes."""
    robot = only_drives_give(BUILT_IN["arm6"]())
    posture = place_robot(robot, pose=random_pose("arm6", rng))
    J = arm_jacobian(posture)
    expected = J @ np.diag(1 / np.array([6e4, 6e4, 3e4, 3e3, 3e3, 2e3])) @ J.T
    size = np.sqrt(np.diag(expected))
    found = platform_compliance(posture)
    assert np.abs((found - expected) / np.outer(size, size)).max() < 1e-12


def test_arm_reaches_as_far_as_its_joints_play(rng):
    """A load pushes every joint to the bound of its play, each by itself."""
    posture = place_robot(only_play(BUILT_IN["arm6"]()), pose=random_pose("arm6", rng))
    play = Clearance(radial=5e-6, axial=5e-6, tilt=5e-5, spin=1e-4)
    answer = solve_assembly(posture, LOAD)
    expected = 0.0
    for T in posture.transforms[:6]:
        F = np.array(LOAD[3:])
        M = np.array(LOAD[:3]) + skew(posture.platform[:3, 3] - T[:3, 3]) @ F
        m, f = T[:3, :3].T @ M, T[:3, :3].T @ F
        expected += play.tilt * np.hypot(m[0], m[1]) + play.spin * abs(m[2])
        expected += play.radial * np.hypot(f[0], f[1]) + play.axial * abs(f[2])
    assert LOAD @ answer.platform_screw == pytest.approx(expected, rel=1e-8)


def test_built_in_names_load_and_misspelt_ones_are_answered_with_the_nearest():
    assert load_robot("3rrr").name == "3rrr"
    with pytest.raises(BadInput, match="hexapod"):
        load_robot("hexpod")
