"""Test functions that act along the thread of a helical joint.

The expected motion of the joint per radian is [0 0 1 0 0 h], where h is the lead.
"""

import numpy as np
import pytest

from forcefit.assembly.effects.robot_effects import apply_robot_effects
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.inputs.table import BadInput
from forcefit.validation.campaign.campaign_file import read_campaign
from forcefit.validation.diagnosis.diagnose import diagnose
from tests.campaigns_for_tests import table_rows, write_campaign

ARM, LEAD = 0.1, 1.0 / (2 * np.pi)  # [m, m/rad]
ROBOT = f"""
name = "press"
platform = "tool"
[[frame]]
name = "spindle"
parent = "base"
joint = "helical"
pitch = {2 * np.pi * LEAD}
actuated = true
[[frame]]
name = "tool"
parent = "spindle"
translation = [{ARM}, 0, 0]
"""
COMPONENTS = ("rx", "ry", "rz", "tx", "ty", "tz")


def deviation(q, turn):
    """Return the tool deviation (R, 6) for an additional rotation of the spindle."""
    zero = np.zeros_like(q)
    across = ARM * turn * np.array([-np.sin(q), np.cos(q)])
    return np.stack([zero, zero, turn, *across, LEAD * turn], axis=1)


def with_function(tmp_path, components, kind, variables, value, where="spindle"):
    file = tmp_path / "press.toml"
    file.write_text(
        f'{ROBOT}[[effect]]\nname = "function"\nwhere = "{where}"\nkind = "{kind}"\n'
        f'components = ["{components}"]\nvariables = ["{variables}"]\n'
        f'form = "powers"\nparameters = {{ "0" = {value} }}\n'
    )
    return read_robot(file)


@pytest.mark.slow  # diagnosis of 80 rows
def test_error_of_a_driven_screw_is_identified_along_its_thread(tmp_path):
    """The error has three periods in each turn."""
    rng = np.random.default_rng(3)
    q, size, noise = rng.uniform(-3, 3, 80), 3e-4, 1e-6
    measured = deviation(q, size * np.sin(3 * q)) + noise * rng.normal(size=(80, 6))
    head = ",".join(["id", "q.spindle", *(f"meas.{c}" for c in COMPONENTS)])
    rows = table_rows(np.column_stack([q, measured]))
    of_noise = f"[noise]\nrotation = {noise}\nposition = {noise}\n"
    folder = write_campaign(tmp_path, head, rows, ROBOT, noise=of_noise)
    found = diagnose(read_campaign(folder))
    (function,) = found.robot.functions
    assert (function.where, function.components) == ("spindle", ("rs",))
    assert function.variables == ("q.spindle",)
    assert function.parameters["3.sine"] == pytest.approx(size, rel=0.01)
    assert found.after.normalised < 1.3


@pytest.mark.parametrize(("kind", "value", "turn"), [
    ("screw", 2e-4, 2e-4), ("compliance", 1e-5, 1e-5 * (0.4 + LEAD * 25.0))
])  # fmt: skip
def test_function_along_a_thread_rotates_and_translates_the_tool(
    tmp_path, kind, value, turn
):
    """The generalised load of the joint is mz + h fz."""
    robot = with_function(tmp_path, "rs", kind, "q.spindle", value)
    posture = place_robot(robot, joints={"spindle": 0.7})
    load = np.array([0.0, 0.0, 0.4, 0.0, 0.0, 25.0])  # [N m, N] at the tool
    applied = apply_robot_effects(posture, load)
    found = solve_assembly(applied.posture, load).platform_screw
    (expected,) = deviation(np.array([0.7]), np.array([turn]))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-18)


def test_component_along_a_thread_requires_a_helical_joint(tmp_path):
    with pytest.raises(BadInput, match='components: found "rs"'):
        with_function(tmp_path, "rs", "screw", "q.spindle", 2e-4, where="tool")
