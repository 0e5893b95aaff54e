"""MJCF in: MuJoCo's bodies, joints, and equality constraints as loops.

Sources:
    MuJoCo documentation, XML reference: angles are in degrees unless the compiler says
    radian; joints turn at ``pos`` in the body, in the order written; connect and weld
    hold what coincides in the initial configuration unless sites or relpose say more.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.exchange.drives_and_loops import with_loops
from assembly.exchange.loops_file import LoopsFile
from assembly.exchange.mechanism import (
    WORLD,
    Body,
    Joint,
    Loop,
    Mechanism,
    ball,
    body_poses,
    motion,
    parents_first,
)
from assembly.exchange.mjcf_orientation import Angles, orientation
from assembly.exchange.xml_file import Node, counted, placed, read_xml
from forcefit.inputs.errors import nearest, quoted
from stiffness.screws import transform

_ZERO = np.zeros(3)
_KINDS = {"hinge": "revolute", "slide": "prismatic", "ball": "ball", "free": "free"}
_REFUSED = ("include", "replicate", "attach", "composite", "flexcomp")
_JOINT = {"name", "type", "pos", "axis", "ref", "class", "range", "limited"}
_HELD = ("body", "joint", "freejoint", "inertial", "site", "frame")


@dataclass
class _Reading:
    """What is gathered while the bodies of a file are walked through."""

    angles: Angles
    defaults: dict[str, dict[str, dict[str, str]]]
    bodies: dict[str, Body] = field(default_factory=lambda: {WORLD: Body(WORLD)})
    joints: list[Joint] = field(default_factory=list)
    parts: dict[str, list[str]] = field(default_factory=dict)
    sites: dict[str, tuple[str, NDArray]] = field(default_factory=dict)
    extra: dict[str, list[str]] = field(default_factory=dict)
    coordinates: list[str | int] = field(default_factory=list)  # order of qpos


def read_mjcf(path: Path | str, loops: LoopsFile | None = None) -> Mechanism:
    """Mechanism of an MJCF file.

    Args:
        path: the file.
        loops: a file that adds to its loops and drives, or None.

    Returns:
        The mechanism; its home is the key ``home`` where there is one.

    Raises:
        BadInput: a rule of the format is broken, or an element is not known here.
    """
    root = read_xml(path, "mujoco")
    for tag in _REFUSED:
        for element in root.element.iter(tag):
            raise Node(element, root.file).bad(
                "", "found it; expected one file in which every body is written out"
            )
    reading = _Reading(Angles.of(root), _defaults(root))
    world = root.child("worldbody")
    if world is None:
        raise root.bad("worldbody", "missing")
    _walk(world, WORLD, np.eye(4), "main", reading)
    joints, mimics = _coupled(root, reading)
    base, order = parents_first(joints, reading.bodies, str(path))
    mechanism = Mechanism(
        name=root.text("model", Path(path).stem), root=base, bodies=reading.bodies,
        joints=order,
    )  # fmt: skip
    # constraints hold where the file is written, before any key
    closed = tuple(_loops(root, reading, body_poses(mechanism, mechanism.home)))
    mechanism = replace(mechanism, joints=_at_key(root, reading, order))
    extra = {k: v for k, v in reading.extra.items() if v}
    left_out = tuple(line for k, v in extra.items() for line in counted(k, v))
    mechanism = replace(mechanism, loops=closed, left_out=left_out + mimics)
    driven = {
        node.text("joint")
        for group in root.children("actuator")
        for node in group.children()
        if node.has("joint")
    }
    for name in driven - set(reading.parts):
        hint = nearest(name, reading.parts)
        raise root.bad("actuator", f"found {quoted(name)}, no joint{hint}")
    mechanism = replace(mechanism, platform=_platform(root, reading))
    return with_loops(mechanism, loops, reading.parts, driven)


def _platform(root: Node, reading: _Reading) -> str | None:
    """The body that ``<custom><text name="platform">`` names."""
    for group in root.children("custom"):
        for text in group.children("text"):
            if text.text("name") == "platform" and text.text("data") in reading.bodies:
                return text.text("data")
    return None


def _defaults(root: Node) -> dict[str, dict[str, dict[str, str]]]:
    """Attributes by class and element, each class with what its parents say."""
    classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}

    def gather(node: Node, inherited: dict[str, dict[str, str]], name: str) -> None:
        own = {tag: dict(values) for tag, values in inherited.items()}
        for inner in node.children():
            if inner.tag != "default":
                own.setdefault(inner.tag, {}).update(inner.element.attrib)
        classes[name] = own
        for inner in node.children("default"):
            gather(inner, own, inner.text("class"))

    for node in root.children("default"):
        gather(node, classes["main"], node.text("class", "main"))
    return classes


def _filled(node: Node, childclass: str, reading: _Reading) -> Node:
    """An element with the defaults of its class filled in."""
    name = node.text("class", childclass)
    if name not in reading.defaults:
        hint = nearest(name, reading.defaults)
        raise node.bad("class", f"found {quoted(name)}, no default class{hint}")
    given = {**reading.defaults[name].get(node.tag, {}), **node.element.attrib}
    element = type(node.element)(node.element.tag, given)
    element.extend(list(node.element))
    return Node(element, node.file)


def _walk(
    node: Node, body: str, offset: NDArray, childclass: str, reading: _Reading
) -> None:
    """What stands in a body, or in a frame at an offset inside of it."""
    for inner in node.children():
        if inner.tag == "body":
            _add_body(inner, body, offset, childclass, reading)
        elif inner.tag == "frame":
            at = offset @ _pose(inner, reading)
            _walk(inner, body, at, inner.text("childclass", childclass), reading)
        elif inner.tag == "site":
            site = _filled(inner, childclass, reading)
            if site.has("name"):
                at = offset @ _pose(site, reading)
                reading.sites[site.text("name")] = body, at
        elif inner.tag not in _HELD:
            name = inner.text("name", "")
            reading.extra.setdefault(inner.tag, []).append(name)


def _add_body(
    node: Node, parent: str, offset: NDArray, childclass: str, reading: _Reading
) -> None:
    """A body, the joints it stands on, and all inside of it."""
    name = node.text("name", f"body{len(reading.bodies)}")
    if name in reading.bodies:
        raise node.bad("name", "found it twice; expected names that differ")
    childclass = node.text("childclass", childclass)
    at = offset @ _pose(node, reading)
    mass, centre = 0.0, _ZERO
    inertial = node.child("inertial")
    if inertial is not None:
        mass = inertial.number("mass", "kg")
        centre = inertial.numbers("pos", 3, "m", _ZERO)
    elif node.child("geom") is not None:
        reading.extra.setdefault("masses that MuJoCo makes of shapes", []).append(name)
    reading.bodies[name] = Body(name, mass, centre)
    freedoms = list(_freedoms(node, name, childclass, reading))
    if not freedoms:
        reading.joints.append(Joint(f"{name}.joint", "fixed", parent, name, at))
    on = parent
    for i, joint in enumerate(freedoms):
        last = i == len(freedoms) - 1
        child = name if last else f"{joint.name}.after"
        if not last:
            reading.bodies[child] = Body(child)
        placement = at @ joint.placement if i == 0 else joint.placement
        reading.joints.append(
            replace(joint, parent=on, child=child, placement=placement)
        )
        on = child
    _walk(node, name, np.eye(4), childclass, reading)


def _freedoms(
    node: Node, body: str, childclass: str, reading: _Reading
) -> Iterator[Joint]:
    """The joints of a body, of one freedom each, in the body's axes."""
    for inner in node.children("joint", "freejoint"):
        given = _filled(inner, childclass, reading)
        name = given.text("name", f"{body}.joint{len(reading.parts) + 1}")
        if name in reading.parts:
            raise inner.bad("name", "found it twice; expected names that differ")
        kind = "free"
        if inner.tag == "joint":
            kind = _KINDS[given.choice("type", tuple(_KINDS), "hinge")]
        if kind == "free":
            reading.extra.setdefault("free joints, held at rest", []).append(body)
            reading.coordinates.append(7)
            continue
        for key in given.element.attrib:
            if key not in _JOINT:
                reading.extra.setdefault(f"joint {key}", []).append(name)
        anchor = given.numbers("pos", 3, "m", _ZERO)
        placement, back = placed(anchor, np.eye(3)), placed(-anchor, np.eye(3))
        if kind == "ball":
            turns = ball()
            reading.parts[name] = [f"{name}.{part}" for part, _, _ in turns]
            reading.coordinates.append(4)
            for i, (part, turn, axis) in enumerate(turns):
                first, last = i == 0, i == len(turns) - 1
                yield Joint(
                    f"{name}.{part}", turn, "", "",
                    placement=placement if first else np.eye(4), axis=axis,
                    after=back if last else np.eye(4),
                )  # fmt: skip
            continue
        reading.parts[name] = [name]
        reading.coordinates.append(name)
        axis = given.unit_vector("axis", np.array([0.0, 0.0, 1.0]))
        ref = given.number("ref", "angle or m", 0.0)
        ref *= reading.angles.unit if kind == "revolute" else 1.0
        joint = Joint(
            name=name,
            kind=kind,
            parent="",
            child="",
            placement=placement,
            axis=axis,
            after=back,
            limits=_limits(given, kind, reading.angles),
        )
        # the coordinate at rest is ref: the joint's own zero lies before it
        yield replace(joint, placement=placement @ motion(joint, -ref), position=ref)


