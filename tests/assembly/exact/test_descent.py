"""What a step of the exact equilibrium promises."""

from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from scipy.linalg import eigh, null_space

import assembly.exact.descent as descent
from assembly.exact.dead_load import dead_loads, work_gradient
from assembly.exact.descent import (
    NotConverged,
    _solve,
    advance,
    energy_of,
    expand,
    potential,
    problem_name,
)
from assembly.exact.finite_robot import SPRING, FiniteRobot
from assembly.exact.placement import place
from assembly.kinematics.posture import home_posture
from assembly.kinematics.se3 import inverse
from assembly.linear.closure import virtual_joints
from assembly.linear.energy import solve_assembly
from assembly.model.robot import Clearance, Frame, Robot
from tests.assembly.exact.test_dead_load import heavy, some_loads
from tests.assembly.exact.test_exact import only
from tests.assembly.exact.test_placement import moved_unknowns
from tests.robots_for_tests import random_robot


def step_from(placement, posture):
    """One step without damping."""
    local = expand(placement, dead_loads(posture), np.zeros(len(placement.residual)))
    return advance(local, 2.0 * np.linalg.norm(local.multipliers) + 1.0, 0.0, False)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("start", [0.0, 0.4])
def test_a_step_gains_what_its_expansion_foretells(seed, start):
    """For errors this small the expansion is the problem: from springs at rest one step
    ends at the least energy (22), paid for closing; from elsewhere it gains what lies
    between the two energies.
    """
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 2, 3)
    stiff = tuple(replace(frame, clearance=None) for frame in robot.frames)
    robot = replace(robot, frames=stiff).with_errors(1e-3 * robot.errors)
    posture = home_posture(robot)
    least = solve_assembly(posture)
    joints = virtual_joints(posture.robot)
    unknowns = sum(
        part.shape[1] for part in (joints.elastic, joints.cones, joints.free)
    )
    at_rest = place(FiniteRobot(posture, joints), np.zeros(unknowns))
    ended = step_from(at_rest, posture)
    part_way = place(at_rest.model, start * ended.placement.x)
    step = step_from(part_way, posture)
    assert energy_of(step.placement) == pytest.approx(least.energy, rel=1e-3, abs=0)
    gained = energy_of(part_way) - energy_of(step.placement)
    assert abs(gained) > 0.1 * least.energy
    assert step.gain == pytest.approx(gained, rel=1e-3, abs=0)


def expansion(seed, size=0.1, rigid_legs=False):
    """Far from home, where the closures hold all the same, under loads of all kinds."""
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 3, 3, link_share=0.0 if rigid_legs else 0.7)
    posture = home_posture(heavy(robot, rng) if not rigid_legs else robot)
    model, x, h = moved_unknowns(posture, rng, size)
    x[model.bounded] *= 0.5 / np.abs(x[model.bounded]).max(initial=1.0)
    T, (first, second) = place(model, x).transforms, model.closed_frames.T
    vars(model)["nominal_closures"] = inverse(T[first]) @ T[second]
    load, bodies, gravity = some_loads(posture, rng)
    loads = dead_loads(posture, load, bodies, gravity)
    there = place(model, x)
    rigid = rng.normal(size=len(there.residual))
    return expand(there, loads, rigid), rigid, h


@pytest.mark.parametrize("seed", range(3))
def test_an_expansion_has_the_potentials_slope_and_the_lagrangians_curvature(seed):
    """Central differences of 1e-5; multipliers and basis are held."""
    local, _, h = expansion(seed)
    model, x, step = local.placement.model, local.placement.x, 1e-5
    ahead, behind = place(model, x + step * h), place(model, x - step * h)
    slope = (potential(ahead, local.loads) - potential(behind, local.loads)) / step / 2
    assert local.gradient @ h == pytest.approx(slope, rel=1e-6)

    def unbalanced(at):
        forces = -work_gradient(at, local.loads) - at.rows.T @ local.multipliers
        forces[model.springs] += at.x[model.springs]
        return forces

    bend = (unbalanced(ahead) - unbalanced(behind)) / (2 * step)
    assert np.abs(local.hessian @ h - bend).max() < 1e-6 * np.abs(bend).max()


