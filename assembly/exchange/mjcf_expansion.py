"""Expansion of MJCF: included files, replicated bodies and attached models.

MuJoCo (``MjSpec``) is not used for the expansion, because it is optional and because
the import is verified with it.

Sources:
    MuJoCo documentation, XML reference.  ``include`` inserts the elements of a file.
    ``replicate`` moves copy i by i times its offset and rotation and appends i to all
    names, with as many digits as the number of copies.  ``attach`` inserts a body of
    another model, together with the defaults and constraints of that model, and adds a
    prefix to all names.
"""

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from forcefit.assembly.exchange.mjcf_orientation import Angles
from forcefit.assembly.exchange.orientation import from_euler, to_quaternion
from forcefit.assembly.exchange.xml_file import Node, placed, read_xml
from forcefit.inputs.errors import BadInput, quoted

_DEEPEST = 10  # maximum depth of nested files
_MOST_COPIES = 10_000
_MOST_ELEMENTS = 200_000
# attributes whose values are names of elements
_NAMES = ("name", "class", "childclass", "joint", "joint1", "joint2", "jointinparent",
          "body", "body1", "body2", "site", "site1", "site2", "refsite", "slidersite",
          "cranksite", "tendon", "tendon1", "tendon2", "geom", "mesh")  # fmt: skip
_REFERENCES = _NAMES[3:]
UNIT, SEQUENCE = "attached.unit", "attached.sequence"


def expanded(root: Node, depth: int = 0) -> Node:
    """Replace ``include``, ``replicate`` and ``attach`` by explicit elements.

    Args:
        root: root element of the file, which is modified in place.
        depth: number of files in which this file is nested.

    Returns:
        Root element.

    Raises:
        BadInput: a file is missing or not MJCF, files are nested too deeply, there are
            too many copies, or an attached model or body does not exist.
    """
    if depth > _DEEPEST:
        raise BadInput(
            f"{root.file}: found attached models nested more than {_DEEPEST} "
            f"deep, expected at most {_DEEPEST}"
        )
    _include(root.element, root, Path(root.file).parent, 0)
    _attach(root, depth)  # first, because attached elements may be replicated
    angles = Angles.of(root)
    for world in root.children("worldbody"):
        _replicate(world.element, root, angles)
    if sum(1 for _ in root.element.iter()) > _MOST_ELEMENTS:
        raise BadInput(
            f"{root.file}: found more than {_MOST_ELEMENTS} elements including "
            "copies, expected fewer"
        )
    return root


def _include(element: Any, root: Node, folder: Path, depth: int) -> None:
    """Replace ``include`` by the elements of the included file."""
    inside: list[Any] = []
    for inner in element:
        if inner.tag != "include":
            _include(inner, root, folder, depth)
            inside.append(inner)
            continue
        node = Node(inner, root.file)
        if depth == _DEEPEST:
            raise node.bad(
                "file",
                f"found included files nested more than {_DEEPEST} deep, "
                f"expected at most {_DEEPEST}",
            )
        other = read_xml(folder / node.text("file"), "mujocoinclude", "mujoco")
        _include(other.element, other, folder, depth + 1)
        inside += other.element
    element[:] = inside


def _replicate(element: Any, root: Node, angles: Angles) -> None:
    """Replace ``replicate`` by frames with copies, beginning with inner elements."""
    inside: list[Any] = []
    for inner in element:
        _replicate(inner, root, angles)
        if inner.tag == "replicate":
            ties = _ties_within(root, inner)
            inside += _copies(Node(inner, root.file), angles, ties)
            for section, tie in ties:
                section.remove(tie)
        else:
            inside.append(inner)
    element[:] = inside


def _copies(
    node: Node, angles: Angles, ties: list[tuple[Any, Any]]
) -> Iterator[Any]:  # fmt: skip
    """Yield a frame for each copy of ``replicate``, and copy the constraints."""
    count = node.number("count", "copies")
    if not 1 <= count <= _MOST_COPIES or count % 1:
        expected = f"expected a whole number from 1 to {_MOST_COPIES}"
        raise node.bad("count", f"found {count:g}, {expected}")
    turn = node.numbers("euler", 3, "angle", np.zeros(3)) * angles.unit
    shift = node.numbers("offset", 3, "m", np.zeros(3))
    step = placed(shift, from_euler(turn, angles.sequence))
    T, digits = np.eye(4), len(str(int(count)))
    for i in range(int(count)):
        quaternion = to_quaternion(T[:3, :3])
        pose = {"pos": _words(T[:3, 3]), "quat": _words(quaternion)}
        frame = Element("frame", pose)
        frame.extend(copy.deepcopy(list(node.element)))
        ending = f"{node.optional('sep')}{i:0{digits}}"
        _end(frame, ("name",), ending)
        for section, tie in ties:
            section.append(copy.deepcopy(tie))
            _end(section[-1], ("name", *_REFERENCES), ending)
        yield frame
        T = T @ step


