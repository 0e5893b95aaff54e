"""Laws and closed forms of problem (22), and a second road for random robots."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from assembly.batch.many_draws import prepare_energies
from assembly.batch.many_postures import minimise_energies
from assembly.exact.exact import solve_exact
from assembly.kinematics.posture import Posture, home_posture, place_many, place_robot
from assembly.linear.certificate import unproved
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.load import loads_with_weight
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reduction import FreeMotion
from assembly.linear.reference import reference_energy
from assembly.linear.screw_bound import bound_screw
from assembly.linear.without_clearance import flexibility
from assembly.linear.zone import zone_margin
from assembly.measurement.settled_clearance import without_joint_clearances
from assembly.model.robot import BeamLink, Clearance, Frame, MatrixLink, Robot
from assembly.robots import load_robot
from assembly.solvers.conic import minimise_energy
from tests.robots_for_tests import (
    NUMBERS,
    coaxial_beams,
    irsbot2_with,
    planar_four_bar,
    random_robot,
)

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("axis", range(6))
def test_two_springs_in_series_take_the_gap(axis):
    """Energy g^2/2 k1 k2/(k1 + k2) for a gap along one axis, by hand."""
    gap = np.zeros(6)
    gap[axis] = 2e-4
    k1, k2 = 1e6, 3e6
    answer = solve_assembly(home_posture(coaxial_beams(gap, (k1, k2))))
    series = k1 * k2 / (k1 + k2)
    assert answer.energy == pytest.approx(series * 2e-4**2 / 2, rel=1e-12)
    one, two = (answer.posture.robot.index(n) for n in ("one", "two"))
    # link 1 is pulled towards the gap by k2/(k1 + k2) of it, and pulls with k1
    assert answer.link_screws[one, axis] == pytest.approx(1.5e-4, rel=1e-12)
    assert answer.wrenches[one, axis] == pytest.approx(series * 2e-4, rel=1e-12)
    assert answer.wrenches[two, axis] == pytest.approx(-series * 2e-4, rel=1e-12)
    wrench = answer.closure_wrenches[0]
    assert wrench[axis] == pytest.approx(series * 2e-4, rel=1e-12)
    assert answer.platform_screw[axis] == pytest.approx(1.5e-4, rel=1e-12)


@pytest.mark.parametrize(("gap", "left"), [(5e-5, 0.0), (1.5e-4, 5e-5)])
def test_play_is_used_up_before_anything_bends(gap, left):
    """Radial play of 1e-4 m: the springs only see what it leaves of the gap."""
    play = Clearance(radial=1e-4)
    direction = np.array([0, 0, 0, 0.6, 0.8, 0.0])
    robot = coaxial_beams(gap * direction, (1e6, 1e6), clearance=play)
    answer = solve_assembly(home_posture(robot))
    assert answer.energy == pytest.approx(0.5e6 * left**2 / 2, rel=1e-9, abs=1e-15)
    assert answer.clearance_excess() < 1e-12
    if left:
        found = answer.clearance_screws[robot.index("joint")]
        assert np.allclose(found, 1e-4 * direction, atol=1e-12)


@pytest.mark.parametrize("kappa", [0.05, 0.1])
def test_the_energy_is_proved_near_the_edge_of_the_zone(kappa):
    """Where hardly any energy is left; a part of the 25 mm grid."""
    for posture in half_workspace(every=37):
        assert_proved(solve_assembly(with_errors_times(kappa, posture)))


@pytest.mark.slow
def test_the_energy_is_proved_at_every_point_of_the_half_workspace():
    postures = half_workspace(every=1)
    assert len(postures) == 1113
    for kappa in (0.0, 0.05, 0.1, 0.2, 0.5, 1.0):
        for posture in postures:
            assert_proved(solve_assembly(with_errors_times(kappa, posture)))


def half_workspace(every):
    """Every so many postures of the 25 mm grid below the base."""
    x, z = np.meshgrid(np.arange(-0.65, 0.651, 0.025), np.arange(-0.75, 0.001, 0.025))
    poses = np.full((x.size, 6), np.nan)
    poses[:, 0], poses[:, 2] = x.ravel(), z.ravel()
    robot = irsbot2_with(NUMBERS["cases"][0])
    placed = place_many(robot, poses[::every])[0]
    return [posture for posture in placed if posture is not None]


def with_errors_times(factor, posture):
    """The posture of the robot with other errors."""
    robot = posture.robot
    return replace(posture, robot=robot.with_errors(factor * robot.errors))


def assert_proved(answer):
    """The promise of the batch, 1e-8 E + 1e-12 E(no play), not asking the answer."""
    assert unproved(answer) == ""
    gap = answer.potential - answer.bound
    assert gap <= 1e-8 * answer.energy + 1e-12 * answer.energy_without_clearance


def spoilt(solve):
    """A road whose clearances are 1e-4 off."""

    def road(G, h, d, H, k, group):
        u, rigid, status = solve(G, h, d, H, k, group)
        return 0.9999 * u, rigid, status

    return road


def test_what_no_road_proves_is_not_called_an_answer(monkeypatch):
    """The edge of the zone with Newton's method taken away and the others spoilt."""
    from assembly.batch import many_postures as batch
    from assembly.report.results import solution_of, solution_text
    from assembly.solvers import cone_solvers, conic

    robot = irsbot2_with(NUMBERS["cases"][0])
    posture = place_robot(robot, pose={"tx": 0.1, "tz": -0.5})
    good = solve_assembly(posture)
    assert_proved(good)
    energies = minimise_energies(robot, posture.transforms[None])
    monkeypatch.setattr(conic, "_SOLVERS", tuple(map(spoilt, conic._SOLVERS)))
    monkeypatch.setattr(cone_solvers, "newton", lambda *_: -1)
    answer = solve_assembly(posture)
    # 1e-4 of some clearances more energy than the least: far above 1e-8
    assert answer.energy > good.energy * (1 + 1e-8)
    assert "the energy is proved least to" in unproved(answer)
    found = solution_of(posture)
    assert found["status"] == "not proved"
    assert found["reason"] == unproved(answer)
    assert found["energy"] == answer.energy
    assert f"not proved: {unproved(answer)}" in solution_text(found)
    assert "certificate" in solution_text(found)
    batch._solve_fallback(posture, "elastic", energies, 0)
    assert (energies.status[0], energies.reason[0]) == (
        "solver failed", unproved(answer)
    )  # fmt: skip


