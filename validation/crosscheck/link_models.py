"""Select whether a simulation models links as beams, springs or solids."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.links import link_compliance
from forcefit.assembly.model.robot import BeamLink, Frame, Robot
from forcefit.inputs.table import BadInput
from forcefit.validation.crosscheck.solids import mesh_bodies
from forcefit.validation.multibody.simulation import SimulationModel

KINDS = ("beam", "spring", "fem")


def link_models(robot: Robot, kind: str) -> SimulationModel:
    """Return the simulation model of a robot's links.

    Args:
        robot: robot of the virtual-joint model.
        kind: ``"beam"``: links with a cross-section are beams, and other links are
            springs.  ``"spring"``: all links are springs.  ``"fem"``: meshed links are
            solids, and other links are modelled as for ``"beam"``.

    Returns:
        The model.  Its joints have no clearance.

    Raises:
        BadInput: the kind is unknown, or a mesh cannot be used.
    """
    if kind not in KINDS:
        raise BadInput(f"links: found {kind!r}, expected one of {', '.join(KINDS)}")
    meshes = mesh_bodies(robot) if kind == "fem" else {}
    stiffness = {
        name: K
        for name, K in link_stiffnesses(robot, kind).items()
        if name not in meshes
    }
    return SimulationModel("spring" if kind == "spring" else "beam", stiffness, meshes)


def link_stiffnesses(robot: Robot, links: str) -> Mapping[str, NDArray]:
    """Return K_E of the links that a simulation models as springs.

    Args:
        robot: robot of the virtual-joint model.
        links: kind of link model.  If it is not ``"spring"``, beams are omitted.

    Returns:
        Mapping from frame to K_E in the axes of the frame, (6, 6) [N m/rad .. N/m].
    """
    return {
        frame.name: link_stiffness(frame)
        for frame in robot.frames
        if frame.link is not None
        and (links == "spring" or not isinstance(frame.link, BeamLink))
    }


def link_stiffness(frame: Frame) -> NDArray:
    """Return K_E of a frame's link, (6, 6) [N m/rad .. N/m]."""
    return np.linalg.inv(link_compliance(frame))
