"""What a step of the exact equilibrium promises."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.exact.dead_load import dead_loads
from assembly.exact.descent import advance, energy_of, expand
from assembly.exact.finite_robot import FiniteRobot
from assembly.exact.placement import place
from assembly.kinematics.posture import home_posture
from assembly.linear.closure import virtual_joints
from assembly.linear.energy import solve_assembly
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
