"""URDF in: links, joints, and the loops that a file beside it adds.

Sources:
    ROS wiki, urdf/XML/joint and urdf/XML/link: a child link stands in the joint's own
    frame after its motion; an absent axis is x; rpy are turns about fixed axes.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from assembly.exchange.drives_and_loops import with_loops
from assembly.exchange.loops_file import LoopsFile
from assembly.exchange.mechanism import (
    HERE,
    Body,
    Joint,
    Mechanism,
    ball,
    chain,
    parents_first,
    slides,
)
from assembly.exchange.orientation import from_roll_pitch_yaw, onto
from assembly.exchange.xml_file import Node, counted, placed, read_xml
from forcefit.inputs.errors import BadInput, quoted

_ONE_FREEDOM = {"revolute": "revolute", "continuous": "revolute",
                "prismatic": "prismatic", "fixed": "fixed"}  # fmt: skip
_KINDS = (*_ONE_FREEDOM, "spherical", "universal", "planar", "floating")
_ZERO = np.zeros(3)
_DRAWN = ("visual", "collision")
_HELD = {"origin", "parent", "child", "axis", "mimic"}


def read_urdf(path: Path | str, loops: LoopsFile | None = None) -> Mechanism:
    """Mechanism of a URDF.

    Args:
        path: the file.
        loops: what stands beside it, None for an open chain.

    Returns:
        The mechanism.  Drives are those that the loops file names, else those with a
        transmission, else, in a robot without loops, every joint.

    Raises:
        BadInput: a rule of the format is broken, or a joint is of no known type.
    """
    root = read_xml(path, "robot")
    bodies: dict[str, Body] = {}
    for node in root.children("link"):
        body = _body(node)
        if body.name in bodies:
            raise node.bad("name", "found it twice; expected names that differ")
        bodies[body.name] = body
    if not bodies:
        raise BadInput(f"{path}: link: missing; expected at least one")
    nodes = list(root.children("joint"))
    joints: dict[str, Joint] = {}
    parts: dict[str, list[str]] = {}
    for node in nodes:
        several, between = _joints(node)
        name = node.text("name")
        if name in parts:
            raise node.bad("name", "found it twice; expected names that differ")
        parts[name] = [joint.name for joint in several]
        joints |= {joint.name: joint for joint in several}
        bodies |= {body.name: body for body in between}
    joints, mimics = _follow_mimics(nodes, joints)
    base, order = parents_first(list(joints.values()), bodies, str(path))
    mechanism = Mechanism(
        name=root.text("name", Path(path).stem),
        root=base,
        bodies=bodies,
        joints=order,
        left_out=_left_out(root, nodes) + mimics,
    )
    transmissions = root.children("transmission")
    driven = {n.text("name") for t in transmissions for n in t.children("joint")}
    return with_loops(mechanism, loops, parts, driven)


def _body(node: Node) -> Body:
    """A link and its mass."""
    name, inertial = node.text("name"), node.child("inertial")
    mass = None if inertial is None else inertial.child("mass")
    if inertial is None or mass is None:
        return Body(name)
    origin = inertial.child("origin")
    centre = _ZERO if origin is None else origin.numbers("xyz", 3, "m", _ZERO)
    value = mass.number("value", "kg")
    if value < 0:
        raise node.bad("inertial.mass", f"found {value:g}, expected >= 0 [kg]")
    return Body(name, value, centre)


def _joints(node: Node) -> tuple[list[Joint], list[Body]]:
    """A joint as joints of one freedom, and the bodies between them."""
    name = node.text("name")
    kind = node.choice("type", _KINDS, "")
    ends = []
    for tag in ("parent", "child"):
        end = node.child(tag)
        if end is None:
            raise node.bad(tag, "missing; expected the name of a link")
        ends.append(end.text("link"))
    origin = node.child("origin")
    placement = HERE if origin is None else pose_of(origin)
    if kind in _ONE_FREEDOM:
        axis = np.array([0.0, 0.0, 1.0])
        if kind != "fixed":
            axis = _axis(node, "axis", np.array([1.0, 0.0, 0.0]))
        one = _ONE_FREEDOM[kind]
        joint = Joint(name, one, ends[0], ends[1], placement, axis)
        return [replace(joint, limits=_limits(node, kind))], []
    freedoms = ball()
    if kind == "floating":
        freedoms = slides() + ball()
    elif kind == "universal":
        first = _axis(node, "axis", np.array([1.0, 0.0, 0.0]))
        second = _axis(node, "axis2", onto(first)[:, 1])
        freedoms = [("first", "revolute", first), ("second", "revolute", second)]
    elif kind == "planar":
        turn = onto(_axis(node, "axis", np.array([1.0, 0.0, 0.0])))
        freedoms = [("tx", "prismatic", turn[:, 0]), ("ty", "prismatic", turn[:, 1]),
                    ("rz", "revolute", turn[:, 2])]  # fmt: skip
    return chain(name, ends[0], ends[1], placement, HERE, freedoms)


def _limits(node: Node, kind: str) -> tuple[float, float] | None:
    """Range of a joint, None of one that is continuous or says none."""
    limit = node.child("limit")
    if limit is None or kind in {"fixed", "continuous"}:
        return None
    ends = (limit.element.get("lower"), limit.element.get("upper"))
    # absent means 0 in the format; both absent is how files say that there are none
    lower, upper = ("0" if end is None else end for end in ends)
    return None if ends == (None, None) else limit.limits(lower, upper)


def pose_of(origin: Node) -> NDArray:
    """(4, 4) of an element with ``xyz`` and ``rpy``."""
    turn = from_roll_pitch_yaw(origin.numbers("rpy", 3, "rad", _ZERO))
    return placed(origin.numbers("xyz", 3, "m", _ZERO), turn)


def _axis(node: Node, tag: str, default: NDArray) -> NDArray:
    """(3,) unit direction of an element inside a joint."""
    axis = node.child(tag)
    return default if axis is None else axis.unit_vector("xyz", default)


def _follow_mimics(
    nodes: list[Node], joints: dict[str, Joint]
) -> tuple[dict[str, Joint], tuple[str, ...]]:
    """Joints that follow another become drives of their own, which must be said."""
    remarks = []
    for node in nodes:
        mimic = node.child("mimic")
        if mimic is None:
            continue
        name, leader = node.text("name"), mimic.text("joint")
        if leader not in joints or name not in joints:
            raise mimic.bad("joint", f"found {quoted(leader)}, no joint of one freedom")
        factor = mimic.number("multiplier", "-", 1.0)
        offset = mimic.number("offset", "rad or m", 0.0)
        joints = joints | {name: replace(joints[name], actuated=True, position=offset)}
        remarks.append(
            f"mimic: {name} = {factor:g} * {leader} + {offset:g} is a drive of its "
            "own: command it so"
        )
    return joints, tuple(remarks)


def _left_out(root: Node, joints: list[Node]) -> tuple[str, ...]:
    """What a URDF says and a robot of frames cannot hold."""
    links = list(root.children("link"))
    extra: dict[str, list[str]] = {}
    for joint in joints:
        for inner in joint.children():
            if inner.tag == "limit":
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
            elif inner.child("inertia") is not None:
                extra.setdefault("moments of inertia", []).append(link.text("name"))
    for other in root.children():
        if other.tag not in {"link", "joint", "material", "transmission"}:
            extra.setdefault(f"element {other.tag}", []).append("")
    return tuple(line for what, names in extra.items() for line in counted(what, names))
