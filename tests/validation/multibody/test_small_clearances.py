"""Tests of the simulation of clearances of a few micrometres under load."""

from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.files.robot_file import read_robot
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.linear.energy import solve_assembly
from forcefit.validation.crosscheck.pair import scaled
from forcefit.validation.multibody.simulation import SimulationModel, simulate_assembly

EXECHON = Path(__file__).with_name("exechon.toml")
pytestmark = [pytest.mark.slow, pytest.mark.exudyn]


def simulated(pose, scale):
    """Return the simulation and the linear solution at a scale of all imperfections."""
    posture = place_robot(read_robot(EXECHON), pose=pose)
    load = scale * np.array([0, 0, 0, 0, 0, -200.0])
    found = simulate_assembly(
        posture, scale, SimulationModel(clearances=True), load=load, time_limit=120
    )
    return found, solve_assembly(scaled(posture, scale), load)


@pytest.mark.parametrize("scale", [0.25, 0.125])
def test_energy_with_small_clearances_agrees_with_linear_model(scale):
    """The Exechon is overconstrained twice and has clearances of 2 and 1 um."""
    found, linear = simulated({"tz": 0.8, "rx": 0.32, "ry": 0.22}, scale)
    assert found.rigid_energy == pytest.approx(linear.energy, rel=0.01)
    assert found.gap < 1e-11


def test_contact_energy_is_small_at_every_scale():
    """Load, errors and clearances are multiplied by the same scale."""
    for scale in (1.0, 0.5, 0.125):
        found, _ = simulated({"tz": 0.7714, "rx": 0.3964, "ry": 0.2341}, scale)
        assert found.contact_energy < 5e-3 * found.energy