def test_values_that_are_no_numbers_prove_nothing():
    answer = solve_assembly(place_robot(irsbot2_with(NUMBERS["cases"][0])))
    for spoilt_answer in (
        replace(answer, multipliers=answer.multipliers * np.nan),
        replace(answer, elastic=answer.elastic * np.nan),
        replace(answer, clearances=answer.clearances * np.nan),
    ):
        assert unproved(spoilt_answer)
    assert "stays open" in unproved(replace(answer, elastic=1.1 * answer.elastic))
    assert "exceeded by" in unproved(replace(answer, clearances=2 * answer.clearances))


def test_wrench_is_stiffness_times_deformation_everywhere():
    """w = K_E e = K_B b: the multipliers against eq. (6)."""
    posture = place_robot(irsbot2_with(NUMBERS["cases"][0]), pose={"tx": 0.1})
    answer = solve_assembly(posture, load=[1.0, 2.0, 3.0, 40.0, 50.0, 60.0])
    from assembly.model.links import joint_compliances, link_compliances

    robot = posture.robot
    for compliances, screws in (
        (link_compliances(robot), answer.link_screws),
        (joint_compliances(robot), answer.joint_screws),
    ):
        for C, screw, wrench in zip(compliances, screws, answer.wrenches, strict=True):
            size = np.sqrt(2 * answer.energy * np.diag(C))
            assert np.all(np.abs(C @ wrench - screw) <= 1e-8 * size + 1e-18)


