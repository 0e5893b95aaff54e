"""Natural frequencies against Exudyn's own linearised system."""

from dataclasses import replace

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.model.robot import BeamLink, Frame, Robot
from assembly.platform_stiffness.vibration import natural_modes
from assembly.robots import load_robot
from validation.multibody.simulation import simulated_frequencies

pytestmark = pytest.mark.exudyn


def extrapolated(posture, count, elements):
    """Errors of the simulation's beams fall with the square of their number."""
    coarse, fine = (
        simulated_frequencies(posture, count, n) for n in (elements, 2 * elements)
    )
    return (4 * fine - coarse) / 3


def in_pieces(posture, pieces):
    """Cut every beam into pieces."""
    robot = posture.robot
    links = {
        f.name: replace(f.link, pieces=pieces)
        for f in robot.frames if isinstance(f.link, BeamLink)
    }  # fmt: skip
    return replace(posture, robot=robot.with_links(links))


def test_frequencies_of_a_beam_with_a_tip_mass_agree_with_exudyns_beam_elements():
    """Bending in both planes, three modes each, the highest to 1e-4."""
    link = BeamLink({"width": 0.02, "height": 0.03}, 70e9, 0.3, 2700.0)
    tip = Frame("tip", translation=[1.0, 0, 0], link=link, mass=0.2,
                centre_of_mass=[0.05, 0.0, 0.0])  # fmt: skip
    posture = home_posture(Robot("cantilever", "tip", (tip,)))
    ours = natural_modes(in_pieces(posture, 16), 6).frequencies
    np.testing.assert_allclose(ours, extrapolated(posture, 6, 16), rtol=1.5e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four_bar", "orthoglide"])
def test_frequencies_of_robots_agree_with_the_simulation(name):
    """Closed loops of beams and joint springs, six modes."""
    posture = home_posture(load_robot(name))
    ours = natural_modes(in_pieces(posture, 4), 6).frequencies
    np.testing.assert_allclose(ours, extrapolated(posture, 6, 8), rtol=2e-3)
