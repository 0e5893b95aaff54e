"""Tests of the simulation of a stage on guides with errors within its clearances."""

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.validation.multibody.simulation import (
    SimulationFailed,
    SimulationModel,
    simulate_assembly,
)
from tests.guided_stage_for_tests import STAGE

pytestmark = [pytest.mark.exudyn, pytest.mark.slow]
CLEARANCES = SimulationModel(clearances=True)


@pytest.fixture
def stages(tmp_path, rng):
    """Return three stages with errors of about 0.03 mrad and 3 um on every frame."""
    path = tmp_path / "stage.toml"
    path.write_text(STAGE)
    robot = read_robot(path)
    parts = np.array([frame.clearance is None for frame in robot.frames])
    sizes = np.array([3e-5] * 3 + [3e-6] * 3) * parts[:, None]
    draws = rng.normal(size=(3, *sizes.shape)) * sizes
    return [home_posture(robot.with_errors(errors)) for errors in draws]


def test_loaded_stage_agrees_with_the_linear_model(stages):
    """Elastic contacts and finite rotations change the clearances by about 1e-3."""
    load = [0, 0, 0, 60.0, 50.0, -100.0]
    for stage in stages:
        expected = solve_assembly(stage, load)
        found = simulate_assembly(stage, model=CLEARANCES, load=load)
        work = expected.platform_screw @ load
        assert found.platform_screw @ load == pytest.approx(work, rel=5e-3)


def test_failure_without_a_load_reports_undetermined_positions(stages):
    failures = []
    for stage in stages:
        try:
            found = simulate_assembly(stage, model=CLEARANCES)
        except SimulationFailed as error:
            failures.append(str(error))
        else:  # clearances take up the errors of the guided stage without energy
            assert found.rigid_energy < 1e-6
    for message in failures:
        assert "no equilibrium" in message
        assert "expected a load that presses the joints" in message
        assert "\n" not in message
