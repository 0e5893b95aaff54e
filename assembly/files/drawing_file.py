"""Robot files of ``format = 2``: bodies and joints by points and axes at home.

The keys are those of ``docs/drawn_robots.md``.
"""

import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.drawing.drawing import (
    Drawing,
    DrawnBody,
    DrawnJoint,
    turned_body,
    turned_joint,
)
from assembly.drawing.parts import joint_axes
from assembly.files.drawn_joint import read_drawn_joint
from assembly.files.drawn_link import Curve, curve_link, read_drawn_link
from assembly.files.written_units import without_units
from assembly.model.largest import LARGEST_LENGTH
from assembly.model.robot import BASE
from forcefit.inputs.table import Table, nearest, quoted
from stiffness.screws import rotation_matrix, transform

MOST_COPIES = 200  # of a leg
_LONGEST_NAME = 200  # characters


@dataclass(frozen=True, eq=False)
class _Copy:
    """A leg's copy, or the robot's own bodies and joints.

    Attributes:
        table: where they are written.
        prefix: of their names, such as ``"leg1."``.
        T: (4, 4) by which points and axes of the table are moved.
    """

    table: Table
    prefix: str
    T: NDArray


def is_drawing(root: Table) -> bool:
    """Whether a robot file is one of bodies and joints."""
    given = set(root.content)
    named = {"body", "joint", "leg"} & given and "frame" not in given
    return root.content.get("format") == 2 or bool(named)


def read_drawing(root: Table, name: str, description: str) -> Drawing:
    """The bodies and joints of a robot file.

    Args:
        root: its root table; keys of other parts of the file are left to the caller.
        name: of the robot.
        description: of it.

    Returns:
        The drawing, legs copied, all names those of the whole robot.

    Raises:
        BadInput: a rule of the format is broken.
    """
    root.content = copy.deepcopy(root.content)  # texts with units become numbers
    if root.get("format", 2) == 1:
        raise root.bad("format", "found 1 in a file of bodies and joints, expected 2")
    platform = root.text("platform", expected="the name of a body")
    without_units(root, "platform_at", "length")
    at = root.array("platform_at", (3,), "m", largest=LARGEST_LENGTH)
    copies = list(_copies(root))
    found = [(body, copied) for copied in copies for body in _bodies(copied)]
    names = [body.name for body, _ in found]
    _check_distinct(root, "body", [BASE, *names])
    joints = [joint for copied in copies for joint in _joints(copied, names)]
    _check_distinct(root, "joint", [BASE, *(joint.name for joint in joints)])
    if platform not in names:
        hint = nearest(platform, names)
        fault = f"found {quoted(platform)}, expected the name of a body{hint}"
        raise root.bad("platform", fault)
    bodies = [
        _with_ends(body, copied, joints, at if body.name == platform else None)
        for body, copied in found
    ]
    return Drawing(name, platform, at, tuple(bodies), tuple(joints), description)


def _copies(root: Table) -> Iterator[_Copy]:
    """Copies of the legs, and the robot's own bodies, in the order of the file."""
    order = [key for key in root.content if key in {"leg", "body", "joint"}]
    own = _Copy(root, "", np.eye(4))
    legs = root.tables("leg")
    for kind in dict.fromkeys("leg" if key == "leg" else "own" for key in order):
        if kind == "own":
            yield own
            continue
        names: list[str] = []
        for leg in legs:
            name = leg.text("name", longest=_LONGEST_NAME)
            leg.place = f"leg {quoted(name)}"
            if name in names:
                raise leg.bad("name", "found it twice, expected different names")
            names.append(name)
            yield from _repeated(leg, name)


def _repeated(leg: Table, name: str) -> Iterator[_Copy]:
    """The copies of one leg; the first is the leg as written."""
    if not leg.has("repeat"):
        yield _Copy(leg, f"{name}.", np.eye(4))
        return
    table = leg.table("repeat")
    count = table.integer("count", least=1)
    if count > MOST_COPIES:
        raise table.bad("count", f"found {count}, expected at most {MOST_COPIES}")
    about = table.array("about", (3,), "direction", largest=LARGEST_LENGTH)
    size = float(np.linalg.norm(about))
    if size < 1e-12:
        raise table.bad("about", "found no direction, expected 3 numbers, not all 0")
    without_units(table, "at", "length")
    at = table.array("at", (3,), "m", np.zeros(3), largest=LARGEST_LENGTH)
    table.finish()
    for k in range(count):
        R = rotation_matrix(about / size * (2 * np.pi * k / count))
        yield _Copy(leg, f"{name}{k + 1}.", transform(at - R @ at, R))


def _bodies(copied: _Copy) -> Iterator[DrawnBody]:
    """The bodies of a copy, their links' ends still to be found."""
    for table in copied.table.tables("body"):
        name = table.text("name", longest=_LONGEST_NAME)
        table.place = _place(copied.table, "body", name)
        if name == BASE:
            raise table.bad(
                "name", f'found "{BASE}", which stands still; expected another'
            )
        without_units(table, "centre", "length")
        link = read_drawn_link(table)
        body = DrawnBody(
            copied.prefix + name,
            mass=table.number("mass", "kg", 0.0, least=0.0, largest=1e40),
            centre=table.array(
                "centre", (3,), "m", np.zeros(3), largest=LARGEST_LENGTH
            ),
            inertia=_inertia(table),
            link=None if isinstance(link, Curve) else link,
        )
        for key in ("from", "to"):
            if table.has(key) and link is None:
                raise table.bad(key, 'found one without "link", expected both')
        table.finish()
        yield turned_body(body, copied.T)


