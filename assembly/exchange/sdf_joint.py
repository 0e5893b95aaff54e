"""Conversion of SDF joints, including those in ``<gazebo>`` elements of a URDF.

Sources:
    sdformat.org, specification 1.12, ``<joint>``.  An axis is in the model frame until
    version 1.4, with ``use_parent_model_frame`` until version 1.6, and with
    ``expressed_in`` in later versions.

    gazebosim/sdformat, pull request 1168.  ``screw_thread_pitch`` [m per turn] is
    positive for a right-hand thread.  The older ``thread_pitch`` [rad/m] is positive
    for a left-hand thread.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.coupling import Coupling
from forcefit.assembly.exchange.mechanism import (
    Body,
    Joint,
    ball,
    chain,
)
from forcefit.assembly.exchange.orientation import onto
from forcefit.assembly.exchange.sdf_frames import MODEL, Frames, Named, word
from forcefit.assembly.exchange.xml_file import Node
from forcefit.assembly.files.joint_file import LARGEST_PITCH, LEAST_PITCH
from forcefit.inputs.errors import quoted

_KINDS = ("fixed", "revolute", "continuous", "prismatic", "ball", "universal",
          "revolute2", "screw")  # fmt: skip
_Z = (0.0, 0.0, 1.0)


def joint_ends(frames: Frames, named: Named) -> tuple[str, str]:
    """Return the parent and child links of a joint.

    Args:
        frames: frames of the model.
        named: element of the joint.

    Returns:
        Names of two different links; ``"world"`` for the world.

    Raises:
        BadInput: a name does not exist in the model, or both links are the same.
    """
    node = named.node
    ends = [
        frames.link(frames.name(word(node, tag), named.scope, node, tag))
        for tag in ("parent", "child")
    ]
    if ends[0] == ends[1]:
        raise node.bad(
            "child", f"found {quoted(ends[1])}, which is also its parent; expected "
            "a different link"
        )  # fmt: skip
    return ends[0], ends[1]


def joint_parts(
    frames: Frames, name: str, named: Named, ends: tuple[str, str], carried: str,
    backwards: bool = False,
) -> tuple[list[Joint], list[Body]]:  # fmt: skip
    """Return the elementary joints of a joint, one for each degree of freedom.

    Args:
        frames: frames of the model.
        name: name of the joint.
        named: element of the joint.
        ends: names of the parent and child links.
        carried: name of the child body in the mechanism.
        backwards: whether the child precedes the parent in the tree, so that the joint
            is reversed.

    Returns:
        The joints and the bodies between them.

    Raises:
        BadInput: the joint has an unknown type, or an axis has zero length.
    """
    node = named.node
    kind = node.choice("type", _KINDS, "")
    at = frames.pose(name)
    axes = [_axis(frames, named, tag, at) for tag in ("axis", "axis2")]
    freedoms = {
        "fixed": [("", "fixed", np.array(_Z))],
        "prismatic": [("", "prismatic", axes[0])],
        "ball": ball(),
        "screw": [("", "helical", axes[0])],
        "universal": [("first", "revolute", axes[0]), ("second", "revolute", axes[1])],
    }  # fmt: skip
    freedoms["revolute2"] = freedoms["universal"]
    parts = freedoms.get(kind, [("", "revolute", axes[0])])
    if kind in {"universal", "revolute2"} and node.child("axis2") is None:
        parts[1] = ("second", "revolute", onto(axes[0])[:, 1])
    parent, child = ends
    if backwards:
        parent, child = child, parent
        parts = [(part, one, -axis) for part, one, axis in reversed(parts)]
    placement = np.linalg.inv(frames.pose(parent)) @ at
    after = np.linalg.inv(at) @ frames.pose(child)
    if len(parts) == 1:
        ((_, one, axis),) = parts
        joint = Joint(name, one, parent, carried, placement, axis, after)
        if kind == "screw":  # the unit of the range of a screw joint is undefined
            return [replace(joint, lead=_lead(node))], []
        return [joint if one == "fixed" else _of_axis(joint, node, "axis")], []
    joints, between = chain(name, parent, carried, placement, after, parts)
    # the rotations of a ball joint do not have a range or a spring
    tags = {"first": "axis", "second": "axis2"}
    known = [tags.get(part, "") for part, _, _ in parts]
    return [_of_axis(j, node, t) for j, t in zip(joints, known, strict=True)], between


def _lead(node: Node) -> float:
    """Return the lead [m/rad] of a screw joint, positive for a right-hand thread."""
    pitch, old = node.child("screw_thread_pitch"), node.child("thread_pitch")
    if pitch is None and old is None:
        raise node.bad(
            "screw_thread_pitch", "missing; expected a number [m per turn], > 0 for a "
            "right-hand thread"
        )  # fmt: skip
    given = pitch if pitch is not None else old
    assert given is not None
    value = given.number("", "m" if given is pitch else "rad/m")
    lead = 0.0
    if value != 0.0:
        lead = value / (2 * np.pi) if given is pitch else -1.0 / value
    if not LEAST_PITCH <= 2 * np.pi * abs(lead) <= LARGEST_PITCH:
        raise given.bad(
            "", f"found {value:g}, expected a thread of {LEAST_PITCH:g} to "
            f"{LARGEST_PITCH:g} m per turn"
        )  # fmt: skip
    return lead


def _of_axis(joint: Joint, node: Node, tag: str) -> Joint:
    """Add the range and the spring of an axis to a joint."""
    axis = node.child(tag)
    if axis is None:
        return joint
    limit, dynamics = axis.child("limit"), axis.child("dynamics")
    if limit is not None:
        ends = [limit.child(end) for end in ("lower", "upper")]
        lower, upper = (None if end is None else end.content for end in ends)
        joint = replace(joint, limits=limit.limits(lower, upper))
    if dynamics is not None:
        joint = replace(
            joint,
            stiffness=_number(dynamics, "spring_stiffness", 0.0),
            rest=_number(dynamics, "spring_reference", 0.0),
        )
    return joint


def _axis(frames: Frames, named: Named, tag: str, at: NDArray) -> NDArray:
    """Return the direction of an axis in the joint frame, (3,)."""
    axis = named.node.child(tag)
    if axis is None:
        return np.array(_Z)
    xyz, in_model = axis.child("xyz"), axis.child("use_parent_model_frame")
    seen_from = "" if xyz is None else xyz.optional("expressed_in")
    if (
        in_model is None
        and named.old
        or in_model
        and in_model.content.lower() in {"1", "true"}
    ):
        seen_from = seen_from or MODEL
    vector = np.array(_Z) if xyz is None or not xyz.content else xyz.unit_vector("")
    if not seen_from:
        return vector
    full = frames.name(seen_from, named.scope, axis, "expressed_in")
    return np.asarray(at[:3, :3].T @ frames.pose(full)[:3, :3] @ vector)


def joint_couplings(
    frames: Frames, name: str, named: Named, parts: dict[str, list[str]]
) -> list[Coupling]:
    """Return the couplings that ``<mimic>`` defines for the axes of a joint.

    Args:
        frames: frames of the model.
        name: name of the joint.
        named: element of the joint.
        parts: names of the elementary joints, by the name of the joint.

    Returns:
        A coupling for each axis that follows another axis.

    Raises:
        BadInput: the joint follows a joint or an axis that does not exist.
    """
    couplings = []
    for tag in ("axis", "axis2"):
        axis = named.node.child(tag)
        mimic = None if axis is None else axis.child("mimic")
        if mimic is None:
            continue
        leader = frames.name(mimic.text("joint"), named.scope, mimic, "joint")
        if leader not in parts:
            raise mimic.bad("joint", f"found {quoted(leader)}, expected a joint")
        rule = [_number(mimic, key, value) for key, value in
                (("offset", 0.0), ("multiplier", 1.0), ("reference", 0.0))]  # fmt: skip
        couplings.append(
            Coupling(
                _part(mimic, parts[name], tag),
                _part(mimic, parts[leader], mimic.optional("axis") or "axis"),
                (rule[0], rule[1]), leader_rest=rule[2],
            )
        )  # fmt: skip
    return couplings


def _part(mimic: Node, parts: list[str], tag: str) -> str:
    """Return the name of the elementary joint for an axis of a joint."""
    if len(parts) == 1 and tag == "axis":
        return parts[0]
    ends = {"axis": ".first", "axis2": ".second"}.get(tag, "?")
    for part in parts:
        if part.endswith(ends):
            return part
    raise mimic.bad(
        "axis", f"found {quoted(tag)}, expected an axis of {quoted(parts[0])}"
    )


def _number(node: Node, key: str, default: float) -> float:
    """Return the number in an inner element, or a default value."""
    inner = node.child(key)
    return default if inner is None else inner.number("", "-")