def _end(element: Any, keys: tuple[str, ...], ending: str) -> None:
    """Append a suffix to the names of an element and of its inner elements."""
    for one in element.iter():
        for key in keys:
            if key in one.attrib:
                one.set(key, one.get(key) + ending)


def _words(values: Any) -> str:
    """Return numbers as text in full precision."""
    return " ".join(repr(float(value)) for value in values)


def _attach(root: Node, depth: int) -> None:
    """Replace ``attach`` by frames with bodies of other models."""
    worlds = [world.element for world in root.children("worldbody")]
    places = [
        (outer, inner)
        for world in worlds for outer in world.iter() for inner in outer
        if inner.tag == "attach"
    ]  # fmt: skip
    if not places:
        return
    # a model that attaches itself is copied before it is changed
    own = copy.deepcopy(root.element)
    others = {
        name: (file, element)
        for asset in root.children("asset")
        for model in asset.children("model")
        for name, file, element in [_other(model, root, depth)]
    }
    for outer, inner in places:
        node, file, element = Node(inner, root.file), root.file, own
        if node.has("model"):
            name = node.text("model")
            if name not in others:
                raise node.bad(
                    "model", f"found {quoted(name)}, expected the name of a model asset"
                )
            file, element = others[name]
        elif not node.has("frame"):
            raise node.bad("model", "missing; expected the name of a model asset")
        other = Node(copy.deepcopy(element), file)
        outer[list(outer).index(inner)] = _attached(node, root, other)


def _other(model: Node, root: Node, depth: int) -> tuple[str, str, Any]:
    """Return the name, file and expanded root element of a model asset."""
    other = read_xml(Path(root.file).parent / model.text("file"), "mujoco")
    name = model.optional("name") or other.optional("model") or Path(other.file).stem
    return name, other.file, expanded(other, depth + 1).element


def _attached(node: Node, root: Node, other: Node) -> Any:
    """Return a frame with bodies of a model, and add its constraints to the root."""
    prefix, angles = node.optional("prefix"), Angles.of(other)
    for element in other.element.iter():
        for key in _NAMES:
            if key in element.attrib:
                element.set(key, prefix + element.get(key))
    held = [body for world in other.children("worldbody") for body in world.element]
    for tag in ("body", "frame"):
        if node.has(tag):
            wanted = prefix + node.text(tag)
            all_of_it = [one for body in held for one in body.iter(tag)]
            held = [one for one in all_of_it if one.get("name") == wanted][:1]
            if not held:
                raise node.bad(
                    tag,
                    f"found {quoted(node.text(tag))}, expected the name of a "
                    f"{tag} of the attached model",
                )
    # only the attached model's own defaults apply to its elements
    for default in [d.element for d in other.children("default")] or [
        Element("default")
    ]:
        default.attrib.update({"class": f"{prefix}main", "attached": "true"})
        root.element.append(default)
    frame = Element("frame", {UNIT: repr(angles.unit), SEQUENCE: angles.sequence})
    frame.set("childclass", f"{prefix}main")
    frame.extend(held)
    for section, tie in _ties_within(other, frame):
        within = Element(section.tag)
        within.append(tie)
        root.element.append(within)
    return frame


def _ties_within(root: Node, part: Any) -> list[tuple[Any, Any]]:
    """Return constraints, tendons and actuators that refer only to inner elements.

    Each is returned together with its section of the file.
    """
    names, ties = {one.get("name") for one in part.iter()}, []
    for section in root.children("tendon", "equality", "actuator"):
        for tie in section.element:
            refers = {
                value
                for one in tie.iter()
                for key, value in one.attrib.items()
                if key in _REFERENCES
            }
            if refers and refers <= names:
                ties.append((section.element, tie))
                names.add(tie.get("name"))
    return ties
