"""Measure the time of stepwise assembly of 100 000 robots with clearances on one core.

Run ``python -m benchmarks.steps_speed``.  Two built-in robots have random errors of 50
um and 0.1 mrad.  A fixture holds the platform, the five closures are joined one after
another, and the fixture is released.  The program prints processor times.
"""

import time

import numpy as np
from threadpoolctl import threadpool_limits

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.report.steps import drawn_steps
from forcefit.assembly.robots import load_robot
from forcefit.assembly.steps.plan import Fix, Join, Plan, Release
from forcefit.stiffness.screws import SCREW

ROBOTS, MACHINES = ("hexapod", "delta"), 100_000
SPREAD = np.repeat([1e-4, 5e-5], 3)  # [rad, m] standard deviation of the errors


def plan_of(robot: Robot) -> Plan:
    """Return a plan that fixes the platform, joins all closures and releases it."""
    fixture = Fix("fixture", robot.platform, dict.fromkeys(SCREW, 0.0))
    joins = [Join(f"join {i}", part) for i, part in enumerate(robot.closures, 1)]
    return Plan((fixture, *joins, Release("release", ("fixture",))))


def main() -> None:
    """Print a row of the table for each robot."""
    print("robot     frames  steps  total [s]   per robot and step [us]")
    for name in ROBOTS:
        robot = load_robot(name)
        plan = plan_of(robot)
        posture = home_posture(robot)
        rng = np.random.default_rng(1)
        shape = (MACHINES, len(robot.frames), 6)
        errors = rng.normal(size=shape) * SPREAD
        start = time.process_time()
        drawn_steps(plan, posture, errors)
        spent, steps = time.process_time() - start, len(plan.steps)
        each = spent / MACHINES / steps * 1e6
        print(f"{name:10}{len(robot.frames):7}{steps:7}{spent:9.1f}{each:23.1f}")


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
