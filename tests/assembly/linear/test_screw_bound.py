"""Platform screw bounds, compared with exact rational solutions of minimum energy."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.certificate import bound_screw, unproved
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.model.robot import Clearance, Frame, MatrixLink
from forcefit.assembly.report.results import solution_of, solution_text
from forcefit.assembly.robots import load_robot
from tests.robots_for_tests import coaxial_beams, random_robot


def exactly(A):
    """Convert an array of floats to rows of exact fractions."""
    return [[Fraction(float(v)) for v in row] for row in A]


def times(A, B):
    return [
        [sum(a * b for a, b in zip(row, column, strict=True) if a and b)
         for column in zip(*B, strict=True)]
        for row in A
    ]  # fmt: skip


def turned(A):
    return [list(column) for column in zip(*A, strict=True)]


def solved(K, right):
    """Solve linear equations exactly by Gauss-Jordan elimination; None if singular."""
    rows = [own + more for own, more in zip(K, right, strict=True)]
    for i in range(len(rows)):
        pivot = next((r for r in range(i, len(rows)) if rows[r][i]), None)
        if pivot is None:
            return None
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [v / rows[i][i] for v in rows[i]]
        for r, row in enumerate(rows):
            if r != i and row[i]:
                rows[r] = [a - row[i] * b for a, b in zip(row, rows[i], strict=True)]
    return [[row[-1]] for row in rows]


def exact_screw(answer):
    """Return the exact minimum-energy platform screw of a robot without clearance.

    The solution satisfies y = -A_y' l, A_y y + A_q q = -misfit and A_q' l = 0.
    """
    lin, joints = answer.linearisation, answer.joints
    A, springs, free = map(exactly, (lin.rows, joints.elastic, joints.free))
    errors = exactly(lin.posture.robot.errors.reshape(-1, 1))
    A_y, A_q = times(A, springs), times(A, free) if free[0] else [[] for _ in A]
    m, nq = len(A), len(free[0])
    K = [own + [-v for v in more]
         for own, more in zip(times(A_y, turned(A_y)), A_q, strict=True)]  # fmt: skip
    K += [[A_q[i][k] for i in range(m)] + [Fraction(0)] * nq for k in range(nq)]
    found = solved(K, times(A, errors) + [[Fraction(0)]] * nq)
    if found is None:
        return None
    y = times(turned(A_y), found[:m])
    screws = [[a[0] - b[0]] for a, b in zip(errors, times(springs, y), strict=True)]
    if nq:
        moved = times(free, found[m:])
        screws = [[a[0] + b[0]] for a, b in zip(screws, moved, strict=True)]
    return np.array([float(x[0]) for x in times(exactly(lin.platform), screws)])


def tight(robot, change):
    """Return the robot without clearance and with modified links."""
    return replace(robot, frames=tuple(
        replace(f, clearance=None, link=change(f.link) if f.link else None)
        for f in robot.frames
    ))  # fmt: skip


def assert_within(answer, exact):
    off, bound = exact - answer.platform_screw, bound_screw(answer)
    # rounding of the exact solution to floating point
    last = 1e-15 * np.abs(exact).max()
    assert np.linalg.norm(off[:3]) <= bound.rotation + last
    assert np.linalg.norm(off[3:]) <= bound.translation + last
    assert bound.rotation_open == bound.translation_open == 0.0


@pytest.mark.parametrize(
    "spread", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in (6, 12, 15))]
)
def test_screw_error_is_within_its_bound_for_mixed_stiffnesses(spread):
    compared = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        robot = tight(
            random_robot(rng, 2, 3, link_share=1.0),
            lambda link, rng=rng: MatrixLink(
                link.stiffness * 10.0 ** (spread * rng.integers(0, 3))
            ),
        )
        try:
            answer = solve_assembly(home_posture(robot))
        except CannotAssemble:
            continue
        exact = exact_screw(answer)
        if exact is None:  # The robot has an unconstrained internal motion.
            continue
        assert_within(answer, exact)
        compared += 1
    assert compared > 6


@pytest.mark.parametrize("young", [7e10, 1e18, 1e24, 1e30])
@pytest.mark.parametrize("name", ["four_bar", "five_bar"])
def test_screw_error_is_within_its_bound_for_any_stiffness(name, young):
    """With E = 1e30 Pa and elastic drives, the numerical error exceeds the screw."""
    rng = np.random.default_rng(1)
    robot = load_robot(name)
    robot = robot.with_errors(1e-3 * rng.uniform(-1, 1, (len(robot.frames), 6)))
    robot = tight(robot, lambda link: replace(link, young=young))
    answer = solve_assembly(home_posture(robot))
    exact = exact_screw(answer)
    assert_within(answer, exact)
    off = np.linalg.norm((exact - answer.platform_screw)[:3])
    if young == 7e10:
        assert off < 1e-12
        assert unproved(answer) == ""
    if young == 1e30:
        assert off > 1e-6
        assert "the platform's rotation is certified to" in unproved(answer)
        assert "the stiffest spring is" in unproved(answer)


def test_solution_dominated_by_round_off_is_not_proved():
    """The links have a Young's modulus of 1e24 Pa, and the drives are elastic."""
    robot = load_robot("five_bar")
    errors = 1e-3 * np.random.default_rng(1).uniform(-1, 1, (len(robot.frames), 6))
    robot = tight(robot.with_errors(errors), lambda link: replace(link, young=1e24))
    answer = solve_assembly(home_posture(robot))
    reason, found = unproved(answer), solution_of(answer.posture)
    assert reason
    assert (found["status"], found["reason"]) == ("not proved", reason)
    assert found["energy"] == answer.energy
    lines = [" ".join(line.split()) for line in solution_text(found).split("\n")]
    assert {"status not proved", f"reason {reason}"} <= {*lines}
    batch = solve_assembly([answer.posture])
    assert (batch.status[0], batch.reason[0]) == ("solver failed", reason)


