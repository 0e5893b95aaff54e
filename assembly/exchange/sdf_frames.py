"""Coordinate frames of links, joints, frames and nested models in SDF.

Sources:
    sdformat.org, specification 1.12 and "Pose frame semantics".  The pose of a link is
    relative to the model frame, the pose of a joint is relative to its child link, and
    the pose of a frame is relative to the frame ``attached_to``.  The attribute
    ``relative_to`` specifies another frame.  Names of nested models are joined by
    ``::``.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.mechanism import WORLD
from forcefit.assembly.exchange.orientation import from_quaternion, from_roll_pitch_yaw
from forcefit.assembly.exchange.xml_file import Node, placed, read_xml
from forcefit.inputs.errors import BadInput, nearest, quoted

MODEL = "__model__"
FRAMES = ("link", "joint", "frame")
_AROUND = f"{WORLD}::"
_NESTED = 20  # maximum depth of nested models
_OLD = 4  # 1.4 is the last version in which joint axes are in the model frame


@dataclass(frozen=True)
class Named:
    """Element with a pose, and the name prefix of its model.

    Attributes:
        node: element of a link, joint, frame or model.
        scope: name prefix, which is empty in the outermost model, ``"arm::"`` in a
            nested model ``arm``, and ``"world::"`` in the world.
        old: whether joint axes are in the model frame, as in old format versions.
    """

    node: Node
    scope: str
    old: bool = False


@dataclass
class Frames:
    """Named frames of a model and its nested models.

    Attributes:
        model: the outermost model.
        named: links, joints, frames and models by their full names.
        poses: poses (4, 4) relative to the world that have been computed.
    """

    model: Node
    named: dict[str, Named] = field(default_factory=dict)
    poses: dict[str, NDArray] = field(default_factory=dict)

    def of(self, tag: str) -> Iterator[tuple[str, Named]]:
        """Yield the names and elements with a tag, in the order of the file."""
        return ((k, v) for k, v in self.named.items() if v.node.tag == tag)

    def name(self, name: str, scope: str, node: Node, key: str = "") -> str:
        """Return the full name of a link or frame in a model."""
        if name == WORLD or (name, scope) == (MODEL, _AROUND):
            return WORLD
        own = f"{self.model.optional('name')}::"
        for full in (scope + name, f"{scope}{name}::{MODEL}"):
            if full in self.named:
                return full
        if scope in {"", _AROUND} and own != "::" and name.startswith(own):
            return self.name(name.removeprefix(own), "", node, key)
        here = [k.removeprefix(scope) for k in self.named if k.startswith(scope)]
        hint = nearest(name, [k for k in here if not k.endswith(MODEL)])
        raise node.bad(key, f"found {quoted(name)}, expected a link or frame{hint}")

    def pose(self, name: str, asked: tuple[str, ...] = ()) -> NDArray:
        """Return the pose of a frame relative to the world, (4, 4)."""
        if name == WORLD:
            return np.eye(4)
        if name not in self.poses:
            node, scope = self.named[name].node, self.named[name].scope
            if name in asked:
                raise node.bad(
                    "pose",
                    "found a cycle of relative_to, expected poses that lead to "
                    "the model's frame",
                )
            own = node.child("pose")
            relative = ""
            if own is not None:  # the attribute was ``frame`` until version 1.6
                relative = own.optional("relative_to") or own.optional("frame")
            relative = relative or self._default(name)
            base = self.pose(self.name(relative, scope, node, "pose"), (*asked, name))
            T = base @ (np.eye(4) if own is None else own_pose(own))
            held = node.optional("placement_frame") if node.tag == "model" else ""
            if held:
                inside = replace(self, poses={name: np.eye(4)})
                full = self.name(held, name.removesuffix(MODEL), node)
                T = T @ np.linalg.inv(inside.pose(full))
            self.poses[name] = T
        return self.poses[name]

    def _default(self, name: str) -> str:
        """Return the frame to which a pose without ``relative_to`` refers."""
        node = self.named[name].node
        if node.tag == "joint":
            return word(node, "child")
        return (node.optional("attached_to") if node.tag == "frame" else "") or MODEL

    def link(self, name: str, asked: tuple[str, ...] = ()) -> str:
        """Return the name of the link to which a frame is attached."""
        if name == WORLD:
            return WORLD
        node, scope = self.named[name].node, self.named[name].scope
        if node.tag == "link":
            return name
        if name in asked:
            raise node.bad(
                "attached_to",
                "found a cycle of attached frames, expected frames that lead to a link",
            )
        if node.tag == "model":
            return self._canonical(name.removesuffix(MODEL), node)
        to = self._default(name)
        return self.link(self.name(to, scope, node), (*asked, name))

    def _canonical(self, scope: str, model: Node) -> str:
        """Return the name of the link to which a model frame is attached."""
        given = model.optional("canonical_link")
        if given:
            return self.link(self.name(given, scope, model, "canonical_link"))
        for name, _ in self.of("link"):
            if name.startswith(scope):
                return name
        raise model.bad("link", "missing; expected at least one link")


def frames_of(root: Node) -> Frames:
    """Return all named frames of a file that contains one model.

    Args:
        root: root element ``<sdf>``.

    Returns:
        The frames; their poses are computed later.

    Raises:
        BadInput: a name is missing or not unique, or there is not exactly one model.
    """
    worlds = list(root.children("world"))
    models = [m for group in (root, *worlds) for m in group.children("model")]
    if len(models) > 1:  # static models, such as the ground, are not the robot
        models = [m for m in models if not _is_static(m)]
    if not models:  # the robot may be in an included file
        given = [i for group in (root, *worlds) for i in group.children("include")]
        models = given if len(given) == 1 else []
    if len(models) != 1:
        raise BadInput(f"{root.file}: found {len(models)} models, expected exactly one")
    model, old = models[0], _is_old(root)
    if model.tag == "include":
        model, old = included(model)
    frames = Frames(model)
    for node in (inner for world in worlds for inner in world.children()):
        if node.tag in {"frame", "joint"}:
            _take(frames, node, _AROUND, node.text("name"), old)
    _gather(frames, model, "", _AROUND, old)
    return frames


def _is_static(model: Node) -> bool:
    """Return whether an SDF model is declared static (fixed to the world)."""
    static = model.child("static")
    return static is not None and static.content.lower() in {"true", "1"}


def _gather(frames: Frames, model: Node, scope: str, outer: str, old: bool) -> None:
    """Collect the elements of a model and of its nested models."""
    if scope.count("::") > _NESTED:
        raise model.bad(
            "", f"found models nested more than {_NESTED} deep, expected fewer levels"
        )
    frames.named[scope + MODEL] = Named(model, outer, old)
    nodes = sorted(model.children(), key=lambda node: node.tag != "link")
    for node in nodes:
        if node.tag in FRAMES:
            _take(frames, node, scope, node.text("name"), old)
            continue
        inside, its = (node, old) if node.tag == "model" else (None, old)
        if node.tag == "include":
            inside, its = included(node)
        if inside is not None:
            within = f"{scope}{inside.text('name')}::"
            if within + MODEL in frames.named:
                raise node.bad("name", "found this name twice; expected unique names")
            _gather(frames, inside, within, scope, its)


def _take(frames: Frames, node: Node, scope: str, name: str, old: bool) -> None:
    """Add a link, joint or frame.

    A joint or frame with the name of a link gets a suffix.
    """
    full = scope + name
    if full in frames.named and frames.named[full].node.tag != node.tag:
        full += f"_{node.tag}"  # libsdformat appends the same suffix
    if full in frames.named:
        raise node.bad("name", "found this name twice; expected unique names")
    frames.named[full] = Named(node, scope, old)


def _is_old(root: Node) -> bool:
    """Return whether a file has an old version, with joint axes in the model frame.

    Raises:
        BadInput: the version is older than 1.4 or not of the form 1.x.
    """
    version = root.optional("version")
    if not version:
        return False
    minor = version.removeprefix("1.")
    if minor == version or not minor.isdecimal() or int(minor) < _OLD:
        raise root.bad(
            "version", f"found {quoted(version)}, expected 1.4 or a later version 1.x"
        )
    return int(minor) == _OLD


def included(node: Node) -> tuple[Node, bool]:
    """Return the model of an included file, and whether its version is old.

    Args:
        node: element ``<include>``.  The included file or folder is searched in the
            folder of the current file and in the two folders above.

    Returns:
        The model, with the name, pose and placement frame of the include element.

    Raises:
        BadInput: the file does not exist or does not contain exactly one model.
    """
    if node.optional("merge") in {"true", "1"}:
        raise node.bad(
            "merge",
            "found true, which is not supported; expected false: an included "
            "model keeps its own names",
        )
    address = word(node, "uri")
    path = address.removeprefix("model://").removeprefix("file://")
    folder = Path(node.file).absolute().parent
    around = [folder, *folder.parents[:2]] if not Path(path).is_absolute() else [folder]
    places = [place / path for place in around]
    places = [p / "model.sdf" if p.is_dir() else p for p in places]
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise node.bad(
            "uri",
            f"found {quoted(address)}, expected a file or folder next to this "
            "file or in a folder above it",
        )
    root = read_xml(found, "sdf")
    models = list(root.children("model"))
    if len(models) != 1:
        raise BadInput(f"{found}: found {len(models)} models, expected exactly one")
    element = models[0].element
    for tag in ("name", "placement_frame"):
        inner = node.child(tag)
        if inner is not None and inner.content:
            element.set(tag, inner.content)
    pose = node.child("pose")
    if pose is not None:
        own = element.find("pose")
        if own is not None:
            element.remove(own)
        element.append(pose.element)
    return models[0], _is_old(root)


def word(node: Node, tag: str) -> str:
    """Return the text of an inner element.

    Args:
        node: outer element, such as a joint.
        tag: tag of the inner element, which contains the name of a link.

    Returns:
        The text.

    Raises:
        BadInput: the inner element is missing or empty.
    """
    inner = node.child(tag)
    if inner is None or not inner.content:
        raise node.bad(tag, "missing; expected the name of a link")
    return inner.content


def own_pose(node: Node) -> NDArray:
    """Return the transform in a pose element.

    Args:
        node: element ``<pose>``.

    Returns:
        Transform (4, 4); the identity if the element is empty.

    Raises:
        BadInput: the number of values is wrong.
    """
    kind = node.optional("rotation_format") or "euler_rpy"
    if kind not in {"euler_rpy", "quat_xyzw"}:
        found = f"found {quoted(kind)}, expected euler_rpy or quat_xyzw"
        raise node.bad("rotation_format", found)
    if not node.content:
        return np.eye(4)
    if kind == "quat_xyzw":
        *shift, x, y, z, w = node.numbers("", 7, "m, -")
        if not any((x, y, z, w)):
            raise node.bad("", "found a zero quaternion, expected a rotation")
        return placed(np.array(shift), from_quaternion([w, x, y, z]))
    values = node.numbers("", 6, "m, angle")
    degrees = node.optional("degrees") in {"true", "1"}
    turn = values[3:] * (math.pi / 180 if degrees else 1.0)
    return placed(values[:3], from_roll_pitch_yaw(turn))
