"""SDF in: links, and joints that may close loops by themselves.

Sources:
    sdformat.org, specification 1.11: a link's pose is in the model's frame, a joint's
    in its child link's, unless ``relative_to`` says another; roll, pitch, yaw.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

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
    chain,
    parents_first,
)
from assembly.exchange.orientation import from_quaternion, from_roll_pitch_yaw, onto
from assembly.exchange.xml_file import Node, counted, placed, read_xml
from forcefit.inputs.errors import BadInput, nearest, quoted

_KINDS = ("fixed", "revolute", "continuous", "prismatic", "ball", "universal",
          "revolute2")  # fmt: skip
_FRAMES = ("link", "joint", "frame")
_AXIS = {"xyz", "limit", "limit lower", "limit upper"}
_HELD = {"joint": ("pose", "parent", "child", "axis", "axis2"),
         "link": ("pose", "inertial")}  # fmt: skip


@dataclass
class _Model:
    """A model's named frames, each placed when it is first asked for."""

    node: Node
    nodes: dict[str, Node] = field(default_factory=dict)
    poses: dict[str, NDArray] = field(default_factory=dict)

    def pose(self, name: str, asked: tuple[str, ...] = ()) -> NDArray:
        """(4, 4) of a link, joint or frame in the model's frame."""
        if name in {"__model__", WORLD, ""}:
            return np.eye(4)
        if name not in self.nodes:
            hint = nearest(name, self.nodes)
            raise self.node.bad("", f"found {quoted(name)}, no frame of it{hint}")
        if name in asked:
            raise self.nodes[name].bad("pose", "found a ring of relative_to")
        if name not in self.poses:
            node = self.nodes[name]
            own, relative = node.child("pose"), ""
            if node.tag == "joint":
                relative = _word(node, "child")
            elif node.tag == "frame":
                relative = node.text("attached_to", "")
            if own is not None:
                relative = own.text("relative_to", relative)
            base = self.pose(relative, (*asked, name))
            self.poses[name] = base @ (np.eye(4) if own is None else _pose(own))
        return self.poses[name]


def read_sdf(path: Path | str, loops: LoopsFile | None = None) -> Mechanism:
    """Mechanism of an SDF file with one model.

    Args:
        path: the file.
        loops: a file that names drives and adds loops, or None.

    Returns:
        The mechanism: a tree from the world, or from the first link; joints that the
        tree does not need become loops.

    Raises:
        BadInput: a rule of the format is broken, or a joint is of no known type.
    """
    root = read_xml(path, "sdf")
    models = [m for g in (root, *root.children("world")) for m in g.children("model")]
    if len(models) != 1:
        raise BadInput(f"{path}: found {len(models)} models, expected exactly one")
    model = _Model(models[0])
    for node in model.node.children():
        if node.tag in {"include", "model"}:
            raise node.bad("", "found it; expected one model written out in one file")
        if node.tag in _FRAMES:
            name = node.text("name")
            if name in model.nodes:
                raise node.bad("name", "found it twice; expected names that differ")
            model.nodes[name] = node
    bodies = {b.name: b for b in map(_body, model.node.children("link"))}
    if not bodies:
        raise BadInput(f"{path}: link: missing; expected at least one")
    joints = list(model.node.children("joint"))
    ends = {node.text("name"): _ends(node, bodies) for node in joints}
    if any(WORLD in pair for pair in ends.values()):
        bodies = {WORLD: Body(WORLD), **bodies}
    tree, parts, closed = _tree(model, joints, ends, bodies)
    base, order = parents_first(tree, bodies, str(path))
    mechanism = Mechanism(
        name=model.node.text("name", Path(path).stem), root=base, bodies=bodies,
        joints=order, loops=tuple(closed), left_out=tuple(_left_out(model.node)),
    )  # fmt: skip
    return with_loops(mechanism, loops, parts, set())


def _word(node: Node, tag: str) -> str:
    """Text of an element inside."""
    inner = node.child(tag)
    text = "" if inner is None else (inner.element.text or "").strip()
    if not text:
        raise node.bad(tag, "missing; expected the name of a link")
    return text


def _ends(node: Node, bodies: dict[str, Body]) -> tuple[str, str]:
    """Parent and child of a joint."""
    parent, child = _word(node, "parent"), _word(node, "child")
    for tag, name in (("parent", parent), ("child", child)):
        if name not in bodies and name != WORLD:
            hint = nearest(name, bodies)
            raise node.bad(tag, f"found {quoted(name)}, expected a link{hint}")
    return parent, child


def _body(node: Node) -> Body:
    """A link and its mass."""
    name, inertial = node.text("name"), node.child("inertial")
    if inertial is None:
        return Body(name)
    mass, pose = inertial.child("mass"), inertial.child("pose")
    centre = np.zeros(3) if pose is None else _pose(pose)[:3, 3]
    # the format's default is 1 kg
    return Body(name, 1.0 if mass is None else mass.number("", "kg"), centre)


def _pose(node: Node) -> NDArray:
    """(4, 4) of a pose element."""
    if node.text("rotation_format", "euler_rpy") == "quat_xyzw":
        *shift, x, y, z, w = node.numbers("", 7, "m, -")
        if not any((x, y, z, w)):
            raise node.bad("", "found a quaternion of zero, expected a rotation")
        return placed(np.array(shift), from_quaternion([w, x, y, z]))
    values = node.numbers("", 6, "m, angle")
    degrees = node.text("degrees", "false") in {"true", "1"}
    turn = values[3:] * (math.pi / 180 if degrees else 1.0)
    return placed(values[:3], from_roll_pitch_yaw(turn))


