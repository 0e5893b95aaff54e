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
    """Return the link model of a simulation: spring stiffnesses and solids.

    Args:
        robot: robot of the virtual-joint model.
        kind: ``"beam"``: beams are beams and other links are springs.  ``"spring"``:
            all links are springs.  ``"fem"``: meshed links are solids; other links are
            modelled as for ``"beam"``.

    Returns:
        The model, in which joints have no clearance.

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
        links: ``"spring"`` for all links; for any other kind, beams are omitted.

    Returns:
        Mapping from the frame's name to K_E, (6, 6) [N m/rad .. N/m] in its axes.
    """
    return {
        frame.name: link_stiffness(frame)
        for frame in robot.frames
        if frame.link is not None
        and (links == "spring" or not isinstance(frame.link, BeamLink))
    }


def link_stiffness(frame: Frame) -> NDArray:
    """Return K_E (6, 6) [N m/rad .. N/m] of a frame's link."""
    return np.linalg.inv(link_compliance(frame))
