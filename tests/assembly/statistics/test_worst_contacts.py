"""Worst pose error of an over-constrained stage with clearances in guides."""

import pytest

from forcefit import worst_pose
from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.joint_names import joint_of
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.perfect_parts import perfect_parts
from tests.guided_stage_for_tests import STAGE

# [rad, m] Largest value and contribution of each joint, computed independently with
# cvxpy. A contribution is the derivative with respect to the logarithm of the
# clearance.
WORST = {
    "rotation": (1.34029e-3, {
        "clearance of x": 0.92274e-3, "clearance of y": 0.24606e-3,
        "profile of sole": 0.09187e-3, "clearance of foot": 0.07962e-3,
    }),
    "translation": (226.746e-6, {
        "clearance of x": 135.245e-6, "profile of sole": 42.605e-6,
        "clearance of foot": 36.924e-6, "clearance of y": 11.972e-6,
    }),
}  # fmt: skip


@pytest.fixture
def stage(tmp_path):
    path = tmp_path / "stage.toml"
    path.write_text(STAGE)
    return read_robot(path)


@pytest.mark.parametrize("quantity", WORST)
def test_contributions_to_a_rigid_worst_case_are_listed_by_joint(stage, quantity):
    found = worst_pose(
        linear_response(home_posture(stage)), sources_of(stage), quantity
    )
    value, parts = WORST[quantity]
    assert found.reading == "rigid"
    assert found.attained == pytest.approx(value, rel=1e-5)
    assert dict(found.shares) == pytest.approx(parts, rel=1e-3)
    assert sum(dict(found.shares).values()) == pytest.approx(value, rel=1e-3)


def test_every_contact_belongs_to_a_joint(stage):
    owners = {joint_of(stage, row) for row, f in enumerate(stage.frames) if f.clearance}
    assert owners == {"x", "y", "foot"}


def test_clearance_contributions_are_listed_by_joint(stage):
    reached = perfect_parts(Experiment(home_posture(stage), sources_of(stage)))
    parts = reached["rotation"]["clearances"]
    assert set(parts) <= {"x.clearance", "y.clearance", "foot.clearance"}
    assert sum(parts.values()) == pytest.approx(
        reached["rotation"]["reached"], rel=1e-3
    )