@pytest.mark.parametrize("scale", [0.1, 3.0])
def test_errors_and_clearances_times_s_give_energy_times_s_squared(scale):
    case = NUMBERS["cases"][0]
    robot = irsbot2_with(case)
    scaled = replace(
        robot.with_errors(robot.errors * scale),
        frames=tuple(
            replace(
                f,
                geometric_error=f.geometric_error * scale,
                clearance=f.clearance
                and Clearance(*(scale * v for v in vars(f.clearance).values())),
            )
            for f in robot.frames
        ),
    )
    pose = {"tx": 0.1, "tz": -0.4}
    one = solve_assembly(place_robot(robot, pose=pose))
    other = solve_assembly(place_robot(scaled, pose=pose))
    assert other.energy == pytest.approx(scale**2 * one.energy, rel=1e-8)
    assert np.allclose(
        other.platform_screw, scale * one.platform_screw, rtol=1e-5, atol=1e-9 * scale
    )


def test_swapping_the_chains_of_a_closure_changes_only_its_wrenchs_sign():
    robot = irsbot2_with(NUMBERS["cases"][1])
    swapped = replace(robot, closures=tuple((b, a) for a, b in robot.closures))
    pose = {"tx": -0.2, "tz": -0.45}
    one = solve_assembly(place_robot(robot, pose=pose))
    other = solve_assembly(place_robot(swapped, pose=pose))
    assert other.energy == pytest.approx(one.energy, rel=1e-10)
    scale = np.abs(one.closure_wrenches[-1]).reshape(2, 3).max(axis=1).repeat(3)
    left = (other.closure_wrenches[-1] + one.closure_wrenches[-1]) / scale
    assert np.abs(left).max() < 1e-6


def test_moving_the_platform_frame_moves_the_screw_and_not_the_energy():
    """Another reference point on the same body: a rigid body's small motion."""
    robot = irsbot2_with(NUMBERS["cases"][0])
    arm = np.array([0.03, -0.2, 0.11])
    tool = Frame("tool", "leg1.tip", arm)
    moved = replace(robot, frames=(*robot.frames, tool), platform="tool")
    one = solve_assembly(place_robot(robot, pose={"tx": 0.0}))
    other = solve_assembly(place_robot(moved, pose={"tx": arm[0]}))
    assert other.energy == pytest.approx(one.energy, rel=1e-10)
    expected = one.platform_screw.copy()
    expected[3:] += np.cross(expected[:3], arm)
    assert np.allclose(other.platform_screw, expected, rtol=0, atol=1e-11)


def test_serial_cantilever_under_load_is_the_compliance_times_the_load():
    K = np.diag([2e3, 3e3, 4e3, 5e5, 6e5, 7e5])
    robot = Robot("arm", "tip", (Frame("tip", link=MatrixLink(K)),))
    load = np.array([1.0, -2.0, 3.0, -40.0, 50.0, 60.0])
    answer = solve_assembly(home_posture(robot), load)
    expected = np.linalg.solve(K, load)
    assert np.allclose(answer.platform_screw, expected, rtol=1e-12)
    assert answer.energy == pytest.approx(load @ expected / 2, rel=1e-12)
    assert answer.potential == pytest.approx(-load @ expected / 2, rel=1e-12)
    assert answer.duality_gap() <= 1e-12 * answer.energy


def test_serial_arm_moves_by_its_errors_exactly_to_first_order():
    """No closure, no load: eq. (8) with the errors alone, by finite motion."""
    error = np.array([1, -2, 3, 4, 5, -6.0]) * 1e-6
    frames = (
        Frame("a", translation=[0.1, 0.2, 0.3], rotation=[0.3, 0.1, -0.2],
              joint="revolute", actuated=True, position=0.4, geometric_error=error),
        Frame("b", "a", [0.4, 0, 0], [0, 0.7, 0]),
    )  # fmt: skip
    robot = Robot("arm", "b", frames)
    screw = solve_assembly(home_posture(robot)).platform_screw
    # the same error as a finite motion of frame a's far side, before its joint turns
    from scipy.spatial.transform import RigidTransform

    small = RigidTransform.from_exp_coords(error).as_matrix()
    T = home_posture(robot).transforms
    moved = T[0] @ small @ np.linalg.inv(T[0]) @ T[1]
    assert np.allclose(screw[3:], moved[:3, 3] - T[1, :3, 3], rtol=0, atol=1e-11)


