"""Reading of robot files with ``format = 2``: bodies and joints in the home pose.

The keys are described in ``docs/drawn_robots.md``.
"""

import copy
from collections.abc import Callable, Iterator

import numpy as np

from forcefit.assembly.drawing.drawing import (
    Drawing,
    DrawnJoint,
    turned_joint,
)
from forcefit.assembly.files.bolt_file import bolt_without_units
from forcefit.assembly.files.callout_file import read_drawn_callouts
from forcefit.assembly.files.drawn_body import (
    LONGEST_NAME,
    Copy,
    link_remarks,
    mass_remarks,
    place_of,
    read_bodies,
    with_ends,
)
from forcefit.assembly.files.drawn_joint import read_drawn_joint
from forcefit.assembly.files.form_file import forms_of_joints, widen_clearance
from forcefit.assembly.files.written_units import without_units
from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.assembly.model.robot import BASE
from forcefit.inputs.table import Table, describe, nearest, quoted
from forcefit.stiffness.screws import rotation_matrix, transform

MOST_COPIES = 200  # maximum number of copies of a leg


def is_drawing(root: Table) -> bool:
    """Return whether a robot file has format 2 (bodies and joints)."""
    given = set(root.content)
    named = {"body", "joint", "leg"} & given and "frame" not in given
    return root.content.get("format") == 2 or bool(named)


def read_drawing(root: Table, name: str, description: str) -> Drawing:
    """Read the bodies and joints of a robot file.

    Args:
        root: root table of the file.  Only the keys of bodies and joints are read.
        name: name of the robot.
        description: description of the robot.

    Returns:
        Bodies and joints, with full names and all copies of the legs.

    Raises:
        BadInput: the file is invalid.
    """
    # texts with units are replaced by numbers in a copy
    root.content = copy.deepcopy(root.content)
    if root.get("format", 2) == 1:
        raise root.bad("format", "found 1 in a file with bodies and joints, expected 2")
    platform = root.text("platform", expected="the name of a body")
    without_units(root, "platform_at", "length")
    at = root.array("platform_at", (3,), "m", largest=LARGEST_LENGTH)
    _check_lists(root, ("body", "joint", "leg", "tolerance", "effect"))
    copies = list(_copies(root))
    found = [(body, copied) for copied in copies for body in read_bodies(copied)]
    names = [body.name for body, _ in found]
    _check_distinct(root, "body", [BASE, *names])
    forms = forms_of_joints(copies)
    kinds = {
        f"{copied.prefix}{table.content.get('name')}": str(table.content.get("type"))
        for copied in copies for table in copied.table.tables("joint")
    }  # fmt: skip
    joints = [
        joint for copied in copies for joint in _joints(copied, names, forms, kinds)
    ]
    _check_distinct(root, "joint", [BASE, *(joint.name for joint in joints)])
    if platform not in names:
        hint = nearest(platform, names)
        fault = f"found {quoted(platform)}, expected the name of a body{hint}"
        raise root.bad("platform", fault)
    bodies = [
        with_ends(body, copied, joints, at if body.name == platform else None)
        for body, copied in found
    ]
    remarks = (
        *link_remarks(bodies, joints, copies), *mass_remarks(copies),
        *_form_remarks(forms),
    )  # fmt: skip
    callouts = [
        callout for copied in copies
        for callout in read_drawn_callouts(copied, bodies, joints)
    ]  # fmt: skip
    return Drawing(
        name, platform, at, tuple(bodies), tuple(joints), description, remarks,
        tuple(callouts),
    )  # fmt: skip


def _check_lists(table: Table, valid: tuple[str, ...]) -> None:
    """Check that the names of all lists of tables are valid."""
    for key, value in table.content.items():
        listed = isinstance(value, list) and value and isinstance(value[0], dict)
        if listed and key not in valid:
            raise table.bad("", f"unknown key {quoted(key)}{nearest(key, valid)}")


