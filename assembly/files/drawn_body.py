"""Reading of bodies in robot files with ``format = 2``."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.drawing.drawing import DrawnBody, DrawnJoint, turned_body
from forcefit.assembly.drawing.parts import joint_axes
from forcefit.assembly.files.drawn_link import Curve, curve_link, read_drawn_link
from forcefit.assembly.files.inertia_file import read_inertia
from forcefit.assembly.files.written_units import without_units
from forcefit.assembly.model.inertia import joined_bodies
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.robot import BASE
from forcefit.inputs.table import Table, nearest, quoted
from forcefit.stiffness.screws import transform

LONGEST_NAME = 200  # [characters] maximum length of a name


@dataclass(frozen=True, eq=False)
class Copy:
    """Copy of a leg, or the bodies and joints outside legs.

    Attributes:
        table: table that contains the bodies and joints.
        prefix: prefix of their names, for example ``"leg1."``.
        T: transform from the leg in the table to the copy, (4, 4).
    """

    table: Table
    prefix: str
    T: NDArray


def read_bodies(copied: Copy) -> Iterator[DrawnBody]:
    """Yield the bodies of a copy, without the joints at the ends of links."""
    for table in copied.table.tables("body"):
        name = table.text("name", longest=LONGEST_NAME)
        table.place = place_of(copied.table, "body", name)
        if name == BASE:
            raise table.bad(
                "name", f'found "{BASE}", which is reserved; expected a different name'
            )
        without_units(table, "centre", "length")
        link = read_drawn_link(table)
        body = DrawnBody(
            copied.prefix + name,
            mass=table.number("mass", "kg", 0.0, least=0.0, largest=1e40),
            centre=table.array(
                "centre", (3,), "m", np.zeros(3), largest=LARGEST_LENGTH
            ),
            inertia=read_inertia(table),
            link=None if isinstance(link, Curve) else link,
        )
        for key in ("from", "to"):
            if table.has(key) and link is None:
                raise table.bad(
                    key, 'found a joint, but no "link"; expected both or neither'
                )
        table.tables("tolerance")  # marked as known; read when all joints are known
        table.finish()
        yield turned_body(body, copied.T)


def place_of(owner: Table, kind: str, name: str) -> str:
    """Return the position of a body or joint in the file, for error messages."""
    return f"{owner.place + '.' if owner.place else ''}{kind} {quoted(name)}"


def with_ends(
    body: DrawnBody, copied: Copy, joints: list[DrawnJoint], point: NDArray | None
) -> DrawnBody:
    """Set the joints at both ends of the link of a body.

    Args:
        body: body that was read from the file.
        copied: copy of a leg that contains the body.
        joints: all joints of the robot.
        point: reference point of the platform, (3,) [m]; None for other bodies.

    Returns:
        Body with these joints.  A curved beam is replaced by its stiffness matrix and
        mass.

    Raises:
        BadInput: a joint does not exist, or the curve does not connect both joints.
    """
    table = next(
        t for t in copied.table.tables("body")
        if copied.prefix + t.content["name"] == body.name
    )  # fmt: skip
    table.place = place_of(copied.table, "body", table.content["name"])
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
    matrix, mass, centre, J = curve_link(link, start, back @ end)
    centre, R = (copied.T @ [*centre, 1.0])[:3], copied.T[:3, :3]
    if mass:
        own = body.mass, body.centre, body.inertia
        total, middle, whole = joined_bodies([own, (mass, centre, R @ J @ R.T)])
        body = replace(body, mass=total, centre=middle, inertia=whole)
    return replace(body, link=matrix)


def _ends(
    table: Table, prefix: str, here: list[str], platform: bool
) -> tuple[str, str | None]:
    """Return the full names of the joints at both ends of a link."""
    given = [_end(table, key, prefix, here) for key in ("from", "to")]
    left = [name for name in here if name not in given]
    first = given[0] or (left.pop(0) if left else None)
    second = given[1] or (left[0] if left else None)
    if first is None or (second is None and not platform):
        fault = f"found {len(here)} joint of the body" if here else "found no joint"
        raise table.bad("link", f"{fault}, expected two joints at the ends of the link")
    if first == second:
        raise table.bad(
            "to", f"found {quoted(first)} at both ends, expected two joints"
        )
    return first, second


def _end(table: Table, key: str, prefix: str, here: list[str]) -> str | None:
    """Return the full name of the joint at an end of a link, or None."""
    if not table.has(key):
        return None
    name = table.text(key, expected="the name of a joint")
    for full in (prefix + name, name):
        if full in here:
            return full
    short = [n.removeprefix(prefix) for n in here]
    fault = f"found {quoted(name)}, expected a joint of this body"
    raise table.bad(key, fault + nearest(name, short))


def link_remarks(
    bodies: list[DrawnBody], joints: list[DrawnJoint], copies: list[Copy]
) -> tuple[str, ...]:
    """Return a remark on links whose end joints are not specified in the file."""
    stated = {
        copied.prefix + table.content["name"]
        for copied in copies
        for table in copied.table.tables("body")
        if {"from", "to"} & set(table.content)
    }
    texts = []
    for body in bodies:
        count = sum(body.name in (j.first, j.second) for j in joints)
        if body.ends and count > 2 and body.name not in stated:
            ends = " to ".join(quoted(end) for end in body.ends if end)
            texts.append(f"{quoted(body.name)} from {ends}")
    return (
        (f"links between the first two joints of a body: {', '.join(texts)}",)
        if texts
        else ()
    )


def mass_remarks(copies: list[Copy]) -> tuple[str, ...]:
    """Return a remark on masses whose centre is not specified."""
    names = [
        quoted(copied.prefix + table.content["name"])
        for copied in copies
        for table in copied.table.tables("body")
        if table.content.get("mass") and "centre" not in table.content
    ]
    fault = 'masses without "centre", which act at the origin of the base'
    return (f"{fault}: {', '.join(names)}",) if names else ()
