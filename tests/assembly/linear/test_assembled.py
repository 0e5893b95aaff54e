"""Certificates of assemblies above the least energy, against their definitions."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import home_posture, together
from forcefit.assembly.linear.energy import solve_assembly, together_at
from forcefit.assembly.model.clearance import CONES, clearance_bounds
from forcefit.assembly.model.links import joint_compliances, link_compliances
from tests.robots_for_tests import coaxial_beams, random_robot


def disturbed(rng, seed):
    """A random robot's assembly, and the same with a disturbed solution."""
    robot = random_robot(np.random.default_rng(seed), 2, link_share=0.8)
    load = rng.normal(size=6) * [1, 1, 1, 10, 10, 10]
    best = solve_assembly(home_posture(robot), load)
    other = replace(
        best,
        elastic=best.elastic + 1e-2 * rng.normal(size=best.elastic.shape),
        clearances=0.3 * rng.normal(size=best.clearances.shape),
        motions=best.motions + 1e-4 * rng.normal(size=best.motions.shape),
        multipliers=best.multipliers + 0.1 * rng.normal(size=best.multipliers.shape),
    )
    return best, other


def bound_by_hand(assembly):
    """-w.dl - w C w / 2 - what clearances gain - |w q|, frame by frame."""
    robot, total = assembly.posture.robot, 0.0
    C_link, C_joint = link_compliances(robot), joint_compliances(robot)
    bounds = clearance_bounds(robot)
    free = (assembly.joints.free * np.abs(assembly.motions)).sum(axis=1).reshape(-1, 6)
    for i in range(len(robot.frames)):
        w, j = assembly.wrenches[i], assembly.joint_wrenches[i]
        total -= w @ robot.errors[i] + w @ C_link[i] @ w / 2 + j @ C_joint[i] @ j / 2
        for size, rows in zip(bounds[i], CONES, strict=True):
            unbounded = free[i, list(rows)].any() or not np.isfinite(size)
            total -= 0.0 if unbounded else size * np.linalg.norm(j[list(rows)])
        total -= np.abs(j) @ free[i]
    return total


SEEDS = (1, 3, 4, 6, 9, 12)


def solvable(rng):
    """Assemblies of the random robots that have one."""
    for seed in SEEDS:
        try:
            yield disturbed(rng, seed)
        except (ValueError, RuntimeError):
            continue


def test_any_wrenches_imply_a_lower_bound_of_the_energy(rng):
    """Weak duality; the bound is the sum that its docstring defines."""
    some = list(solvable(rng))
    assert len(some) >= 3
    assert any(len(other.motions) for _, other in some)
    for best, other in some:
        bounded = replace(other, motions=best.motions)
        scale = best.energy_without_clearance + abs(best.work)
        assert bounded.bound <= best.potential + 1e-9 * scale
        by_hand = bound_by_hand(other)
        assert other.bound == pytest.approx(by_hand, rel=1e-9, abs=1e-9 * scale)


def test_joining_solutions_keeps_the_certificate_of_each_point():
    """The bound is the energy less the gap, also above the least energy."""
    robot = coaxial_beams([0, 0, 0, 1e-4, 0, 0])
    best = solve_assembly(home_posture(robot))
    worse = replace(best, elastic=1.001 * best.elastic)
    found = together_at(together([best.posture] * 2), (best, worse))
    gaps = [best.duality_gap(), worse.duality_gap()]
    assert found.duality_gap() == pytest.approx(gaps)