@pytest.mark.parametrize("rigid_legs", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_multipliers_balance_best_and_keep_the_guess_where_nothing_tells(
    seed, rigid_legs
):
    """A'l = g of unbounded unknowns, by weighted least squares; else as guessed."""
    local, rigid, _ = expansion(seed, rigid_legs=rigid_legs)
    free, at = local.unbounded, local.placement
    A, g, unit = at.rows[:, free], local.gradient[free], at.model.units[free]
    weighted = A * unit
    best = np.linalg.lstsq(weighted.T, unit * g, rcond=1e-9)[0]
    rank = np.linalg.matrix_rank(weighted, 1e-9 * np.linalg.norm(weighted))
    U = np.linalg.svd(weighted)[0][:, rank:]
    size = np.abs(local.multipliers).max()
    expected = best + U @ U.T @ rigid
    assert local.multipliers == pytest.approx(expected, abs=1e-8 * size)
    # the inverse is a pseudoinverse in those units
    found = local.inverse / unit[:, None]
    assert found == pytest.approx(
        np.linalg.pinv(weighted, rcond=1e-9), abs=1e-8 * np.abs(found).max()
    )


def test_problems_are_named_by_robot_and_load():
    robot = Robot("rod", "tip", (Frame("tip", translation=[1.0, 0, 0]),))
    posture = home_posture(robot)
    at = place(FiniteRobot(posture, virtual_joints(robot)), np.zeros(0))
    assert problem_name(at, dead_loads(posture)) == "exact equilibrium of rod"
    loaded = dead_loads(posture, [0, 0, 0, 1.5, 0, -2.0])
    assert problem_name(at, loaded) == (
        "exact equilibrium of rod under [0 0 0 1.5 0 -2] N m, N"
    )


def test_closures_that_no_clearance_within_its_bounds_closes_have_no_step():
    """A gap of 1 mm, rigid but for a play of 0.1 mm."""
    frames = (
        Frame("one", clearance=Clearance(axial=1e-4)), Frame("tip", "one"),
        Frame("two", geometric_error=[0, 0, 0, 0, 0, 1e-3]), Frame("end", "two"),
    )  # fmt: skip
    posture = home_posture(Robot("rigid", "tip", frames, (("tip", "end"),)))
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    local = expand(place(model, np.zeros(1)), dead_loads(posture), np.zeros(6))
    message = "rigid: no clearance within its bounds closes what no spring can"
    with pytest.raises(NotConverged, match=message):
        advance(local, 1.0, 0.0, False)


@pytest.mark.parametrize("near", [False, True])
def test_a_step_lowers_the_potential_by_part_of_what_is_foretold(near):
    """Of a heavy pendulum on a weak spring, from anywhere: a full step may overshoot.

    No step is longer than a radian; what was damped is damped less after a good step.
    """
    posture = home_posture(Robot("bar", "tip", (
        Frame("hinge", joint="revolute", joint_stiffness=only(2, 2.0)),
        Frame("tip", "hinge", [0.5, 0, 0]),
    )))  # fmt: skip
    model = FiniteRobot(posture, virtual_joints(posture.robot))
    loads = dead_loads(posture, [0, 0, 0.5, 40.0, -3.0, 0])
    damped = 0
    for angle in np.linspace(-3.1, 3.1, 32):
        at = place(model, np.array([angle * np.sqrt(2.0)]))
        assert at.screws[SPRING, 0, 2] == pytest.approx(angle, abs=1e-12)
        before = potential(at, loads)
        step = advance(expand(at, loads, np.zeros(0)), 1.0, 0.0, near)
        after = potential(step.placement, loads)
        assert before - after >= 0.99e-4 * step.gain - 1e-9
        assert step.gain > 0
        assert step.length <= 1.0
        turned = abs(step.placement.screws[SPRING, 0, 2] - angle)
        assert step.length == pytest.approx(turned, rel=1e-9)
        damped += step.damping > 0
        assert step.decrement == pytest.approx(step.gain, rel=1e-6)
    assert damped > 4


@pytest.mark.parametrize("rigid_legs", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_a_step_is_that_of_clarabel_on_all_unknowns(seed, rigid_legs):
    """Least g.c + c.(H + damping M) c / 2 with A c = 0 and all plays in their cones."""
    local, _, _ = expansion(seed, rigid_legs=rigid_legs)
    at, model = local.placement, local.placement.model
    per = 1 / np.sqrt(np.diag(model.metric))
    N = per[:, None] * null_space(at.rows * per, rcond=1e-9)
    H, M = N.T @ local.hessian @ N, N.T @ model.metric @ N
    curvatures = eigh((H + H.T) / 2, (M + M.T) / 2, eigvals_only=True)
    damping = max(0.0, -2 * curvatures[0]) + 1e-3 * np.abs(curvatures).max()
    root = np.linalg.cholesky((H + H.T) / 2 + damping * (M + M.T) / 2)
    z = cp.Variable(N.shape[1])
    u = at.x[model.bounded] + N[model.bounded] @ z
    group = model.joints.group
    cones = [cp.norm(u[np.flatnonzero(group == k)]) <= 1 for k in set(group.tolist())]
    slope = N.T @ local.gradient
    size = np.abs(np.linalg.solve(root, slope)).max() ** 2
    problem = cp.Problem(
        cp.Minimize((slope @ z + cp.sum_squares(root.T @ z) / 2) / size), cones
    )
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-12, tol_gap_rel=1e-12)
    step = _solve(local, damping, False, "compiled")
    assert step.gain == pytest.approx(-problem.value * size, rel=1e-6)
    assert step.decrement == pytest.approx(step.gain, rel=1e-6)
    change = N @ z.value
    length = np.sqrt(change @ model.metric @ change)
    assert step.length == pytest.approx(length, rel=1e-3)
    plays = step.placement.x[model.bounded]
    assert plays == pytest.approx(u.value, abs=1e-3)
    assert step.damping == damping


def test_a_start_without_any_step_downhill_is_said_to_be_one(monkeypatch):
    """Where no attempt is allowed, with how far it is open."""
    monkeypatch.setattr(descent, "_ATTEMPTS", 0)
    local, _, _ = expansion(0)
    with pytest.raises(NotConverged) as caught:
        advance(local, 1.0, 0.0, False)
    assert str(caught.value).startswith("exact equilibrium of random under [")
    assert ": no step lowers the energy; open by " in str(caught.value)
    assert caught.value.status.startswith("no step lowers")