def _tree(
    model: _Model, joints: list[Node], ends: dict[str, tuple[str, str]],
    bodies: dict[str, Body],
) -> tuple[list[Joint], dict[str, list[str]], list[Loop]]:  # fmt: skip
    """Joints that reach every body from the root, and loops of the others."""
    root = WORLD if WORLD in bodies else model.node.text("canonical_link", "")
    reached = {root or next(iter(bodies))}
    tree, loops, waiting = list[Joint](), list[Loop](), list(joints)
    parts: dict[str, list[str]] = {}
    while waiting:
        # in the order written; those that reach nothing yet wait
        node = next(
            (n for n in waiting if reached & set(ends[n.text("name")])), waiting[0]
        )
        waiting.remove(node)
        name = node.text("name")
        parent, child = ends[name]
        if child in reached and parent in reached:  # it closes a loop
            tip = f"{name}.tip"
            bodies[tip] = Body(tip)
            several, between = _joints(model, node, parent, child, tip)
            loops.append(Loop(name, tip, child))
        else:
            backwards = child in reached
            several, between = _joints(
                model, node, parent, child, parent if backwards else child, backwards
            )
        reached |= {parent, child}
        bodies |= {body.name: body for body in between}
        parts[name] = [joint.name for joint in several]
        tree += several
    return tree, parts, loops


def _joints(
    model: _Model, node: Node, parent: str, child: str, carried: str,
    backwards: bool = False,
) -> tuple[list[Joint], list[Body]]:  # fmt: skip
    """A joint as joints of one freedom, from the child to the parent if backwards."""
    name = node.text("name")
    kind = node.choice("type", _KINDS, "")
    at = model.pose(name)
    axes = [_axis(model, node, tag, at) for tag in ("axis", "axis2")]
    freedoms = {
        "fixed": [("", "fixed", np.array([0.0, 0.0, 1.0]))],
        "prismatic": [("", "prismatic", axes[0])],
        "ball": ball(),
        "universal": [("first", "revolute", axes[0]), ("second", "revolute", axes[1])],
    }  # fmt: skip
    freedoms["revolute2"] = freedoms["universal"]
    parts = freedoms.get(kind, [("", "revolute", axes[0])])
    if kind in {"universal", "revolute2"} and node.child("axis2") is None:
        parts[1] = ("second", "revolute", onto(axes[0])[:, 1])
    if backwards:
        parent, child = child, parent
        parts = [(part, one, -axis) for part, one, axis in reversed(parts)]
    placement = np.linalg.inv(model.pose(parent)) @ at
    after = np.linalg.inv(at) @ model.pose(child)
    if len(parts) == 1:
        ((_, one, axis),) = parts
        return [
            Joint(
                name=name,
                kind=one,
                parent=parent,
                child=carried,
                placement=placement,
                axis=axis,
                after=after,
                limits=_limits(node) if one != "fixed" else None,
            )
        ], []
    return chain(name, parent, carried, placement, after, parts)


def _axis(model: _Model, node: Node, tag: str, at: NDArray) -> NDArray:
    """(3,) direction in the joint's axes."""
    axis = node.child(tag)
    xyz = None if axis is None else axis.child("xyz")
    if xyz is None:
        return np.array([0.0, 0.0, 1.0])
    vector = xyz.unit_vector("")
    seen_from = xyz.text("expressed_in", "")
    if not seen_from:
        return vector
    return np.asarray(at[:3, :3].T @ model.pose(seen_from)[:3, :3] @ vector)


def _limits(node: Node) -> tuple[float, float] | None:
    """Range of a joint of one freedom."""
    axis = node.child("axis")
    limit = None if axis is None else axis.child("limit")
    if limit is None:
        return None
    ends = [limit.child(tag) for tag in ("lower", "upper")]
    lower, upper = (None if end is None else end.element.text or "" for end in ends)
    return limit.limits(lower, upper)


def _left_out(model: Node) -> Iterator[str]:
    """What an SDF says and a robot of frames cannot hold."""
    extra: dict[str, list[str]] = {}
    for node in model.children():
        if node.tag not in (*_FRAMES, "pose", "static"):
            extra.setdefault(f"element {node.tag}", []).append(node.text("name", ""))
        if node.tag == "link" and node.child("inertial") is None:
            massless = "links without inertial, taken as massless"
            extra.setdefault(massless, []).append(node.text("name"))
        for inner in node.children() if node.tag in _HELD else ():
            if inner.tag not in _HELD[node.tag]:
                what = f"{node.tag} {inner.tag}"
                extra.setdefault(what, []).append(node.text("name"))
            elif inner.tag == "inertial" and inner.child("inertia") is not None:
                extra.setdefault("moments of inertia", []).append(node.text("name"))
            elif inner.tag == "axis":
                parts = [part.tag for part in inner.children()]
                for limit in inner.children("limit"):
                    parts += [f"limit {part.tag}" for part in limit.children()]
                for part in sorted(set(parts) - _AXIS):
                    what = f"joint axis {part}"
                    extra.setdefault(what, []).append(node.text("name"))
    for what, names in extra.items():
        yield from counted(what, names)
