"""Tests of natural frequencies against Exudyn."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from forcefit.assembly.exchange.robot_files import load_robot
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, Robot
from forcefit.assembly.platform_stiffness.vibration import natural_modes
from forcefit.validation.multibody.simulation import simulated_frequencies
from tests.robots_for_tests import with_frames

pytestmark = pytest.mark.exudyn
ROOT = Path(__file__).parents[3]


def extrapolated(posture, count, elements):
    """Return frequencies from Exudyn, extrapolated to infinitely many beam elements."""
    coarse, fine = (
        simulated_frequencies(posture, count, n) for n in (elements, 2 * elements)
    )
    return (4 * fine - coarse) / 3


def in_pieces(posture, pieces):
    """Return the posture with every beam divided into elements."""
    robot = posture.robot
    links = {
        f.name: replace(f.link, pieces=pieces)
        for f in robot.frames if isinstance(f.link, BeamLink)
    }  # fmt: skip
    return replace(posture, robot=robot.with_links(links))


def test_frequencies_of_a_beam_with_tip_mass_agree_with_exudyn():
    """The six modes are bending modes, three in each plane."""
    link = BeamLink({"width": 0.02, "height": 0.03}, 70e9, 0.3, 2700.0)
    tip = Frame("tip", translation=[1.0, 0, 0], link=link, mass=0.2,
                centre_of_mass=[0.05, 0.0, 0.0])  # fmt: skip
    posture = home_posture(Robot("cantilever", "tip", (tip,)))
    ours = natural_modes(in_pieces(posture, 16), 6).frequencies
    np.testing.assert_allclose(ours, extrapolated(posture, 6, 16), rtol=1.5e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "orthoglide"])
def test_frequencies_of_robots_agree_with_exudyn(name):
    """The robots have closed loops of beams and joint springs."""
    posture = home_posture(load_robot(name))
    ours = natural_modes(in_pieces(posture, 4), 6).frequencies
    np.testing.assert_allclose(ours, extrapolated(posture, 6, 8), rtol=2e-3)


def with_inertias(robot, rng):
    """Return the robot with a random mass and inertia tensor on each frame."""

    def moments(frame):
        arm = 0.1 * rng.normal(size=3)
        return (arm @ arm + 1e-3) * np.eye(3) - np.outer(arm, arm)

    return with_frames(
        robot, bool, mass=lambda f: rng.uniform(1, 3),
        centre_of_mass=lambda f: 0.1 * rng.normal(size=3), inertia=moments,
    )  # fmt: skip


@pytest.mark.parametrize("moment", [0.0, 2e-4, 1e-2])
def test_frequencies_of_a_spherical_wrist_agree_with_exudyn(moment):
    """The three curved legs over-constrain the wrist."""
    robot = load_robot(ROOT / "examples" / "drawn" / "agile_eye.toml")
    J = moment * np.array([[1.0, 0.2, 0], [0.2, 0.9, -0.1], [0, -0.1, 0.8]])
    posture = home_posture(with_frames(robot, lambda f: f.name == "camera", inertia=J))
    ours = natural_modes(posture).frequencies
    np.testing.assert_allclose(ours, simulated_frequencies(posture), rtol=2e-8)


@pytest.mark.parametrize("name", ["exechon", "arm6"])
def test_frequencies_with_inertia_tensors_agree_with_exudyn(name):
    """Every frame has a mass, and beams are springs without mass."""
    path = Path(__file__).with_name("exechon.toml")
    robot = load_robot(path if name == "exechon" else name)
    robot = with_inertias(robot, np.random.default_rng(3))
    springs = {
        f.name: MatrixLink(np.linalg.inv(link_compliance(f)))
        for f in robot.frames if isinstance(f.link, BeamLink)
    }  # fmt: skip
    posture = home_posture(robot.with_links(springs))
    ours = natural_modes(posture).frequencies
    np.testing.assert_allclose(ours, simulated_frequencies(posture), rtol=2e-8)
