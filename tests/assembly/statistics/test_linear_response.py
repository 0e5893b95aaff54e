"""Many draws of errors at one posture, against single solutions."""

from dataclasses import replace

import numpy as np
import pytest

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.robots import load_robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.posture_margins import prepare_margins
from tests.robots_for_tests import random_robot
from tests.tolerances_for_tests import drawn_errors

ROBOTS = ["irsbot2", "five_bar", "3rrr", "orthoglide", "hexapod", "arm6"]
LOAD, GRAVITY = [1.0, 2.0, 3.0, 30.0, 10.0, -100.0], [1.0, 2.0, -9.81]


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize(
    ("scale", "load", "gravity"),
    [(0.2, None, None), (1.0, None, None), (10.0, None, None), (4.0, LOAD, None),
     (4.0, LOAD, GRAVITY)],
)  # fmt: skip
def test_draws_equal_single_solutions(name, scale, load, gravity):
    """Both certify 1e-8 of the energy, so wrenches agree to about its root, 1e-4."""
    robot = load_robot(name)
    posture = place_robot(robot)
    errors = drawn_errors(robot, scale)
    found = linear_response(posture, load, gravity).solve(errors)
    wrenches = found.wrenches
    for i, own in enumerate(errors):
        erring = replace(posture, robot=robot.with_errors(own))
        answer = solve_assembly(erring, load, gravity=gravity)
        allowed = 2e-8 * answer.energy + 2e-12 * answer.energy_without_clearance
        assert 0.0 <= found.duality_gap()[i] <= allowed
        # with a load the energy without its work is compared in the certificate
        spread = {"abs": allowed} if load is None else {"rel": 1e-6}
        assert found.energy[i] == pytest.approx(answer.energy, **spread)
        if answer.energy > 1e-6 * answer.energy_without_clearance:
            off = np.abs(wrenches[i] - answer.wrenches).max()
            limit = 3e-4 if load is None else 1e-4
            assert off <= limit * np.abs(answer.wrenches).max()


@pytest.mark.parametrize(
    ("seed", "load"), [*((k, None) for k in range(20)), *((k, LOAD) for k in range(6))]
)
def test_draws_of_random_robots_equal_single_solutions(seed, load):
    """Among them are rigid rows, limited joints and parts that stay open."""
    robot = random_robot(np.random.default_rng(seed))
    posture = place_robot(robot)
    draws = np.random.default_rng(seed + 100).normal(size=(4, len(robot.frames), 6))
    draws *= np.array([1e-3] * 3 + [1e-4] * 3)
    try:
        found = linear_response(posture, load).solve(draws)
    except ValueError:
        with pytest.raises(ValueError, match="motion"):
            solve_assembly(posture, load)
        return
    for i, own in enumerate(draws):
        try:
            erring = replace(posture, robot=robot.with_errors(own))
            answer = solve_assembly(erring, load)
        except (CannotAssemble, FreeMotion, SolverFailed):
            assert np.isnan(found.energy[i])
            continue
        allowed = 3e-8 * answer.energy + 3e-12 * answer.energy_without_clearance + 1e-20
        spread = {"abs": allowed} if load is None else {"rel": 1e-6, "abs": 1e-12}
        assert found.energy[i] == pytest.approx(answer.energy, **spread)
        assert found.duality_gap()[i] <= allowed


def test_errors_of_a_wrong_shape_are_refused():
    robot = load_robot("four_bar")
    posture = place_robot(robot)
    with pytest.raises(ValueError, match=r"expected \(k, 8, 6\)"):
        linear_response(posture).solve(np.zeros((3, 7, 6)))
    with pytest.raises(ValueError, match="all finite"):
        prepare_margins(posture).solve(np.full((1, 8, 6), np.nan))