def test_a_rigid_open_closure_cannot_be_assembled():
    robot = planar_four_bar()
    rigid = replace(robot, frames=tuple(replace(f, link=None) for f in robot.frames))
    errors = np.zeros((6, 6))
    errors[2] = [1e-3, 0, 0, 0, 0, 1e-4]  # out of the plane: no joint takes it up
    with pytest.raises(CannotAssemble, match="stays open by 0.00"):
        solve_assembly(home_posture(rigid.with_errors(errors)))


def test_a_load_along_a_free_motion_has_no_equilibrium():
    frames = (Frame("slide", joint="prismatic"), Frame("tip", "slide"))
    robot = Robot("slider", "tip", frames)
    with pytest.raises(FreeMotion, match="the load drives a motion"):
        solve_assembly(home_posture(robot), [0, 0, 0, 0, 0, 1.0])
    across = solve_assembly(home_posture(robot), [0, 0, 0, 1.0, 0, 0])
    assert across.energy == 0.0


def test_play_bound_of_a_passive_joint_holds_where_it_matters():
    """A passive slider bounded to +-1e-4 m: the spring takes the rest of the gap."""
    frames = (
        Frame("link", translation=[0, 0, 0.5], link=MatrixLink(1e6 * np.eye(6))),
        Frame("slide", "link", joint="prismatic", clearance=Clearance(axial=1e-4)),
        Frame("end", "slide"),
        Frame("wall", translation=[0, 0, 0.5],
              geometric_error=[0, 0, 0, 0, 0, 3e-4]),
    )  # fmt: skip
    robot = Robot("slider", "end", frames, (("end", "wall"),))
    answer = solve_assembly(home_posture(robot))
    assert answer.energy == pytest.approx(1e6 * (2e-4) ** 2 / 2, rel=1e-9)
    assert answer.clearance_screws[1, 5] == pytest.approx(1e-4, rel=1e-9)
    unbounded = replace(robot, frames=(frames[0], replace(frames[1], clearance=None),
                                       *frames[2:]))  # fmt: skip
    assert solve_assembly(home_posture(unbounded)).energy == pytest.approx(0, abs=1e-20)


def as_bearings(robot):
    """The robot with compliant joints free along their own motion; the same with each
    of them as two frames: the springs, rigid along it, then a bare free joint.
    """
    bearings, split, after = [], [], {}
    for f in robot.frames:
        parent = after.get(f.parent, f.parent)
        if not f.compliant:
            bearings.append(f)
            split.append(replace(f, parent=parent))
            continue
        K, rigid = f.joint_stiffness.copy(), f.joint_stiffness.copy()
        K[f.own_axis, f.own_axis], rigid[f.own_axis, f.own_axis] = 0.0, np.inf
        bearings.append(replace(f, joint_stiffness=K))
        spring = replace(f, parent=parent, joint="fixed", joint_stiffness=rigid)
        axis = replace(Frame(f"{f.name}.axis", f.name), joint=f.joint)
        if f.clearance is not None:
            key = "axial" if f.joint == "prismatic" else "spin"
            bound = getattr(f.clearance, key)
            spring = replace(spring, clearance=replace(f.clearance, **{key: None}))
            axis = replace(axis, clearance=Clearance(**{key: bound}))
        split += [spring, axis]
        after[f.name] = axis.name
    return replace(robot, frames=tuple(bearings)), replace(robot, frames=tuple(split))


