"""Tests of assembly steps for a robot file of format 2 (bodies and joints).

A plate on the elastic joint ``foot`` is joined to a second joint ``peg``.
"""

import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.files.step_file import read_steps
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.steps.run import assemble_in_steps

PLATE = """
format = 2
platform = "plate"
platform_at = [0.1, 0.2, 0.3]
body = [{ name = "plate" }]
joint = [
    { name = "foot", type = "fixed", between = ["base", "plate"], at = [0, 0, 0], joint_stiffness = [inf, 2e3, inf, 1e6, 2e6, 3e6] },
    { name = "peg", between = ["base", "plate"], PEG },
]
"""  # noqa: E501
SLOTTED = (
    'type = "fixed", at = [0, 0, 0.05], axis = [1, 0, 0], axis2 = [0, 1, 0], '
    "geometric_error = [0, 0, 0, 10e-6, 20e-6, 40e-6]"
)
BALL = 'type = "spherical", at = [0.4, 0, 0], geometric_error = [0, 0, 0, 0, 0, 30e-6]'
JOIN = '[[step]]\njoin = ["peg", "plate"]\n'


@pytest.fixture
def joined(tmp_path):
    def run(joint, plan):
        (tmp_path / "robot.toml").write_text(PLATE.replace("PEG", joint))
        (tmp_path / "plan.toml").write_text(plan)
        robot = read_robot(tmp_path / "robot.toml")
        plan = read_steps(tmp_path / "plan.toml", robot)
        return assemble_in_steps(plan, home_posture(robot))[-1]

    return run


def test_slotted_hole_does_not_constrain_motion_along_joint_axis(joined):
    """The joint axis is the x axis of the base.

    The energy for the errors along y and z is (ky y^2 + kz z^2) / 2.
    """
    step = joined(SLOTTED, JOIN + 'locked = ["tz"]\n')
    assert step.energy == pytest.approx((2e6 * 10e-6**2 + 3e6 * 20e-6**2) / 2)
    assert step.platform_screw[0, 3:] == pytest.approx([0, 10e-6, 20e-6], abs=1e-12)


def test_closing_wrench_of_ball_joint_is_a_pure_force(joined):
    """The closing force is d / (1/kz + r^2/k_ry), and the moment is zero."""
    step = joined(BALL, JOIN)
    force = 30e-6 / (1 / 3e6 + 0.4**2 / 2e3)
    assert step.closing_force == pytest.approx(force)
    assert step.closing_wrench[0, :3] == pytest.approx([0, 0, 0], abs=1e-9 * force)