def _limits(node: Node, kind: str, angles: Angles) -> tuple[float, float] | None:
    """Range of a hinge or slide; ``limited`` absent means that a range binds."""
    limited = node.text("limited", "auto")
    binds = limited == "true" or (limited == "auto" and angles.range_limits)
    if not node.has("range") or not binds:
        return None
    ends = node.text("range").split()
    if len(ends) != 2:
        raise node.bad("range", f"found {quoted(' '.join(ends))}, expected 2 numbers")
    unit = angles.unit if kind == "revolute" else 1.0
    return node.limits(ends[0], ends[1], unit)


def _pose(node: Node, reading: _Reading) -> NDArray:
    """(4, 4) of an element with ``pos`` and any kind of orientation."""
    shift = node.numbers("pos", 3, "m", _ZERO)
    return placed(shift, orientation(node, reading.angles))


def _at_key(
    root: Node, reading: _Reading, joints: tuple[Joint, ...]
) -> tuple[Joint, ...]:
    """Joints at the positions of the key named home."""
    keys = [k for group in root.children("keyframe") for k in group.children("key")]
    for key in keys:
        if key.text("name", "") != "home" or not key.has("qpos"):
            reading.extra.setdefault("key", []).append(key.text("name", ""))
            continue
        counts = [1 if isinstance(c, str) else c for c in reading.coordinates]
        values = key.numbers("qpos", sum(counts), "rad or m")
        at = dict(zip(reading.coordinates, np.cumsum([0, *counts[:-1]]), strict=False))
        if 4 in counts:
            reading.extra.setdefault("ball joints' turn in the key", []).append("home")
        joints = tuple(
            replace(j, position=float(values[at[j.name]])) if j.name in at else j
            for j in joints
        )
    return joints


