"""Import of equality constraints, tendons and actuators from MJCF.

Sources:
    MuJoCo documentation, XML reference, equality.  ``connect`` and ``weld`` constrain
    points or frames that coincide in the initial configuration, unless the element
    specifies sites or ``relpose``.  In a weld, the frame at ``anchor`` on ``body2``
    coincides with the frame ``relpose`` on ``body1``.  A ``joint`` constraint is
    joint1 = rest1 + polynomial in (joint2 - rest2).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.coupling import Coupling
from forcefit.assembly.exchange.mechanism import (
    WORLD,
    Loop,
)
from forcefit.assembly.exchange.orientation import from_quaternion
from forcefit.assembly.exchange.xml_file import Node, placed
from forcefit.inputs.errors import nearest, quoted
from forcefit.stiffness.screws import transform

LOADED = ", not converted, though it may carry load"
_DRIVEN_BY = ("joint", "jointinparent")


@dataclass
class Ties:
    """Constraints of a file, and elements of the file that are not converted.

    Attributes:
        root: root element ``<mujoco>``.
        defaults: default attributes of ``equality``.
        sites: body of each site, and pose of the site relative to it, (4, 4), by name.
        rests: coordinate of each joint in the initial configuration [rad or m].
        parts: elementary joints, by the name of the joint in the file.
        extra: names of elements that are not converted, by the kind of the element.
    """

    root: Node
    defaults: Mapping[str, str]
    sites: Mapping[str, tuple[str, NDArray]]
    rests: Mapping[str, float]
    parts: Mapping[str, list[str]]
    extra: dict[str, list[str]] = field(default_factory=dict)

    def leave_out(self, what: str, name: str) -> None:
        """Record an element that is not converted."""
        self.extra.setdefault(what, []).append(name)

    @cached_property
    def equalities(self) -> list[Node]:
        """Active constraints; inactive constraints are not converted."""
        given = [n for g in self.root.children("equality") for n in g.children()]
        default = self.defaults.get("active", "true")
        off = [node for node in given if node.element.get("active", default) == "false"]
        for node in off:
            self.leave_out(f"equality {node.tag}, not active", _name(node))
        return [node for node in given if node not in off]

    def loops(self, poses: Mapping[str, NDArray]) -> Iterator[Loop]:
        """Yield the loops of ``connect`` and ``weld`` constraints.

        Args:
            poses: poses of all bodies in the initial configuration, (4, 4).

        Yields:
            The loops.

        Raises:
            BadInput: a body or site does not exist, or a body is connected to itself.
        """
        names: set[str] = set()
        for count, node in enumerate(self.equalities, 1):
            if node.tag in {"tendon", "joint"}:
                continue
            if node.tag not in {"connect", "weld"}:
                raise node.bad(
                    "",
                    "found another constraint, expected connect, weld, joint or tendon",
                )
            name = node.optional("name") or f"loop{count}"
            if name in names:
                raise node.bad("name", "found this name twice; expected unique names")
            names.add(name)
            loop = self._loop(node, name, poses)
            if loop.first == loop.second:
                found = f"found {quoted(loop.first)} twice, expected two bodies"
                raise node.bad("", found)
            yield loop

    def _loop(self, node: Node, name: str, poses: Mapping[str, NDArray]) -> Loop:
        """Return the loop of a ``connect`` or ``weld`` constraint."""
        point = node.tag == "connect"
        # a weld with zero torque scale constrains only its anchor point
        point |= node.number("torquescale", "-", 1.0) == 0.0
        if node.has("site1"):
            (a, A), (b, B) = (
                _known(node, key, self.sites) for key in ("site1", "site2")
            )
            return Loop(name, a, b, A, B, point)
        bodies = {body: body for body in poses}
        a = _known(node, "body1", bodies)
        b = _known(node, "body2", bodies) if node.has("body2") else WORLD
        if node.tag == "connect":
            A = placed(node.numbers("anchor", 3, "m"), np.eye(3))
            there = np.linalg.inv(poses[b]) @ poses[a] @ A
            return Loop(name, a, b, A, transform(there[:3, 3], np.eye(3)), point)
        B = placed(node.numbers("anchor", 3, "m", np.zeros(3)), np.eye(3))
        given = node.numbers("relpose", 7, "m, -", np.zeros(7))
        if given[3:].any():
            A = placed(given[:3], from_quaternion(given[3:]))
        else:
            A = np.linalg.inv(poses[a]) @ poses[b] @ B
        return Loop(name, a, b, A, B, point)

    def couplings(self, driven: set[str]) -> Iterator[Coupling]:
        """Yield the couplings of ``joint`` constraints.

        Args:
            driven: joints with an actuator.

        Yields:
            The couplings.  A linear coupling is inverted if only the follower is
            driven.

        Raises:
            BadInput: a joint does not exist or has several degrees of freedom.
        """
        for node in self.equalities:
            if node.tag != "joint":
                continue
            keys = [key for key in ("joint1", "joint2") if node.has(key)]
            first, *second = [
                _known(node, key, {name: name for name in self.rests}) for key in keys
            ] or [node.text("joint1")]
            leader = second[0] if second else None
            c = _polynomial(node)
            rest = self.rests[first]
            other = 0.0 if leader is None else self.rests[leader]
            rules = c if leader is not None else c[:1]
            turned = leader is not None and first in driven and leader not in driven
            if turned and c[1] and not any(c[2:]):
                yield Coupling(
                    str(leader), first, (-c[0] / c[1], 1 / c[1]), other, rest
                )
            else:
                while len(rules) > 1 and not rules[-1]:
                    rules.pop()
                yield Coupling(first, leader, tuple(rules), rest, other)

    def driven(self) -> set[str]:
        """Return the driven joints, and record actuators that do not drive a joint."""
        names = set()
        for group in self.root.children("actuator"):
            for node in group.children():
                key = next((key for key in _DRIVEN_BY if node.has(key)), None)
                if key is None:
                    held = [k for k in ("tendon", "site", "body", "cranksite")
                            if node.has(k)]  # fmt: skip
                    what = f"actuator of a {held[0] if held else node.tag}{LOADED}"
                    self.leave_out(what, _name(node, held))
                    continue
                name = node.text(key)
                if name not in self.parts:
                    hint = nearest(name, self.parts)
                    raise self.root.bad(
                        "actuator", f"found {quoted(name)}, expected a joint{hint}"
                    )
                names.add(name)
        return names

    def tendons(self) -> None:
        """Record tendons and their constraints, which are not converted."""
        for group in self.root.children("tendon"):
            for node in group.children():
                self.leave_out(f"tendon{LOADED}", f"{node.tag} {_name(node)}".strip())
        for node in self.equalities:
            if node.tag == "tendon":
                self.leave_out(f"equality tendon{LOADED}", _name(node, ["tendon1"]))


def _polynomial(node: Node) -> list[float]:
    """Return the five coefficients of the polynomial of a joint constraint."""
    count = len(node.optional("polycoef").split())
    default = [0.0, 1.0, 0.0, 0.0, 0.0]
    if not count:
        return default
    given = node.numbers("polycoef", min(count, 5), "-").tolist()
    return [*given, *default[count:]]


def _name(node: Node, keys: "list[str] | tuple[str, ...]" = ()) -> str:
    """Return the name of an element, or the name in one of the given attributes."""
    found = (node.optional(key) for key in ("name", *keys))
    return next((name for name in found if name), "")


def _known(node: Node, key: str, valid: Mapping[str, Any]) -> Any:
    """Return the object whose name is given by an attribute."""
    name = node.text(key)
    if name not in valid:
        raise node.bad(key, f"found {quoted(name)}{nearest(name, valid)}")
    return valid[name]
