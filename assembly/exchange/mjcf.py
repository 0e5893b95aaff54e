"""Import of MJCF: bodies, joints, and equality constraints, which become loops.

Sources:
    MuJoCo documentation, XML reference.  Angles are in degrees unless the compiler
    element specifies radians.  The joints of a body are located at ``pos`` in the body
    and act in the order of the file.  A ``frame`` moves its elements but is not a body.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.coupling import leaders_first
from forcefit.assembly.exchange.drives_and_loops import with_loops
from forcefit.assembly.exchange.loops_file import LoopsFile
from forcefit.assembly.exchange.mechanism import (
    WORLD,
    Body,
    Joint,
    Mechanism,
    body_poses,
    parents_first,
)
from forcefit.assembly.exchange.mjcf_expansion import SEQUENCE, UNIT, expanded
from forcefit.assembly.exchange.mjcf_joint import at_key, one_freedom, several_freedoms
from forcefit.assembly.exchange.mjcf_mass import (
    MassRules,
    body_of,
    shape_mass,
    written_mass,
)
from forcefit.assembly.exchange.mjcf_orientation import Angles, orientation, site_pose
from forcefit.assembly.exchange.mjcf_ties import LOADED, Ties
from forcefit.assembly.exchange.xml_file import Node, counted, placed, read_xml
from forcefit.inputs.errors import nearest, quoted

_ZERO = np.zeros(3)
_KINDS = {"hinge": "revolute", "slide": "prismatic", "ball": "ball", "free": "free"}
_REFUSED = ("composite", "flexcomp", "flex")
_SECTIONS = ("compiler", "option", "size", "statistic", "visual", "asset", "default",
             "custom", "keyframe", "contact", "sensor", "worldbody", "equality",
             "tendon", "actuator")  # fmt: skip
# joint attributes that are converted
_READ = ("name", "type", "pos", "axis", "ref", "class")
_SPRING = ("stiffness", "springref")
_RANGE = ("range", "limited")
_COUNTS = {"ball": 4, "free": 7}  # number of values per joint in a keyframe


@dataclass(frozen=True, eq=False)
class _Place:
    """Coordinate frame, default class and angle conventions of an element."""

    body: str
    offset: NDArray
    childclass: str
    angles: Angles


@dataclass
class _Reading:
    """Data that are collected while the bodies of a file are read."""

    rules: MassRules
    defaults: dict[str, dict[str, dict[str, str]]]
    bodies: dict[str, Body] = field(default_factory=lambda: {WORLD: Body(WORLD)})
    joints: list[Joint] = field(default_factory=list)
    parts: dict[str, list[str]] = field(default_factory=dict)
    sites: dict[str, tuple[str, NDArray]] = field(default_factory=dict)
    extra: dict[str, list[str]] = field(default_factory=dict)
    # type of each joint, in the order of the MuJoCo coordinates ``qpos``
    coordinates: dict[str, str] = field(default_factory=dict)
    number: int = 0  # number of bodies that have been read
    unweighed: list[str] = field(default_factory=list)


def read_mjcf(path: Path | str, loops: LoopsFile | None = None) -> Mechanism:
    """Read an MJCF file.

    Args:
        path: path of the file.  Included and attached files are read as well.
        loops: loops file with additional loops and drives, or None.

    Returns:
        Mechanism.  Its home pose is the keyframe ``home`` if the file contains one.

    Raises:
        BadInput: the file does not comply with the format, or an element is unknown.
    """
    root = expanded(read_xml(path, "mujoco"))
    for node in root.descendants():
        if node.tag in _REFUSED:
            raise node.bad(
                "",
                f"found {node.tag}, which generates bodies; expected rigid "
                "bodies written out in the file",
            )
    reading = _Reading(MassRules.of(root), _defaults(root))
    if root.child("worldbody") is None:
        raise root.bad("worldbody", "missing; expected bodies")
    for world in root.children("worldbody"):
        _walk(world, _Place(WORLD, np.eye(4), "main", Angles.of(root)), reading)
    for node in root.children():
        if node.tag not in _SECTIONS:
            reading.extra.setdefault(f"element {node.tag}", []).append("")
    base, order = parents_first(reading.joints, reading.bodies, str(path))
    mechanism = Mechanism(
        name=root.text("model", Path(path).stem), root=base,
        bodies=reading.rules.applied(reading.bodies), joints=order,
    )  # fmt: skip
    rests = {j.name: j.position for j in order if j.name in reading.coordinates}
    equality = reading.defaults["main"].get("equality", {})
    ties = Ties(root, equality, reading.sites, rests, reading.parts, reading.extra)
    # MuJoCo evaluates constraints in the initial pose, not in a keyframe
    closed = tuple(ties.loops(body_poses(mechanism, mechanism.home)))
    driven = ties.driven()
    couplings = leaders_first(list(ties.couplings(driven)), str(path))
    ties.tendons()
    joints = _at_key(root, reading, order)
    left_out = tuple(line for k, v in reading.extra.items() for line in counted(k, v))
    free = [name for name, kind in reading.coordinates.items() if kind == "free"]
    floating = counted("free joints without a loop to the ground", free)
    unweighed = tuple(reading.unweighed)
    # masses can be scaled to the total mass only if all are known
    if unweighed and reading.rules.total > 0:
        unweighed = tuple(name for name in reading.bodies if name != WORLD)
    mechanism = replace(
        mechanism, joints=joints, loops=closed, left_out=left_out, couplings=couplings,
        platform=_platform(root, reading), unweighed=unweighed,
        taken=() if closed else floating,
    )  # fmt: skip
    return with_loops(mechanism, loops, reading.parts, driven)


def _platform(root: Node, reading: _Reading) -> str | None:
    """Return the name of the platform from ``<custom><text name="platform">``."""
    for group in root.children("custom"):
        for text in group.children("text"):
            if text.text("name") == "platform" and text.text("data") in reading.bodies:
                return text.text("data")
    return None


def _defaults(root: Node) -> dict[str, dict[str, dict[str, str]]]:
    """Return the default attributes by class and tag, including inherited ones."""
    classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}

    def gather(node: Node, inherited: dict[str, dict[str, str]], name: str) -> None:
        own = {tag: dict(values) for tag, values in inherited.items()}
        for inner in node.children():
            if inner.tag != "default":
                # the tag ``equality`` contains the defaults of all constraint types
                own.setdefault(inner.tag, {}).update(inner.element.attrib)
        classes[name] = own
        for inner in node.children("default"):
            gather(inner, own, inner.text("class"))

    for node in root.children("default"):
        name = node.text("class", "main")
        attached = node.has("attached")
        gather(node, {} if attached else classes["main"], name)
        if not attached:  # the outermost default class is also named "main"
            classes["main"] = classes[name]
    return classes


def _filled(node: Node, childclass: str, reading: _Reading) -> Node:
    """Return an element that includes the default attributes of its class."""
    name = node.text("class", childclass)
    if name not in reading.defaults:
        hint = nearest(name, reading.defaults)
        raise node.bad("class", f"found {quoted(name)}, expected a default class{hint}")
    given = {**reading.defaults[name].get(node.tag, {}), **node.element.attrib}
    element = type(node.element)(node.element.tag, given)
    element.extend(list(node.element))
    return replace(node, element=element)


def _inside(frame: Node, place: _Place) -> _Place:
    """Return the coordinate frame of the elements inside an MJCF ``frame``."""
    T = place.offset @ _pose(frame, place.angles)
    angles = place.angles
    if frame.has(UNIT):  # the frame comes from an attached model
        angles = Angles(frame.number(UNIT, "rad"), frame.text(SEQUENCE))
    return _Place(place.body, T, frame.text("childclass", place.childclass), angles)


def _elements(node: Node, place: _Place) -> Iterator[tuple[Node, _Place]]:
    """Yield the elements of a body in order, including those inside frames."""
    for inner in node.children():
        if inner.tag == "frame":
            yield from _elements(inner, _inside(inner, place))
        else:
            yield inner, place


def _walk(node: Node, place: _Place, reading: _Reading) -> None:
    """Read the child bodies and sites of a body, and record unknown elements."""
    for inner, at in _elements(node, place):
        if inner.tag == "body":
            _add_body(inner, at, reading)
        elif inner.tag == "site":
            site = _filled(inner, at.childclass, reading)
            if site.has("name"):
                T = at.offset @ site_pose(site, at.angles)
                reading.sites[site.text("name")] = at.body, T
        elif inner.tag not in {"joint", "freejoint", "inertial"}:
            name = inner.text("name", "")
            reading.extra.setdefault(inner.tag, []).append(name)


def _add_body(node: Node, at: _Place, reading: _Reading) -> None:
    """Add a body, its joints and its child bodies."""
    reading.number += 1
    name = node.optional("name") or f"body{reading.number}"
    if name in reading.bodies:
        raise node.bad("name", "found this name twice; expected unique names")
    childclass = node.text("childclass", at.childclass)
    place = _Place(name, np.eye(4), childclass, at.angles)
    reading.bodies[name] = _massive(node, place, reading)
    freedoms = list(_freedoms(node, place, reading))
    T = at.offset @ _pose(node, at.angles)
    if not freedoms:
        reading.joints.append(Joint(f"{name}.joint", "fixed", at.body, name, T))
    on = at.body
    for i, joint in enumerate(freedoms):
        last = i == len(freedoms) - 1
        child = name if last else f"{joint.name}.after"
        if not last:
            reading.bodies[child] = Body(child)
        placement = T @ joint.placement if i == 0 else joint.placement
        reading.joints.append(
            replace(joint, parent=on, child=child, placement=placement)
        )
        on = child
    _walk(node, place, reading)


def _massive(node: Node, place: _Place, reading: _Reading) -> Body:
    """Return a body with its mass, which is explicit or computed from shapes."""
    written, shapes = None, []
    for inner, at in _elements(node, place):
        if inner.tag == "inertial":
            written = written_mass(inner, at.offset, at.angles)
        elif inner.tag == "geom":
            geom = _filled(inner, at.childclass, reading)
            T = at.offset @ site_pose(geom, at.angles)
            made = shape_mass(geom, T, reading.rules)
            if made is not None:
                shapes.append(made)
            elif place.body not in reading.unweighed:
                reading.unweighed.append(place.body)
    kind = reading.rules.from_shapes
    if kind == "false" or (written is not None and kind == "auto"):
        reading.unweighed = [one for one in reading.unweighed if one != place.body]
    return body_of(place.body, written, shapes, reading.rules)


def _freedoms(node: Node, place: _Place, reading: _Reading) -> Iterator[Joint]:
    """Yield the joints of a body, one for each degree of freedom."""
    number = 0
    for inner, at in _elements(node, place):
        if inner.tag not in {"joint", "freejoint"}:
            continue
        number += 1
        given = _filled(inner, at.childclass, reading)
        name = given.optional("name") or f"{place.body}.joint{number}"
        if name in reading.parts:
            raise inner.bad("name", "found this name twice; expected unique names")
        kind = "free"
        if inner.tag == "joint":
            kind = _KINDS[given.choice("type", tuple(_KINDS), "hinge")]
            simple = kind != "ball" and len(given.optional("stiffness").split()) < 2
            read = (*_READ, *_SPRING) if simple else _READ
            read = read if kind == "ball" else (*read, *_RANGE)
            for key in given.element.attrib:
                if key not in read:
                    what = f"joint {key}{LOADED if key in _SPRING else ''}"
                    reading.extra.setdefault(what, []).append(name)
        reading.coordinates[name] = kind
        if kind in _COUNTS:
            several = several_freedoms(given, name, kind, at.offset)
        else:
            several = [one_freedom(given, name, kind, at.offset, at.angles)]
        reading.parts[name] = [joint.name for joint in several]
        yield from several


def _pose(node: Node, angles: Angles) -> NDArray:
    """Return the pose of an element from ``pos`` and its orientation, (4, 4)."""
    return placed(node.numbers("pos", 3, "m", _ZERO), orientation(node, angles))


def _at_key(
    root: Node, reading: _Reading, joints: tuple[Joint, ...]
) -> tuple[Joint, ...]:
    """Set the home coordinates of joints from the keyframe ``home``."""
    keys = [k for group in root.children("keyframe") for k in group.children("key")]
    counts = {name: _COUNTS.get(kind, 1) for name, kind in reading.coordinates.items()}
    for key in keys:
        if key.optional("name") != "home" or not key.has("qpos"):
            reading.extra.setdefault("key", []).append(key.optional("name"))
            continue
        values = key.numbers("qpos", sum(counts.values()), "rad or m")
        place = {joint.name: i for i, joint in enumerate(joints)}
        moved, at = list(joints), 0
        for name, count in counts.items():
            i = place[reading.parts[name][0]]
            moved[i] = at_key(key, moved[i], values[at : at + count])
            at += count
        joints = tuple(moved)
    return joints