def test_a_bearing_is_its_springs_and_then_a_free_joint():
    """In every solver; energies to 1e-8 of those without play, 1e-12 where linear."""
    compared = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        one, two = as_bearings(random_robot(rng, 2, 3))
        if len(one.frames) == len(two.frames):
            continue
        first, second = home_posture(one), home_posture(two)
        load = rng.normal(size=6) if seed % 2 else None
        try:
            answer = solve_assembly(first, load)
        except (CannotAssemble, FreeMotion) as error:
            with pytest.raises(type(error)):
                solve_assembly(second, load)
            continue
        other = solve_assembly(second, load)
        scale = 1e-8 * answer.energy_without_clearance + 1e-20
        assert answer.potential == pytest.approx(other.potential, rel=1e-8, abs=scale)
        assert not unproved(answer)
        zones = [zone_margin(p, "free").margin for p in (first, second)]
        if zones[0] is not None:
            assert zones[0] == pytest.approx(zones[1], rel=1e-7)
        batch = minimise_energies(one, first.transforms[None])
        assert batch.energy[0] == pytest.approx(
            solve_assembly(second).energy, rel=1e-7, abs=scale
        )
        if load is None:
            error, same = (bound_pose_error(a, "free") for a in (answer, other))
            assert error.translation_error == pytest.approx(
                same.translation_error, abs=1e-6
            )
            exact = [solve_exact(p).energy for p in (first, second)]
            assert exact[0] == pytest.approx(exact[1], rel=1e-6, abs=scale)
        tight = without_joint_clearances(one), without_joint_clearances(two)
        rows = [Posture(r, p.coordinates[None], p.transforms[None], p.mismatch)
                for r, p in zip(tight, (first, second), strict=True)]  # fmt: skip
        found = [
            flexibility(p).solve(
                np.zeros(1, int), p.robot.errors.reshape(1, -1), loads_with_weight(
                    p, np.zeros((1, 6)), np.zeros((1, 3))
                ),
            )
            for p in rows
        ]  # fmt: skip
        if all(f.solved[0] for f in found):
            np.testing.assert_allclose(
                found[0].platform_screw, found[1].platform_screw, rtol=1e-7, atol=1e-12
            )
        compared += 1
    assert compared > 10


def arm_against_wall(young, soft=50.0):
    """A bar of modulus ``young`` between a soft hinge and a wall that is off by 0.1 mm
    along it and 0.2 mm across; asked for is how far the hinge turns.
    """
    K = np.diag([np.inf, np.inf, soft, np.inf, np.inf, np.inf])
    bar = BeamLink({"radius": 0.01}, young, 0.3, theory="euler")
    frames = (
        Frame("hinge", joint="revolute", joint_stiffness=K),
        Frame("side", "hinge"),
        Frame("tip", "hinge", [0.5, 0, 0], link=bar, joint="revolute"),
        Frame("end", "tip"),
        Frame("wall", translation=[0.5, 0, 0],
              geometric_error=[0, 0, 0, -1e-4, 2e-4, 0]),
    )  # fmt: skip
    return home_posture(Robot("arm", "side", frames, (("end", "wall"),)))


@pytest.mark.parametrize("young", [7e10, 1e16, 1e20, 1e22, 1e30, 1e38])
def test_a_hinges_turn_is_within_its_bound_or_refused_by_name(young):
    """By hand: a force F across turns the hinge by F L / K = t and bends the bar by
    F L^3 / (3 E I); together t L + F L^3 / (3 E I) = 0.2 mm.
    """
    if young >= 1e30:
        with pytest.raises(CannotAssemble, match="stiffnesses differ 3e"):
            solve_assembly(arm_against_wall(young))
        return
    answer = solve_assembly(arm_against_wall(young))
    give = 0.5**2 / 50.0 + 0.5**3 / (3 * young * np.pi * 0.01**4 / 4)
    turn = 2e-4 / give * 0.5 / 50.0
    off, bound = abs(answer.platform_screw[2] - turn), bound_screw(answer)
    assert off <= bound.rotation + 1e-15
    assert bound.rotation_open == 0.0
    assert unproved(answer) == ""
    assert bound.rotation_error < 1e-8


