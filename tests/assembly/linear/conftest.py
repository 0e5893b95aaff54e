"""The paper's robot at the poses of its workspace."""

import numpy as np
import pytest

from assembly.kinematics.posture import place_many
from tests.robots_for_tests import NUMBERS, irsbot2_with


@pytest.fixture(scope="module")
def grid():
    """The paper's robot with the first draw, at 45 poses of its workspace."""
    robot = irsbot2_with(NUMBERS["cases"][0])
    poses = np.full((45, 6), np.nan)
    mesh = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.6, -0.2, 5))
    poses[:, 0], poses[:, 2] = (axis.ravel() for axis in mesh)
    postures = [p for p in place_many(robot, poses)[0] if p is not None]
    assert len(postures) == 43
    return robot, postures