def _place(owner: Table, kind: str, name: str) -> str:
    """Place of a body or a joint in messages."""
    return f"{owner.place + '.' if owner.place else ''}{kind} {quoted(name)}"


def _inertia(table: Table) -> NDArray:
    """(3, 3) [kg m^2] of Ixx, Iyy, Izz, Ixy, Ixz, Iyz, the last three products."""
    if not table.has("inertia"):
        return np.zeros((3, 3))
    xx, yy, zz, xy, xz, yz = table.array("inertia", (6,), "kg m^2", largest=1e40)
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    least, middle, most = np.linalg.eigvalsh(J)
    rounding = 1e-6 * max(most, 0.0)
    if least < -rounding or most > least + middle + rounding:
        raise table.bad(
            "inertia",
            f"found principal moments {least:.4g}, {middle:.4g}, {most:.4g}; expected "
            "none negative, and none larger than the sum of the other two",
        )
    return J


def _joints(copied: _Copy, names: list[str]) -> Iterator[DrawnJoint]:
    """The joints of a copy, between bodies of it or of the whole robot."""

    def find(name: str) -> str | None:
        inner = copied.prefix + name
        return inner if inner in names else name if name in [BASE, *names] else None

    for table in copied.table.tables("joint"):
        name = table.text("name", longest=_LONGEST_NAME)
        table.place = _place(copied.table, "joint", name)
        first, second = _between(table, find, names)
        joint = read_drawn_joint(table, copied.prefix + name, first, second)
        yield turned_joint(joint, copied.T)
    if copied.prefix:
        copied.table.finish()


def _between(
    table: Table, find: Callable[[str], str | None], names: list[str]
) -> list[str]:
    """Full names of the two bodies of a joint."""
    value = table.require("between", 'two names of bodies, or "base"')
    proper = isinstance(value, list) and all(isinstance(v, str) for v in value)
    if not proper or len(value) != 2:
        raise table.bad("between", f"found {value!r:.60}, expected two names of bodies")
    found = []
    for name in value:
        full = find(name)
        if full is None:
            short = [n.rpartition(".")[2] for n in names]
            hint = nearest(name, [*dict.fromkeys([*names, *short]), BASE])
            fault = f'found {quoted(name)}, expected a body or "{BASE}"{hint}'
            raise table.bad("between", fault)
        found.append(full)
    if found[0] == found[1]:
        raise table.bad("between", f"found {quoted(value[0])} twice, expected two")
    return found


def _with_ends(
    body: DrawnBody, copied: _Copy, joints: list[DrawnJoint], point: NDArray | None
) -> DrawnBody:
    """The body with the joints between which its link is.

    Args:
        body: as read.
        copied: where it is written.
        joints: of the whole robot.
        point: (3,) [m] the platform's point if the body is the platform.

    Returns:
        The body; a beam along a curve is a stiffness and a mass.

    Raises:
        BadInput: there are no such joints, or the curve does not lead from one to
            the other.
    """
    table = next(
        t for t in copied.table.tables("body")
        if copied.prefix + t.content["name"] == body.name
    )  # fmt: skip
    table.place = _place(copied.table, "body", table.content["name"])
    link = read_drawn_link(table)
    if link is None:
        return body
    here = {j.name: j for j in joints if body.name in (j.first, j.second)}
    first, second = _ends(table, copied.prefix, list(here), point is not None)
    body = replace(body, ends=(first, second))
    if not isinstance(link, Curve):
        return body
    back = np.linalg.inv(copied.T)
    start = (back @ [*here[first].at, 1.0])[:3]
    if second is None:
        assert point is not None
        end = transform(point, np.eye(3))
    else:
        end = joint_axes(here[second])
    matrix, mass, centre = curve_link(link, start, back @ end)
    centre = (copied.T @ [*centre, 1.0])[:3]
    total = body.mass + mass
    if mass:
        centre = (body.mass * body.centre + mass * centre) / total
        body = replace(body, mass=total, centre=centre)
    return replace(body, link=matrix)


def _ends(
    table: Table, prefix: str, here: list[str], platform: bool
) -> tuple[str, str | None]:
    """Full names of the joints at the two ends of a link."""
    given = [_end(table, key, prefix, here) for key in ("from", "to")]
    left = [name for name in here if name not in given]
    first = given[0] or (left.pop(0) if left else None)
    second = given[1] or (left[0] if left else None)
    if first is None or (second is None and not platform):
        fault = f"found {len(here)} joint of the body" if here else "found no joint"
        raise table.bad("link", f"{fault}, expected two, between which the link is")
    if first == second:
        raise table.bad("to", f"found {quoted(first)} at both ends, expected two")
    return first, second


def _end(table: Table, key: str, prefix: str, here: list[str]) -> str | None:
    """Full name of the joint at one end of a link, None if not given."""
    if not table.has(key):
        return None
    name = table.text(key, expected="the name of a joint")
    for full in (prefix + name, name):
        if full in here:
            return full
    short = [n.removeprefix(prefix) for n in here]
    fault = f"found {quoted(name)}, expected a joint of this body"
    raise table.bad(key, fault + nearest(name, short))


def _check_distinct(root: Table, kind: str, names: list[str]) -> None:
    """Refuse a name that two have."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            fault = f"found {quoted(name)} twice, expected different names"
            raise root.bad(kind, fault)
        seen.add(name)
