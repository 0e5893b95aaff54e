"""Import of URDF, with loops and drives from a separate file.

Sources:
    ROS wiki, urdf/XML/joint and urdf/XML/link.  The frame of a child link is the moved
    frame of its joint.  The default axis is x.  ``rpy`` are rotations about fixed axes.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from forcefit.assembly.exchange.coupling import Coupling, leaders_first
from forcefit.assembly.exchange.drives_and_loops import with_loops
from forcefit.assembly.exchange.loops_file import LoopsFile
from forcefit.assembly.exchange.mechanism import (
    HERE,
    Body,
    Joint,
    Mechanism,
    chain,
    parents_first,
)
from forcefit.assembly.exchange.ties import may_tie, refuse_ties
from forcefit.assembly.exchange.urdf_joint import joint_freedoms, pose_of
from forcefit.assembly.exchange.urdf_loops import with_closing_joints
from forcefit.assembly.exchange.xml_file import Node, counted, read_xml
from forcefit.assembly.model.inertia import inertia_matrix
from forcefit.inputs.errors import BadInput, quoted

_CONVERTED = ("link", "joint", "material", "transmission", "loop_joint")
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_DRAWN = ("visual", "collision")
_HELD = {"origin", "parent", "child", "axis", "mimic"}


def read_urdf(path: Path | str, loops: LoopsFile | None = None) -> Mechanism:
    """Read a URDF.

    Args:
        path: path of the file.
        loops: loops file of the robot; None for an open chain.

    Returns:
        Mechanism.  Its drives are listed in the loops file.  If they are not listed,
        joints with a transmission are driven.  Without transmissions and loops, all
        joints are driven.

    Raises:
        BadInput: the file does not comply with the format, or a joint type is unknown.
    """
    root = read_xml(path, "robot")
    for node in root.descendants():
        if node.tag.startswith("xacro:"):
            raise node.bad(
                "",
                "found a macro, expected a URDF without macros, which the "
                "program xacro writes",
            )
    bodies: dict[str, Body] = {}
    for node in root.children("link"):
        body = _body(node)
        if body.name in bodies:
            raise node.bad("name", "found this name twice; expected unique names")
        bodies[body.name] = body
    if not bodies:
        raise BadInput(f"{path}: link: missing; expected at least one link")
    links = dict(bodies)
    nodes = [node for node in root.children() if node.tag.split(":")[-1] == "joint"]
    joints: dict[str, Joint] = {}
    parts: dict[str, list[str]] = {}
    for node in nodes:
        several, between = _joints(node)
        _add(node, parts, several)
        joints |= {joint.name: joint for joint in several}
        bodies |= {body.name: body for body in between}
    couplings = leaders_first(list(_couplings(nodes, joints)), str(path))
    base, order = parents_first(list(joints.values()), bodies, str(path))
    mechanism = Mechanism(
        name=root.text("name", Path(path).stem),
        root=base,
        bodies=bodies,
        joints=order,
        left_out=_left_out(root, nodes, links),
        couplings=couplings,
    )
    mechanism = with_closing_joints(mechanism, root, parts)
    transmissions = root.children("transmission")
    driven = {n.text("name") for t in transmissions for n in t.children("joint")}
    return with_loops(mechanism, loops, parts, driven)


def _add(node: Node, parts: dict[str, list[str]], several: list[Joint]) -> None:
    """Add the names of the elementary joints of a joint, whose name must be unique."""
    name = node.text("name")
    if name in parts:
        raise node.bad("name", "found this name twice; expected unique names")
    parts[name] = [joint.name for joint in several]


def _body(node: Node) -> Body:
    """Return the body of a link with its mass and moments of inertia."""
    name, inertial = node.text("name"), node.child("inertial")
    mass = None if inertial is None else inertial.child("mass")
    if inertial is None or mass is None:
        return Body(name)
    origin, inertia = inertial.child("origin"), inertial.child("inertia")
    T, J = HERE if origin is None else pose_of(origin), np.zeros((3, 3))
    if inertia is not None:
        six = [inertia.number(key, "kg m^2", 0.0) for key in _MOMENTS]
        J = T[:3, :3] @ inertia_matrix(six) @ T[:3, :3].T
    value = mass.number("value", "kg")
    if value < 0:
        raise node.bad("inertial.mass", f"found {value:g}, expected >= 0 [kg]")
    return Body(name, value, T[:3, 3], J)


def _joints(node: Node) -> tuple[list[Joint], list[Body]]:
    """Return the elementary joints of a URDF joint, and the bodies between them."""
    ends = []
    for tag in ("parent", "child"):
        end = node.child(tag)
        if end is None:
            raise node.bad(tag, "missing; expected the name of a link")
        ends.append(end.text("link"))
    origin = node.child("origin")
    placement = HERE if origin is None else pose_of(origin)
    freedoms = joint_freedoms(node)
    name = node.text("name")
    if len(freedoms) > 1:
        return chain(name, ends[0], ends[1], placement, HERE, freedoms)
    ((_, kind, axis),) = freedoms
    joint = Joint(name, kind, ends[0], ends[1], placement, axis)
    return [replace(joint, limits=_limits(node))], []


def _limits(node: Node) -> tuple[float, float] | None:
    """Return the range of a joint; None if it is continuous or has no range."""
    limit = node.child("limit")
    if limit is None or node.text("type") in {"fixed", "continuous"}:
        return None
    ends = (limit.element.get("lower"), limit.element.get("upper"))
    # the default value of one missing limit is 0
    lower, upper = ("0" if end is None else end for end in ends)
    return None if ends == (None, None) else limit.limits(lower, upper)


def _is_reversed(limit: Node) -> bool:
    """Return whether the lower limit of a joint exceeds the upper limit."""
    lower, upper = (limit.optional(end) or "0" for end in ("lower", "upper"))
    try:
        return float(lower) > float(upper)
    except ValueError:  # the limits of some joint types are not read
        return False


def _couplings(nodes: list[Node], joints: dict[str, Joint]) -> Iterator[Coupling]:
    """Yield the couplings between joints (``<mimic>``)."""
    for node in nodes:
        mimic = node.child("mimic")
        if mimic is None:
            continue
        name, leader = node.text("name"), mimic.text("joint")
        for one in (leader, name):
            if one not in joints or joints[one].kind == "fixed":
                raise mimic.bad(
                    "joint",
                    f"found {quoted(one)}, expected a joint with one degree of freedom",
                )
        factor = mimic.number("multiplier", "-", 1.0)
        yield Coupling(name, leader, (mimic.number("offset", "rad or m", 0.0), factor))


def _left_out(
    root: Node, joints: list[Node], bodies: Mapping[str, Body]
) -> tuple[str, ...]:
    """Return descriptions of URDF elements that are not converted."""
    links = list(root.children("link"))
    owners = {name: name for name in bodies}
    # Drake permits frames that are attached to links
    owners |= {f.optional("name"): f.optional("link") for f in root.children("frame")}
    named = {*bodies, *(joint.text("name") for joint in joints)}
    extra: dict[str, list[str]] = {}
    for joint in joints:
        for inner in joint.children():
            if inner.tag == "limit":
                if _is_reversed(inner):
                    extra.setdefault("joint range, lower above upper", []).append(
                        joint.text("name")
                    )
                for what in sorted(set(inner.element.keys()) - {"lower", "upper"}):
                    extra.setdefault(f"joint limit {what}", []).append(
                        joint.text("name")
                    )
            elif inner.tag not in _HELD and inner.tag != "axis2":
                extra.setdefault(f"joint {inner.tag}", []).append(joint.text("name"))
    for link in links:
        for inner in link.children():
            if inner.tag != "inertial":
                drawn = inner.tag in _DRAWN
                what = f"{inner.tag} shapes" if drawn else f"link {inner.tag}"
                extra.setdefault(what, []).append(link.text("name"))
    for other in root.children():
        if other.tag.split(":")[-1] not in _CONVERTED:
            for inner in other.children() if other.tag == "gazebo" else (other,):
                if inner.tag != "joint":
                    refuse_ties(inner, owners)
                said = may_tie(inner, named)
                if said:
                    name = inner.optional("name") or other.optional("reference")
                    extra.setdefault(f"{inner.tag}{said}", []).append(name)
            extra.setdefault(f"element {other.tag}", []).append("")
    return tuple(line for what, names in extra.items() for line in counted(what, names))
