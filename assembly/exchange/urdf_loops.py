"""Loops in a URDF, which are defined by ``<loop_joint>`` or joints in ``<gazebo>``.

Sources:
    Isaac Sim, URDF importer, and Drake before 2018.  A ``loop_joint`` connects a frame
    on ``link1`` to a frame on ``link2``.

    Gazebo.  The content of ``<gazebo>`` is SDF in the frame of the root link.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.mechanism import (
    HERE,
    WORLD,
    Body,
    Joint,
    Loop,
    Mechanism,
    body_poses,
    chain,
)
from forcefit.assembly.exchange.sdf_frames import MODEL, Frames, Named
from forcefit.assembly.exchange.sdf_joint import joint_ends, joint_parts
from forcefit.assembly.exchange.urdf_joint import joint_freedoms, pose_of
from forcefit.assembly.exchange.xml_file import Node
from forcefit.inputs.errors import nearest, quoted

Closing = tuple[str, list[Joint], list[Body], Loop]


def with_closing_joints(
    mechanism: Mechanism, root: Node, parts: dict[str, list[str]]
) -> Mechanism:
    """Add the loops in a URDF to its mechanism.

    Args:
        mechanism: mechanism of the links and joints in the file.
        root: root element of the file.
        parts: names of the elementary joints, by the name of the joint.  The joints
            that close loops are added.

    Returns:
        The mechanism with its loops.

    Raises:
        BadInput: a joint refers to a link that does not exist, or twice to one link.
    """
    bodies, joints = dict(mechanism.bodies), list(mechanism.joints)
    loops = list(mechanism.loops)
    for node, (name, several, between, loop) in _closing(mechanism, root):
        if name in parts or any(name == one.name for one in loops):
            raise node.bad("name", "found this name twice; expected unique names")
        if several:  # a ball joint in a loop does not have coordinates
            parts[name] = [joint.name for joint in several]
        joints += several
        bodies |= {body.name: body for body in between}
        loops.append(loop)
    return replace(mechanism, bodies=bodies, joints=tuple(joints), loops=tuple(loops))


def _closing(mechanism: Mechanism, root: Node) -> Iterator[tuple[Node, Closing]]:
    """Yield the joints that close loops, together with their elements."""
    for node in root.children():
        if node.tag.split(":")[-1] == "loop_joint":
            yield node, _loop_joint(mechanism, node)
    in_gazebo = [n for g in root.children("gazebo") for n in g.children("joint")]
    if not in_gazebo:
        return
    poses = body_poses(mechanism, np.zeros(len(mechanism.joints)))
    frames = Frames(root, poses=poses | {MODEL: np.eye(4)})
    frames.named[MODEL] = Named(root, "")
    for link in root.children("link"):
        frames.named[link.text("name")] = Named(link, "")
    for node in in_gazebo:
        yield node, _gazebo_joint(mechanism, frames, node)


def _loop_joint(mechanism: Mechanism, node: Node) -> Closing:
    """Return the joint and the loop closure of a ``<loop_joint>``."""
    name = node.text("name")
    (first, A), (second, B) = (_place(mechanism, node, tag) for tag in _ENDS)
    if first == second:
        raise node.bad("link2", f"found {quoted(second)} twice, expected another link")
    if node.optional("type") in {"spherical", "ball"}:
        return name, [], [], Loop(name, first, second, A, B, point=True)
    tip = Body(f"{name}.tip")
    freedoms = joint_freedoms(node)
    between: list[Body] = []
    if len(freedoms) > 1:
        several, between = chain(name, first, tip.name, A, HERE, freedoms)
    else:
        ((_, kind, axis),) = freedoms
        several = [Joint(name, kind, first, tip.name, A, axis)]
    return name, several, [*between, tip], Loop(name, tip.name, second, HERE, B)


_ENDS = ("link1", "link2")


def _place(mechanism: Mechanism, node: Node, tag: str) -> tuple[str, NDArray]:
    """Return a link of a ``<loop_joint>``, and the joint pose on this link, (4, 4)."""
    end = node.child(tag)
    if end is None:
        raise node.bad(tag, "missing; expected a link and a pose relative to it")
    name = end.text("link")
    if name not in mechanism.bodies:
        hint = nearest(name, mechanism.bodies)
        raise node.bad(tag, f"found {quoted(name)}, expected the name of a link{hint}")
    return name, pose_of(end)


def _gazebo_joint(mechanism: Mechanism, frames: Frames, node: Node) -> Closing:
    """Return the joint and the loop closure of an SDF joint between URDF links."""
    name = node.text("name")
    named = frames.named[name] = Named(node, "")
    parent, child = (
        mechanism.root if end == WORLD and WORLD not in mechanism.bodies else end
        for end in joint_ends(frames, named)
    )
    tip = Body(f"{name}.tip")
    several, between = joint_parts(frames, name, named, (parent, child), tip.name)
    return name, several, [*between, tip], Loop(name, tip.name, child)