def _coupled(root: Node, reading: _Reading) -> tuple[list[Joint], tuple[str, ...]]:
    """Joints that follow another become drives of their own, which must be said."""
    joints, remarks = list(reading.joints), []
    for group in root.children("equality"):
        for node in group.children("joint"):
            name = node.text("joint1")
            if name not in reading.parts:
                hint = nearest(name, reading.parts)
                raise node.bad("joint1", f"found {quoted(name)}, no joint{hint}")
            joints = [
                replace(j, actuated=True) if j.name == name else j for j in joints
            ]
            remarks.append(
                f"mimic: {name} follows {node.text('joint2', 'a constant')}: it is a "
                "drive of its own, command it so"
            )
    return joints, tuple(remarks)


def _loops(root: Node, reading: _Reading, poses: dict[str, NDArray]) -> Iterator[Loop]:
    """``connect`` and ``weld`` as loops."""
    count = 0
    for group in root.children("equality"):
        for node in group.children():
            if node.tag == "joint":
                continue
            if (
                node.tag not in {"connect", "weld"}
                or node.text("active", "") == "false"
            ):
                reading.extra.setdefault(f"equality {node.tag}", []).append(
                    node.text("name", "")
                )
                continue
            count += 1
            point = node.tag == "connect"
            name = node.text("name", f"loop{count}")
            if node.has("site1"):
                (a, A), (b, B) = (
                    _known(node, key, reading.sites) for key in ("site1", "site2")
                )
                yield Loop(name, a, b, A, B, point)
                continue
            a = _known(node, "body1", {k: k for k in poses})
            b = WORLD
            if node.has("body2"):
                b = _known(node, "body2", {k: k for k in poses})
            A, B = np.eye(4), np.eye(4)
            back = np.linalg.inv(poses[b]) @ poses[a]
            if point:
                A = placed(node.numbers("anchor", 3, "m"), np.eye(3))
                B = transform((back @ A)[:3, 3], np.eye(3))
            else:
                given = node.numbers("relpose", 7, "m, -", np.zeros(7))
                B = back
                if given[3:].any():
                    # of body2 seen from body1
                    A = placed(given[:3], Angles.quaternion(given[3:]))
                    B = np.eye(4)
            yield Loop(name, a, b, A, B, point)


def _known(node: Node, key: str, valid: dict[str, Any]) -> Any:
    """What a name stands for."""
    name = node.text(key)
    if name not in valid:
        raise node.bad(key, f"found {quoted(name)}{nearest(name, valid)}")
    return valid[name]