def two_springs(k, gap, open_):
    """Return the assembly of two links of stiffness k with a given gap and residual."""
    assembly = solve_assembly(home_posture(coaxial_beams(np.zeros(6), (k, k))))
    vars(assembly).update(uncertainty=gap, rounding=open_)
    return assembly


def test_screw_bound_of_two_springs_equals_its_closed_form():
    """The bound along every axis is sqrt(g / k) for a closed loop.

    If the loop can stay open, one spring contains the whole energy gap, and the bound
    is sqrt(2 g / k).  The bounds are multiplied by sqrt(3) for the box around a ball.
    """
    k, gap = 4e4, 1e-6
    closed = bound_screw(two_springs(k, gap, 1e-15))
    expected = np.sqrt(3 * gap / k)
    for found in (closed.rotation, closed.translation, closed.translation_error):
        assert found == pytest.approx(expected, rel=1e-4)
    assert closed.rotation_open == closed.translation_open == 0.0
    # The reference length is the longest body, 1 m.
    open_ = bound_screw(two_springs(k, gap, 1.0))
    assert open_.rotation == pytest.approx(np.sqrt(2) * expected, rel=1e-4)
    assert open_.translation_error == pytest.approx(np.sqrt(2) * expected, rel=1e-4)


def test_clearance_outside_the_loop_is_not_a_numerical_error():
    """A gripper with radial clearance r and axial clearance a is on two beams."""
    r, a = 3e-5, 2e-5
    beams = coaxial_beams([0, 0, 0, 1e-4, 0, 0], (4e4, 4e4))
    hand = Frame("hand", "end_one", clearance=Clearance(radial=r, axial=a))
    robot = replace(beams, frames=(*beams.frames, hand), platform="hand")
    found = bound_screw(solve_assembly(home_posture(robot)))
    assert found.translation_open == pytest.approx(np.hypot(r, a), rel=1e-4)
    assert found.translation_open >= np.hypot(r, a)
    assert found.rotation_open == pytest.approx(0.0, abs=1e-10)
    assert found.translation_error < 1e-7
    assert found.rotation_error < 1e-7


@pytest.mark.parametrize("name", ["irsbot2", "hexapod", "delta"])
def test_screw_bound_without_errors_equals_the_largest_pose_error(name):
    """The computed screw is zero, so both bounds refer to the same quantity."""
    assembly = solve_assembly(home_posture(load_robot(name)))
    assert not assembly.platform_screw.any()
    found = bound_screw(assembly)
    error = bound_pose_error(assembly, "frozen", tolerance_rotation=1e-7,
                             tolerance_translation=1e-8)  # fmt: skip
    for open_, (low, high) in (
        (found.rotation_open, error.rotation_error),
        (found.translation_open, error.translation_error),
    ):
        assert low * (1 - 1e-9) <= open_ <= high * (1 + 1e-4)
