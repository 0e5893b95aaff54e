"""The certificate of the platform screw against least energies in exact fractions."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear.certificate import unproved
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.screw_bound import bound_screw
from assembly.model.robot import MatrixLink
from assembly.robots import load_robot
from tests.robots_for_tests import random_robot


def exactly(A):
    """An array of floats as rows of fractions: no digit is lost."""
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
    """Gauss-Jordan elimination, exact; None if singular."""
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
    """Platform screw of least energy of a robot without play, every digit right.

    y = -A_y' l, A_y y + A_q q = -misfit and A_q' l = 0, with the columns as given.
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
    """The robot without play, its links changed."""
    return replace(robot, frames=tuple(
        replace(f, clearance=None, link=change(f.link) if f.link else None)
        for f in robot.frames
    ))  # fmt: skip


def assert_within(answer, exact):
    off, bound = exact - answer.platform_screw, bound_screw(answer)
    # the last place of the exact answer as a float
    last = 1e-15 * np.abs(exact).max()
    assert np.linalg.norm(off[:3]) <= bound.rotation + last
    assert np.linalg.norm(off[3:]) <= bound.translation + last
    assert bound.rotation_open == bound.translation_open == 0.0


@pytest.mark.parametrize(
    "spread", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in (6, 12, 15))]
)
def test_random_robots_whose_stiffnesses_differ_by_any_powers_of_ten(spread):
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
        if exact is None:  # an idle motion
            continue
        assert_within(answer, exact)
        compared += 1
    assert compared > 6


@pytest.mark.parametrize("young", [7e10, 1e18, 1e24, 1e30])
@pytest.mark.parametrize("name", ["four_bar", "five_bar"])
def test_the_true_error_is_below_the_stated_one_however_stiff_the_links(name, young):
    """With Young = 1e30 beside elastic drives the screw is off by more than it is."""
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
        assert "the platform's rotation is proved to" in unproved(answer)
        assert "stiffnesses differ" in unproved(answer)
