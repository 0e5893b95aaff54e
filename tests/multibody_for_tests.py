"""Robots of one or two beams for tests of the multibody simulation."""

import numpy as np

from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.validation.multibody.simulation import simulate_assembly

E, NU = 60e9, 0.3
ROUND = BeamLink({"radius": 0.04}, E, NU)
FLAT = BeamLink({"width": 0.02, "height": 0.05}, E, NU)
# scale that makes rotations and translations of a 0.4 m long beam comparable
UNIT = np.array([1, 1, 1, 0.4, 0.4, 0.4])


def coaxial(error, length=0.4):
    """Return two equal coaxial beams that an error separates at their common end."""
    frames = (
        Frame("a", translation=[length, 0, 0], link=ROUND, geometric_error=error),
        Frame("wall", translation=[2 * length, 0, 0]),
        Frame("b", "wall", translation=[-length, 0, 0], link=ROUND),
    )
    return home_posture(Robot("coaxial", "a", frames, (("a", "b"),)))


def block():
    """A rigid bar of 1 m that is closed with a gap of 0.1 mm, so it cannot assemble."""
    frames = (
        Frame("a", translation=[1, 0, 0]),
        Frame("b", translation=[1, 0, 0], geometric_error=[0, 0, 0, 1e-4, 0, 0]),
    )
    return home_posture(Robot("block", "a", frames, (("a", "b"),)))


def random_stiffness(rng, soft=1e3):
    """Return a random stiffness that is well conditioned after scaling by ``UNIT``."""
    A = rng.normal(size=(6, 6))
    return soft * (A @ A.T + np.eye(6)) * np.outer(UNIT, UNIT) / UNIT[3] ** 2


def tip_stiffness(frame):
    """Return K_E of the beam of a frame, computed by applying unit loads."""
    alone = Frame("f", translation=frame.translation, link=frame.link)
    posture = home_posture(Robot("one", "f", (alone,)))
    rows = [
        simulate_assembly(posture, load=1e-3 * unit).link_screws[0] / 1e-3
        for unit in np.eye(6)
    ]
    C = np.array(rows)
    return np.linalg.inv((C + C.T) / 2)
