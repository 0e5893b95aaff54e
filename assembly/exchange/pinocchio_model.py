"""Import of a Pinocchio model in memory: ``pinocchio.Model``.

The model is converted to MJCF text, which is then read like a file.  The model is a
tree, because Pinocchio stores loops in separate objects, which are not read.  All
joints with one degree of freedom are assumed to be driven.

Sources:
    Pinocchio documentation, Model and JointModel.  Motion subspaces begin with the
    translation.  A link on a fixed joint is assigned to the preceding joint.
"""

from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from forcefit.assembly.exchange.mujoco_model import words
from forcefit.assembly.exchange.orientation import to_quaternion
from forcefit.inputs.errors import BadInput, quoted

_SEVERAL = {"JointModelSpherical": "ball", "JointModelFreeFlyer": "free"}
ASSUMED = "every joint with one degree of freedom as a drive"
_LARGEST = 1e6  # [rad, m] larger limits are ignored


def is_pinocchio(model: object) -> bool:
    """Return whether an object is a Pinocchio model."""
    kind = type(model)
    return kind.__module__.startswith("pinocchio") and kind.__name__ == "Model"


def mjcf_of_pinocchio(model: Any) -> str:
    """Convert a model to the text of an MJCF file.

    Args:
        model: ``pinocchio.Model``.

    Returns:
        The text.  A body has the name of its body frame or, without one, the name of
        its joint with a suffix.

    Raises:
        BadInput: MJCF has no equivalent joint type.
    """
    root = Element("mujoco", model=model.name or "pinocchio model")
    SubElement(root, "compiler", angle="radian")
    bodies = [SubElement(root, "worldbody")]
    drives = SubElement(root, "actuator")
    for i in range(1, model.njoints):
        above, name = bodies[model.parents[i]], model.names[i]
        frames = [f for f in model.frames if f.parentJoint == i and _is_body(f)]
        own = next((f for f in frames if f.placement.isIdentity(1e-12)), None)
        body = SubElement(
            above, "body", _pose(model.jointPlacements[i]),
            name=f"{name}.body" if own is None else own.name,
        )  # fmt: skip
        bodies.append(body)
        _add_mass(body, model.inertias[i])
        if _add_joint(model, body, i):
            SubElement(drives, "general", name=name, joint=name)
        for frame in frames:
            if frame is not own:  # a link that is connected by a fixed joint
                SubElement(body, "body", _pose(frame.placement), name=frame.name)
    return tostring(root, encoding="unicode")


def _is_body(frame: Any) -> bool:
    """Return whether a frame belongs to a body."""
    return str(frame.type).rpartition(".")[2] == "BODY"


def _pose(placement: Any) -> dict[str, str]:
    """Return a placement as the attributes of an MJCF element."""
    quaternion = to_quaternion(np.array(placement.rotation))
    return {"pos": words(placement.translation), "quat": words(quaternion)}


def _add_mass(body: Element, inertia: Any) -> None:
    """Add the mass and inertia of a body to its element."""
    if inertia.mass:
        J = np.array(inertia.inertia)
        six = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
        SubElement(body, "inertial", pos=words(inertia.lever), mass=words(inertia.mass),
                   fullinertia=words(six))  # fmt: skip


def _add_joint(model: Any, body: Element, i: int) -> bool:
    """Add a joint to its body, and return whether it has one degree of freedom."""
    joint, name = model.joints[i], model.names[i]
    several = _SEVERAL.get(joint.shortname())
    if several == "free":
        SubElement(body, "freejoint", name=name)
        return False
    if several is not None:
        SubElement(body, "joint", name=name, type=several)
        return False
    data = joint.createData()
    q = np.zeros(model.nq)
    # the coordinates of an unlimited revolute joint are cosine and sine
    q[joint.idx_q] = 1.0 if joint.nq > joint.nv else 0.0
    joint.calc(data, q)
    S = np.reshape(data.S, (6, -1))
    turns, slides = np.any(S[3:]), np.any(S[:3])
    if joint.nv != 1 or turns == slides:
        kind = joint.shortname()
        raise BadInput(
            f"Model: joint {quoted(name)}: found a {kind}, expected a revolute, "
            "prismatic, spherical or free joint"
        )
    given = {"name": name, "type": "hinge" if turns else "slide",
             "axis": words(S[3:] if turns else S[:3])}  # fmt: skip
    if joint.nq == 1:
        ends = [float(limits[joint.idx_q]) for limits in (
            model.lowerPositionLimit, model.upperPositionLimit,
        )]  # fmt: skip
        if max(map(abs, ends)) < _LARGEST and ends[0] < ends[1]:
            given |= {"limited": "true", "range": words(ends)}
    SubElement(body, "joint", given)
    return True
