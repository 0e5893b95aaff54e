"""Problem (22), compared with closed forms and with cvxpy for random robots."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from forcefit import CannotAssemble, bound_pose_error, solve_assembly, solve_exact
from forcefit.assembly.kinematics.posture import home_posture, place_robot
from forcefit.assembly.linear.certificate import unproved
from forcefit.assembly.linear.reference.as_printed import energy_as_printed
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.linear.zone import zone_margin
from forcefit.assembly.measurement.settled_clearance import without_joint_clearances
from forcefit.assembly.model.links import joint_compliances, link_compliances
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink, Robot
from forcefit.assembly.robots import load_robot
from forcefit.assembly.solvers.conic import minimise_energy
from forcefit.assembly.solvers.method import METHODS
from tests.robots_for_tests import (
    NUMBERS,
    assemble_at,
    coaxial_beams,
    irsbot2_with,
    planar_four_bar,
    random_robot,
)

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("axis", range(6))
def test_energy_of_two_springs_in_series_equals_the_closed_form(axis):
    """The energy for a gap g along one axis is k1 k2/(k1 + k2) g^2/2."""
    gap = np.zeros(6)
    gap[axis] = 2e-4
    k1, k2 = 1e6, 3e6
    answer = solve_assembly(home_posture(coaxial_beams(gap, (k1, k2))))
    series = k1 * k2 / (k1 + k2)
    assert answer.energy == pytest.approx(series * 2e-4**2 / 2, rel=1e-12)
    one, two = (answer.posture.robot.index(n) for n in ("one", "two"))
    # Link 1 deforms by k2/(k1 + k2) times the gap.
    assert answer.link_screws[one, axis] == pytest.approx(1.5e-4, rel=1e-12)
    assert answer.wrenches[one, axis] == pytest.approx(series * 2e-4, rel=1e-12)
    assert answer.wrenches[two, axis] == pytest.approx(-series * 2e-4, rel=1e-12)
    wrench = answer.closure_wrenches[0]
    assert wrench[axis] == pytest.approx(series * 2e-4, rel=1e-12)
    assert answer.platform_screw[axis] == pytest.approx(1.5e-4, rel=1e-12)


@pytest.mark.parametrize(
    ("gap", "left"),
    [(5e-5, 0.0), (1e-4, 0.0), (1e-4 * (1 + 1e-16), 0.0), (1.5e-4, 5e-5)],
)
def test_springs_deform_by_the_gap_minus_the_clearance(gap, left):
    """A radial clearance of 1e-4 m reduces the gap."""
    clearance = Clearance(radial=1e-4)
    direction = np.array([0, 0, 0, 0.6, 0.8, 0.0])
    robot = coaxial_beams(gap * direction, (1e6, 1e6), clearance=clearance)
    answer = solve_assembly(home_posture(robot))
    assert answer.energy == pytest.approx(0.5e6 * left**2 / 2, rel=1e-9, abs=1e-15)
    assert answer.clearance_excess() < 1e-12
    if left:
        found = answer.clearance_screws[robot.index("joint")]
        assert np.allclose(found, 1e-4 * direction, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_wrench_equals_stiffness_times_deformation_of_every_spring(method):
    """The tolerance of w = K_E e = K_B b, eq. (6), follows from the duality gap."""
    posture = place_robot(irsbot2_with(NUMBERS["cases"][0]), pose={"tx": 0.1})
    answer = solve_assembly(posture, [1.0, 2.0, 3.0, 40.0, 50.0, 60.0], method=method)
    robot = posture.robot
    gap = 2 * answer.uncertainty / answer.energy
    for compliances, screws in (
        (link_compliances(robot), answer.link_screws),
        (joint_compliances(robot), answer.joint_screws),
    ):
        for C, screw, wrench in zip(compliances, screws, answer.wrenches, strict=True):
            size = np.sqrt(2 * answer.energy * np.diag(C))
            off = np.abs(C @ wrench - screw)
            assert np.all(off <= np.sqrt(gap) * size + 1e-18)
            if method == "reference":
                assert np.all(off <= 1e-8 * size + 1e-18)
            else:
                assert gap < 1e-10


@pytest.mark.parametrize("name", ["irsbot2", "3rrr", "delta"])
def test_energy_without_clearance_equals_that_of_a_robot_without_clearance(name, rng):
    home = home_posture(load_robot(name))
    errors = 1e-4 * rng.normal(size=home.robot.errors.shape)
    if name == "irsbot2":  # its proximal loops are rigid
        errors[~np.any(irsbot2_with(NUMBERS["cases"][0]).errors, axis=1)] = 0.0
    tight = without_joint_clearances(home.robot).with_errors(errors)
    posture = replace(home, robot=tight)
    for method in METHODS:
        load = [1.0, 2.0, 3.0, 40.0, 50.0, 60.0]
        answer = solve_assembly(posture, load, method=method)
        assert answer.joints.cones.shape[1] == 0
        assert answer.energy > 0.0
        assert answer.energy_without_clearance == pytest.approx(answer.energy, rel=1e-9)


def test_energy_does_not_depend_on_the_platform_frame():
    """The screw of the other platform frame is that of a rigid body."""
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


def test_open_loop_of_rigid_bodies_cannot_be_assembled():
    robot = planar_four_bar()
    rigid = replace(robot, frames=tuple(replace(f, link=None) for f in robot.frames))
    errors = np.zeros((6, 6))
    # out-of-plane error, which no joint can compensate
    errors[2] = [1e-3, 0, 0, 0, 0, 1e-4]
    with pytest.raises(CannotAssemble, match="stays open by 0.00"):
        solve_assembly(home_posture(rigid.with_errors(errors)))


@pytest.mark.parametrize("method", METHODS)
def test_passive_joint_stops_at_its_motion_limit(method):
    """The slide moves by at most 1e-4 m, and the spring closes the remaining gap."""
    frames = (
        Frame("link", translation=[0, 0, 0.5], link=MatrixLink(1e6 * np.eye(6))),
        Frame("slide", "link", joint="prismatic", clearance=Clearance(axial=1e-4)),
        Frame("end", "slide"),
        Frame("wall", translation=[0, 0, 0.5],
              geometric_error=[0, 0, 0, 0, 0, 3e-4]),
    )  # fmt: skip
    robot = Robot("slider", "end", frames, (("end", "wall"),))
    answer = solve_assembly(home_posture(robot), method=method)
    assert answer.method == method
    assert answer.energy == pytest.approx(1e6 * (2e-4) ** 2 / 2, rel=1e-9)
    assert answer.clearance_screws[1, 5] == pytest.approx(1e-4, rel=1e-9)
    within = home_posture(robot.with_errors(robot.errors / 4))
    answer = solve_assembly(within, method=method)
    assert answer.energy == pytest.approx(0, abs=1e-20)
    assert np.abs(answer.clearance_screws[1, 5]) == pytest.approx(3e-4 / 4, rel=1e-9)
    unbounded = replace(robot, frames=(frames[0], replace(frames[1], clearance=None),
                                       *frames[2:]))  # fmt: skip
    answer = solve_assembly(home_posture(unbounded), method=method)
    assert answer.energy == pytest.approx(0, abs=1e-20)


def as_bearings(robot):
    """Return a robot with free compliant joints, and its equivalent with springs.

    In the second robot, springs in series with a free joint replace each compliant
    joint.
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


