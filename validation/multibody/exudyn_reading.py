"""Evaluate a solved Exudyn model: poses, energies and wrenches."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.multibody.contact import cone_energy
from forcefit.validation.multibody.exudyn_model import Model
from forcefit.validation.multibody.exudyn_parts import (
    Closure,
    Contact,
    Elastic,
    Modes,
    Place,
)
from forcefit.validation.multibody.motion import inverse, logarithm, matrix


def pose(model: Model, place: Place) -> NDArray:
    """Return the current pose of a body frame in the base frame, (4, 4)."""
    read, kind = model.mbs.GetObjectOutputBody, model.exu.OutputVariableType
    R = np.reshape(read(place.body, kind.RotationMatrix), (3, 3))
    return matrix(R, read(place.body, kind.Position)) @ place.local


def closure_error(model: Model, closure: Closure) -> NDArray:
    """Return the closure error, the screw from closed to current position, (6,)."""
    first = pose(model, closure.first) @ closure.closed
    return logarithm(inverse(first) @ pose(model, closure.second))


def screw_between(model: Model, part: Elastic | Contact) -> NDArray:
    """Return the logarithm of the motion from near to far frame, (6,) [rad, m]."""
    return logarithm(inverse(pose(model, part.near)) @ pose(model, part.far))


def idle_motions(model: Model, idle: Mapping[str, Elastic]) -> NDArray:
    """Return the displacements of joints without stiffness, (j,) [rad or m]."""
    axes = zip(idle.values(), model.idle, strict=True)
    return np.array([screw_between(model, part)[axis] for part, (_, axis) in axes])


def energy(model: Model, part: Elastic) -> float:
    """Return the energy [J] of an elastic body."""
    if part.modes is not None:
        q = _mode_coordinates(model, part.modes)
        return float(q @ part.modes.stiffness @ q) / 2
    kind, mbs = model.exu.OutputVariableType.PotentialEnergy, model.mbs
    read = mbs.GetObjectOutputBody if part.beam else mbs.GetObjectOutput
    return float(sum(read(number, kind) for number in part.parts))


def contact_energy(model: Model, contact: Contact) -> float:
    """Return the energy [J] of an elastic contact."""
    screw = screw_between(model, contact).tolist()
    return sum(
        cone_energy(cone, screw, model.width) for cone in contact.clearance.cones
    )


def wrench(model: Model, part: Elastic) -> NDArray:
    """Return the wrench on the outer body at the far frame, in its axes, (6,)."""
    if part.modes is not None:
        near, far = (pose(model, p)[:3, :3] for p in (part.near, part.far))
        halves = part.modes.wrench @ _mode_coordinates(model, part.modes)
        return np.concatenate([far.T @ near @ half for half in np.split(halves, 2)])
    if not part.beam:
        return connector_wrench(model, part.parts[0])
    last = model.exu.ObjectIndex(part.parts[-1])
    force = model.mbs.ComputeItem(last, model.exu.ComputeItemType.ODE2LHS)[7:]
    total = model.exu.OutputVariableType.CoordinatesTotal
    a, b, c, d = model.mbs.GetNodeOutput(model.node(part.far), total)[3:7]
    # The generalised forces of Euler parameters are G^T times the moment, and G G^T is
    # 4 times the identity matrix.
    G = 2 * np.array([[-b, a, -d, c], [-c, d, a, -b], [-d, -c, b, a]])
    R = pose(model, part.far)[:3, :3]
    return np.concatenate([R.T @ G @ force[3:] / 4, R.T @ force[:3]])


def closure_wrench(model: Model, closure: Closure, point: NDArray) -> NDArray:
    """Return the wrench on the first chain about a point, base axes, (6,) [N m, N]."""
    T = pose(model, closure.second)
    own = connector_wrench(model, closure.connector).reshape(2, 3)
    moment, force = (T[:3, :3] @ half for half in own)
    return np.concatenate([moment + np.cross(T[:3, 3] - point, force), force])


def connector_wrench(model: Model, number: int) -> NDArray:
    """Return K times the displacement of a connector's outer end, (6,) [N m, N]."""
    kind, read = model.exu.OutputVariableType, model.mbs.GetObjectOutput
    return np.concatenate([
        read(number, kind.TorqueLocal),
        read(number, kind.ForceLocal),
    ])


def _mode_coordinates(model: Model, modes: Modes) -> NDArray:
    """Return the mode coordinates of a meshed body, (6,)."""
    kind = model.exu.OutputVariableType.Coordinates
    return np.array(model.mbs.GetNodeOutput(modes.node, kind))