@pytest.mark.parametrize("young", [7e10, 1e18, 1e24, 1e30])
@pytest.mark.parametrize("name", ["five_bar", "3rrr", "orthoglide"])
def test_a_screw_that_rounding_spoils_is_never_certified(name, young):
    """Against Young = 1e16: from there on the screws no longer change, to 1e-5 of them.

    Beams of all links equally stiff, so that the answer is a limit of its own.
    """

    def stiff(young):
        rng = np.random.default_rng(1)
        robot = load_robot(name)
        errors = 1e-3 * rng.uniform(-1, 1, (len(robot.frames), 6))
        frames = (
            replace(f, link=replace(f.link, young=young) if f.link else None)
            for f in robot.with_errors(errors).frames
        )
        return solve_assembly(home_posture(replace(robot, frames=tuple(frames))))

    answer, limit = stiff(young), stiff(1e16)
    bound, off = bound_screw(answer), answer.platform_screw - limit.platform_screw
    other = bound_screw(limit)
    if young >= 1e16:
        assert np.linalg.norm(off[:3]) <= bound.rotation + other.rotation
        assert np.linalg.norm(off[3:]) <= bound.translation + other.translation
    if young != 1e18:  # in between its bound is what is told
        assert bool(unproved(answer)) == (young >= 1e24)
        posture = answer.posture
        batch = minimise_energies(posture.robot, posture.transforms[None])
        assert (batch.status[0] == "ok") == (unproved(answer) == "")


def test_screws_of_least_energy_from_another_solver_are_within_the_bound():
    """cvxpy's answers, of 1e-8 J at best, are themselves off by the root of that: told
    apart by what their own energies are above the bound.
    """
    compared = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        posture = home_posture(random_robot(rng, 2, 3))
        try:
            answer = solve_assembly(posture)
        except CannotAssemble:
            continue
        energy, screw = reference_energy(posture)
        # any assembly this much above the least, not only the least: the same bound
        worse = replace(answer, multipliers=answer.multipliers)
        worse.__dict__["uncertainty"] = answer.uncertainty + max(
            energy - answer.bound, 1e-9 * answer.energy_without_clearance
        )
        bound = bound_screw(worse)
        off = screw - answer.platform_screw
        assert np.linalg.norm(off[:3]) <= bound.rotation + 1e-9
        assert np.linalg.norm(off[3:]) <= bound.translation + 1e-9
        compared += answer.energy > 0
    assert compared > 10


def test_rounding_of_zero_is_zero():
    """Errors of a loop that add up to nothing, but not in floating point: 0.1 + 0.2."""
    parts = [1e-4, 2e-4, -3e-4]
    frames = [Frame("f0", translation=[0.1, 0, 0], link=MatrixLink(1e6 * np.eye(6)))]
    for i, error in enumerate(parts):
        frames.append(Frame(f"f{i + 1}", f"f{i}", [0.1, 0, 0],
                            geometric_error=[0, 0, 0, error, 0, 0]))  # fmt: skip
    frames.append(Frame("wall", translation=[0.4, 0, 0]))
    robot = Robot("loop", "f3", tuple(frames), (("f3", "wall"),))
    posture = home_posture(robot)
    assert sum(parts) != 0.0
    answer = solve_assembly(posture)
    assert answer.energy == 0.0
    assert not answer.wrenches.any()
    assert minimise_energies(robot, posture.transforms[None]).energy[0] == 0.0
    drawn = prepare_energies(posture).solve(robot.errors[None])
    assert drawn.energy[0] == 0.0
    # what is small and not rounding stays: k g^2 / 2 of one spring, by hand
    for gap in (1e-6, 1e-12, 1e-17):
        frames[1] = replace(frames[1], geometric_error=[0, 0, 0, gap, 0, 0])
        small = replace(robot, frames=(*frames[:2], Frame("f3", "f1", [0.2, 0, 0]),
                                       frames[-1]))  # fmt: skip
        here = home_posture(small)
        for energy in (
            solve_assembly(here).energy,
            minimise_energies(small, here.transforms[None]).energy[0],
            prepare_energies(here).solve(small.errors[None]).energy[0],
        ):
            assert energy == pytest.approx(1e6 * gap**2 / 2, rel=1e-9)


def test_play_that_just_suffices_stores_nothing():
    """A gap of the size of the play, to the last digit: inside, at, and beyond it."""
    direction = np.array([0, 0, 0, 0.6, 0.8, 0.0])
    for gap, energy in ((1e-4, 0.0), (1e-4 * (1 + 1e-16), 0.0),
                        (1.0001e-4, 0.5e6 * 1e-8**2 / 2)):  # fmt: skip
        robot = coaxial_beams(gap * direction, clearance=Clearance(radial=1e-4))
        posture = home_posture(robot)
        batch = minimise_energies(robot, posture.transforms[None])
        for found in (solve_assembly(posture).energy, batch.energy[0]):
            assert found == (pytest.approx(energy, rel=1e-3) if energy else 0.0)