def test_compliant_joint_equals_springs_in_series_with_a_free_joint():
    """Energies agree to 1e-8 of the energy without clearance."""
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
        batch = assemble_at(one, first.transforms[None])
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
        compared += 1
    assert compared > 10


@settings(deadline=None, max_examples=25)
@given(seed=seeds, legs=st.integers(1, 3), joints=st.integers(1, 3))
# Seed 0: the clearances are too small by 0.1 %.
@example(seed=0, legs=2, joints=1)
@example(seed=17, legs=3, joints=1)
@example(seed=58, legs=2, joints=2)
def test_energy_of_random_robots_agrees_with_cvxpy(seed, legs, joints):
    """The accuracy of cvxpy is 1e-6 of the energy without clearance."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, legs, joints)
    load = rng.normal(size=6) * [1, 1, 1, 10, 10, 10] if rng.random() < 0.5 else None
    posture = home_posture(robot)
    try:
        answer = solve_assembly(posture, load)
    except (CannotAssemble, FreeMotion):
        with pytest.raises(RuntimeError, match="infeasible|unbounded|failed"):
            energy_as_printed(posture, load)
        return
    scale = max(answer.energy, 1e-6 * answer.energy_without_clearance, 1e-9)
    assert answer.duality_gap() < 1e-8 * (scale + abs(answer.potential))
    assert answer.closure_residual() < 1e-11
    assert answer.clearance_excess() < 1e-9
    energy, screw = energy_as_printed(posture, load)
    work = 0.0 if load is None else load @ screw
    assert energy - work == pytest.approx(answer.potential, rel=1e-6, abs=1e-6 * scale)


@pytest.mark.parametrize("turned", [1, -1])
def test_gap_larger_than_all_clearances_is_infeasible(turned):
    """The largest H u is 5 for the disc plus 2 for the interval."""
    H = np.array([[3.0, 4.0, 2.0]])
    problem = np.zeros((1, 3)), np.ones(1), np.zeros(3), H
    group = np.array([0, 0, 1])
    beyond = minimise_energy(*problem, turned * np.array([7.0 * (1 + 1e-6)]), group)
    assert not beyond.feasible
    within = minimise_energy(*problem, turned * np.array([7.0 * (1 - 1e-6)]), group)
    assert within.feasible
    # The feasible set has a size of about sqrt(1e-6).
    only = turned * np.array([0.6, 0.8, 1.0])
    np.testing.assert_allclose(within.clearances, only, atol=3e-3)
