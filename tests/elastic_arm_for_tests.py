"""Serial arm with three elastic drives and tubular links, and its campaign."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from tests.campaigns_for_tests import campaign_at
from tests.planar_arm_for_tests import SIGMA

SPRING = np.diag([np.inf, np.inf, 5e4, np.inf, np.inf, np.inf])
TUBE = BeamLink({"radius": 0.03, "inner_radius": 0.025}, 70e9, 0.33, density=2700.0)
DRIVES = ("j1", "j2", "j3")


def arm(link=TUBE, **effects):
    """Return an arm whose consecutive drive axes are not parallel."""
    turning = {"joint": "revolute", "actuated": True, "joint_stiffness": SPRING}
    robot = Robot("arm", "tool", (
        Frame("j1", **turning),
        Frame("j2", "j1", [0.1, 0, 0.3], [np.pi / 2, 0, 0.3], link=link, **turning),
        Frame("j3", "j2", [0.35, 0.1, 0], [0, np.pi / 3, 0], link=link, **turning),
        Frame("tool", "j3", [0.3, 0.05, 0.1], link=link, mass=0.8),
    ))  # fmt: skip
    return replace(robot, effects=effects)


def with_errors(robot, wider=1.0):
    """Return the robot with random errors of up to 0.1 mrad and 50 um per frame."""
    drawn = np.random.default_rng(1).uniform(-1, 1, (len(robot.frames), 6))
    return robot.with_errors(drawn * np.repeat([1e-4, 5e-5], 3) * wider)


def commanded(robot, rows=12, seed=2, reach=1.5):
    """Return a campaign with random postures and loads; all readings are zero."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-reach, reach, (rows, 3))
    bare = robot.without_effects().with_errors(np.zeros((4, 6)))
    placed = [
        place_robot(bare, joints=dict(zip(DRIVES, row, strict=True))) for row in q
    ]
    loads = rng.normal(size=(rows, 6)) * np.repeat([2.0, 30.0], 3)
    return campaign_at(
        robot, placed, np.zeros((rows, 6)), SIGMA, loads=loads,
        covariates={"temperature": np.linspace(1, 8, rows),
                    "time": 60.0 * np.arange(rows),
                    "approach": rng.choice([-1.0, 1.0], rows)},
        reference_point=np.array([0.02, 0.05, 0.03]),
    )  # fmt: skip
