"""Problem (27) by other methods: vertices and cvxpy."""

import itertools

import cvxpy as cp
import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.assembly.linear.reference.pose_error import ReachableSet, reachable_screws
from forcefit.assembly.robots.irsbot2 import irsbot2
from tests.robots_for_tests import NUMBERS, irsbot2_with


def by_cvxpy(reach, direction):
    """Largest component along a direction, by cvxpy from the set's own definition."""
    v = cp.Variable(len(reach.start))
    screw = (reach.centre + reach.map @ (v - reach.start)) * 1e3
    limits = [cp.norm(v[reach.group == c]) <= 1 for c in np.unique(reach.group)]
    if len(reach.rows):
        limits.append(reach.rows @ (v - reach.start) == 0)
    problem = cp.Problem(cp.Maximize(direction @ screw), limits)
    problem.solve(solver=cp.CLARABEL)
    return problem.value / 1e3


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rows", [0, 1, 3])
def test_pose_error_of_intervals_equals_the_farthest_vertex(seed, rows):
    """Intervals alone make a polytope, whose vertices are enumerated."""
    rng, nv = np.random.default_rng(seed), 7
    reach = ReachableSet(
        rng.normal(size=6) * 2e-3, rng.normal(size=(6, nv)) * 1e-3,
        np.linalg.qr(rng.normal(size=(nv, rows)))[0].T, rng.uniform(-0.5, 0.5, nv),
        np.arange(nv),
    )  # fmt: skip
    right = reach.rows @ reach.start
    vertices = []
    for free in itertools.combinations(range(nv), rows):
        fixed = np.setdiff1d(np.arange(nv), free)
        for signs in itertools.product((-1.0, 1.0), repeat=nv - rows):
            v = np.empty(nv)
            v[fixed] = signs
            if rows:
                left = right - reach.rows[:, fixed] @ v[fixed]
                v[list(free)] = np.linalg.solve(reach.rows[:, list(free)], left)
            if np.abs(v).max() <= 1 + 1e-12:
                vertices.append(reach.centre + reach.map @ (v - reach.start))
    for part in (slice(0, 3), slice(3, 6)):
        farthest = np.linalg.norm(np.array(vertices)[:, part], axis=1).max()
        (low, high), *_ = reach.farthest(part.start, 1e-9)
        assert low <= farthest * (1 + 1e-9)
        assert high >= farthest * (1 - 1e-9)
        assert high - low <= 1e-9


@pytest.mark.parametrize("assumption", ["frozen", "free", "budget"])
def test_supports_of_the_paper_robot_equal_cvxpy(assumption, rng):
    robot = irsbot2() if assumption == "frozen" else irsbot2_with(NUMBERS["cases"][0])
    posture = place_robot(robot, pose={"tx": 0.1, "tz": -0.5})
    reach = reachable_screws(solve_assembly(posture), assumption)
    for _ in range(3):
        direction = rng.normal(size=6) * [1, 1, 1, 5, 5, 5]
        found = reach.support(direction)
        expected = by_cvxpy(reach, direction)
        assert found.height == pytest.approx(expected, rel=1e-6)
        assert direction @ found.screw == pytest.approx(expected, rel=1e-6)