def _copies(root: Table) -> Iterator[Copy]:
    """Yield the copies of the legs and the bodies outside legs, in file order."""
    order = [key for key in root.content if key in {"leg", "body", "joint"}]
    own = Copy(root, "", np.eye(4))
    legs = root.tables("leg")
    for kind in dict.fromkeys("leg" if key == "leg" else "own" for key in order):
        if kind == "own":
            yield own
            continue
        names: list[str] = []
        for leg in legs:
            name = leg.text("name", longest=LONGEST_NAME)
            leg.place = f"leg {quoted(name)}"
            if name in names:
                raise leg.bad(
                    "name", "found the same name twice, expected different names"
                )
            names.append(name)
            _check_lists(leg, ("body", "joint"))
            yield from _repeated(leg, name)


def _repeated(leg: Table, name: str) -> Iterator[Copy]:
    """Yield the copies of a leg, which are rotated about an axis."""
    if not leg.has("repeat"):
        yield Copy(leg, f"{name}.", np.eye(4))
        return
    table = leg.table("repeat")
    count = table.integer("count", least=1)
    if count > MOST_COPIES:
        raise table.bad("count", f"found {count}, expected at most {MOST_COPIES}")
    about = table.array("about", (3,), "direction", largest=LARGEST_LENGTH)
    size = float(np.linalg.norm(about))
    if size < 1e-12:
        raise table.bad(
            "about", "found a zero vector, expected a nonzero direction vector"
        )
    without_units(table, "at", "length")
    at = table.array("at", (3,), "m", np.zeros(3), largest=LARGEST_LENGTH)
    table.finish()
    for k in range(count):
        R = rotation_matrix(about / size * (2 * np.pi * k / count))
        yield Copy(leg, f"{name}{k + 1}.", transform(at - R @ at, R))


def _joints(
    copied: Copy, names: list[str], forms: dict[str, tuple[str, float]],
    kinds: dict[str, str],
) -> Iterator[DrawnJoint]:  # fmt: skip
    """Yield the joints of a copy of a leg, or the joints outside legs."""

    def find(name: str) -> str | None:
        inner = copied.prefix + name
        return inner if inner in names else name if name in [BASE, *names] else None

    for table in copied.table.tables("joint"):
        name = table.text("name", longest=LONGEST_NAME)
        table.place = place_of(copied.table, "joint", name)
        first, second = _between(table, find, names)
        if copied.prefix + name in forms:
            widen_clearance(table, *forms[copied.prefix + name])
        bolt_without_units(table, kinds)
        joint = read_drawn_joint(table, copied.prefix + name, first, second)
        yield turned_joint(joint, copied.T)
    if copied.prefix:
        copied.table.finish()


def _between(
    table: Table, find: Callable[[str], str | None], names: list[str]
) -> list[str]:
    """Return the full names of the two bodies that a joint connects."""
    value = table.require("between", 'two names of bodies, or "base"')
    proper = isinstance(value, list) and all(isinstance(v, str) for v in value)
    if not proper or len(value) != 2:
        raise table.bad(
            "between", f"found {describe(value)}, expected two names of bodies"
        )
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
        fault = f"found {quoted(value[0])} twice, expected two bodies"
        raise table.bad("between", fault)
    return found


def _form_remarks(forms: dict[str, tuple[str, float]]) -> tuple[str, ...]:
    """Return a remark on clearances that are increased by form tolerances."""
    texts = [
        f"{quoted(joint)} by {added * 1e6:.4g} um ({word})"
        for joint, (word, added) in forms.items()
    ]
    return (
        (f"clearances increased by form tolerances: {'; '.join(texts)}",)
        if texts
        else ()
    )


def _check_distinct(root: Table, kind: str, names: list[str]) -> None:
    """Check that all names are different."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            fault = f"found {quoted(name)} twice, expected different names"
            raise root.bad(kind, fault)
        seen.add(name)