def test_frames_in_another_order_give_the_same_answer():
    robot = irsbot2_with(NUMBERS["cases"][0])
    turned = Robot(robot.name, robot.platform, robot.frames[::-1], robot.closures)
    one = solve_assembly(home_posture(robot))
    other = solve_assembly(home_posture(turned))
    assert other.energy == pytest.approx(one.energy, rel=1e-10)
    name = "leg2.link_b"
    a, b = one.wrenches[robot.index(name)], other.wrenches[turned.index(name)]
    assert np.allclose(a, b, rtol=1e-6, atol=1e-6 * np.abs(a).max())


def test_the_certificate_trusts_nothing_but_the_wrenches():
    """Answers spoilt on purpose: a gap opens that the wrong part accounts for."""
    robot = coaxial_beams(np.array([0, 0, 0, 2e-4, 0, 0]), (1e6, 3e6))
    answer = solve_assembly(home_posture(robot))
    assert answer.duality_gap() < 1e-12 * answer.energy
    for wrong in (0.0, 0.9, 1.1, 2.0):
        spoilt = replace(answer, multipliers=answer.multipliers * wrong)
        # complementary energy: f g - f^2 C / 2, off by (wrong - 1)^2 of the energy
        expected = (wrong - 1) ** 2 * answer.energy
        assert spoilt.duality_gap() == pytest.approx(expected, rel=1e-9)
    stiffer = replace(answer, elastic=answer.elastic * 1.01)
    assert stiffer.duality_gap() == pytest.approx(0.0201 * answer.energy, rel=1e-6)
    assert stiffer.closure_residual() > 1e-7


@settings(deadline=None, max_examples=25)
@given(seed=seeds, legs=st.integers(1, 3), joints=st.integers(1, 3))
# the first cannot be assembled by 0.1 % of its clearances, which Clarabel's own ray
# shows only together with the bounds on the clearances
@example(seed=0, legs=2, joints=1)
@example(seed=17, legs=3, joints=1)
@example(seed=58, legs=2, joints=2)
def test_random_robots_equal_the_printed_problem_in_cvxpy(seed, legs, joints):
    """Tolerance 1e-6 of the energy without play: what cvxpy's solver reaches."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, legs, joints)
    load = rng.normal(size=6) * [1, 1, 1, 10, 10, 10] if rng.random() < 0.5 else None
    posture = home_posture(robot)
    try:
        answer = solve_assembly(posture, load)
    except (CannotAssemble, FreeMotion):
        with pytest.raises(RuntimeError, match="infeasible|unbounded|failed"):
            reference_energy(posture, load)
        return
    scale = max(answer.energy, 1e-6 * answer.energy_without_clearance, 1e-9)
    assert answer.duality_gap() < 1e-8 * (scale + abs(answer.potential))
    assert answer.closure_residual() < 1e-11
    assert answer.clearance_excess() < 1e-9
    energy, screw = reference_energy(posture, load)
    work = 0.0 if load is None else load @ screw
    assert energy - work == pytest.approx(answer.potential, rel=1e-6, abs=1e-6 * scale)


@pytest.mark.parametrize("turned", [1, -1])
def test_a_closure_out_of_reach_is_told_from_one_within_it(turned):
    """H u reaches 5 over the disc and 2 over the interval: 7, and not 7 + 1e-6."""
    H = np.array([[3.0, 4.0, 2.0]])
    problem = np.zeros((1, 3)), np.ones(1), np.zeros(3), H
    group = np.array([0, 0, 1])
    beyond = minimise_energy(*problem, turned * np.array([7.0 * (1 + 1e-6)]), group)
    assert not beyond.feasible
    within = minimise_energy(*problem, turned * np.array([7.0 * (1 - 1e-6)]), group)
    assert within.feasible
    # its only point, but for 1e-3: the square root of what is left of the reach
    only = turned * np.array([0.6, 0.8, 1.0])
    np.testing.assert_allclose(within.clearances, only, atol=3e-3)
