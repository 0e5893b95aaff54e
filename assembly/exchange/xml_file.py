"""Reader of XML files: no entities, no other file, and one message per mistake."""

import re
from collections.abc import Container, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.inputs.errors import BadInput, describe, nearest, one_line, quoted
from forcefit.inputs.table import read_text
from forcefit.stiffness.screws import transform

_DEEPEST = 200  # largest depth of nested elements
# comments, which may contain "--" in some files, and declarations in a wrong place
_SKIPPED = re.compile(
    r"<!\[CDATA\[.*?(?:\]\]>|\Z)|<!--.*?(?:-->|\Z)|<\?xml\s[^<>]*>", re.S
)

_ENDLESS = 1e3  # [rad or m] larger limits are not binding


@dataclass(frozen=True)
class Node:
    """An element of an XML file, with its position for messages.

    Attributes:
        element: element of :mod:`xml.etree.ElementTree`.
        file: its file's name.
    """

    element: Any
    file: str

    @property
    def tag(self) -> str:
        """Its name."""
        return str(self.element.tag)

    @property
    def place(self) -> str:
        """Its tag and its own ``name``, for messages."""
        name = self.element.get("name")
        return self.tag if name is None else f"{self.tag} {quoted(name)}"

    def bad(self, key: str, message: str) -> BadInput:
        """Return an error for an attribute of this element, for the caller to raise."""
        place = f"{self.place}.{key}" if key else self.place
        return BadInput(f"{self.file}: {place}: {message}")

    def children(self, *tags: str) -> Iterator["Node"]:
        """Yield inner elements of these names; all if no name is given."""
        for element in self.element:
            if not tags or element.tag in tags:
                yield Node(element, self.file)

    def descendants(self) -> Iterator["Node"]:
        """Yield this element and all inner elements, at any depth."""
        for element in self.element.iter():
            yield Node(element, self.file)

    @property
    def content(self) -> str:
        """Text of the element without blanks around it."""
        return (self.element.text or "").strip()

    def names_in(self, valid: Container[str]) -> list[str]:
        """Return the valid names in the element's attributes and texts, in order."""
        found: dict[str, None] = {}
        for node in self.descendants():
            words = [*node.element.attrib.values(), node.content]
            found |= {word: None for word in map(str.strip, words) if word in valid}
        return list(found)

    def child(self, tag: str) -> "Node | None":
        """Return the first inner element of this name, None without one."""
        return next(self.children(tag), None)

    def has(self, key: str) -> bool:
        """Return whether an attribute exists."""
        return self.element.get(key) is not None

    def optional(self, key: str) -> str:
        """Return an attribute's text without blanks around it, empty if absent."""
        return str(self.element.get(key, "")).strip()

    def text(self, key: str, default: str | None = None) -> str:
        """Return an attribute's text.

        Args:
            key: its name.
            default: value of an absent attribute, which is an error without a default.

        Returns:
            The text without blanks around it.

        Raises:
            BadInput: absent without a default, or empty.
        """
        value = self.element.get(key, default)
        if value is None or not (value.strip() or value == default):
            raise self.bad(key, "missing; expected a text")
        return str(value).strip()

    def choice(self, key: str, valid: tuple[str, ...], default: str) -> str:
        """Return an attribute that is one of a few words."""
        value = self.text(key, default)
        if value not in valid:
            names = " | ".join(valid)
            hint = nearest(value, valid)
            hint = hint if "did you mean" in hint else ""
            raise self.bad(key, f"found {describe(value)}, expected {names}{hint}")
        return value

    def numbers(
        self, key: str, count: int, unit: str, default: NDArray | None = None
    ) -> NDArray:
        """Return the finite numbers of an attribute, between blanks.

        Args:
            key: its name; empty for the element's own text.
            count: number of values.
            unit: unit for the error message.
            default: values of an absent attribute, which is an error without a default.

        Returns:
            (count,) numbers.

        Raises:
            BadInput: absent without a default, a wrong number of values, not finite or
                too large.
        """
        text = self.element.get(key) if key else self.element.text or ""
        expected = f"expected {count} finite number{'s' * (count > 1)} [{unit}]"
        if text is None:
            if default is None:
                raise self.bad(key, f"missing; {expected}")
            return default
        try:
            values = np.array([float(part) for part in text.split()])
        except ValueError:
            values = np.empty(0)
        if values.shape != (count,) or not (np.abs(values) <= LARGEST_LENGTH).all():
            raise self.bad(key, f"found {describe(text.strip())}, {expected}")
        return values

    def number(self, key: str, unit: str, default: float | None = None) -> float:
        """Return one finite number of an attribute; see :meth:`numbers`."""
        given = None if default is None else np.array([default])
        return float(self.numbers(key, 1, unit, given)[0])

    def limits(
        self, lower: str | None, upper: str | None, unit: float = 1.0
    ) -> tuple[float, float] | None:
        """Return the least and largest coordinate of a joint from two texts.

        Args:
            lower: a number, infinite or of any size; None if absent.
            upper: a number, infinite or of any size; None if absent.
            unit: factor of both.

        Returns:
            Both [rad or m], 1e6 for an absent or larger one; None if neither is
            binding, or if their range is empty.

        Raises:
            BadInput: a text is no number.
        """
        ends = []
        for text, far in ((lower, -LARGEST_LENGTH), (upper, LARGEST_LENGTH)):
            try:
                value = far if text is None else unit * float(text)
            except ValueError:
                value = np.nan
            if np.isnan(value):
                raise self.bad("", f"found {describe(text)}, expected a number")
            ends.append(float(np.clip(value, -LARGEST_LENGTH, LARGEST_LENGTH)))
        binds = ends[0] > -_ENDLESS or ends[1] < _ENDLESS
        return (ends[0], ends[1]) if binds and ends[0] < ends[1] else None

    def unit_vector(self, key: str, default: NDArray | None = None) -> NDArray:
        """Return the (3,) direction of an attribute, of length 1."""
        vector = self.numbers(key, 3, "-", default)
        length = float(np.linalg.norm(vector))
        if length < 1e-9:
            raise self.bad(key, f"found {describe(vector.tolist())}, not a direction")
        # a vector of length 1 to rounding is not changed
        return vector if abs(length - 1.0) < 1e-15 else vector / length


def read_xml(path: Path | str, *roots: str) -> Node:
    """Return the root element of an XML file, as tolerantly as other readers.

    Args:
        path: the file.
        roots: names that its root element may have.

    Returns:
        The element.  Namespaces are not resolved: a name keeps its prefix, and
        ``xmlns`` has no effect.

    Raises:
        BadInput: the file cannot be read, is not XML, declares entities or a document
            type, or is something else.
    """
    text = _SKIPPED.sub(_blank_lines, read_text(path))
    element = _parsed(text, path)
    if element.tag not in roots:
        tag = quoted(str(element.tag))
        expected = " or ".join(roots)
        raise BadInput(f"{path}: found the root element {tag}, expected {expected}")
    layer, depth = [element], 0
    while layer:
        layer, depth = [inner for outer in layer for inner in outer], depth + 1
        if depth > _DEEPEST:
            raise BadInput(
                f"{path}: found elements nested more than {_DEEPEST} deep, "
                f"expected at most {_DEEPEST}"
            )
    return Node(element, str(path))


def _parsed(text: str, path: Path | str) -> Any:
    """Return the root element of a text without entities and document types."""
    from xml.etree.ElementTree import TreeBuilder
    from xml.parsers.expat import ExpatError, ParserCreate

    def refuse(*_: object) -> int:
        raise ValueError(
            "found a document type or an entity, expected neither: they could "
            "load other files; remove them"
        )

    builder = TreeBuilder()
    parser = ParserCreate()  # without a separator prefixes stay in the names
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(text, True)
    except ExpatError as error:  # its text ends with line and column
        reason = one_line(str(error), 200)
        raise BadInput(f"{path}: not valid XML: {reason}") from None
    except ValueError as error:
        raise BadInput(f"{path}: not valid XML: {one_line(str(error), 200)}") from None
    return builder.close()


def _blank_lines(match: re.Match[str]) -> str:
    """Return the line ends of skipped text, so that line numbers stay correct."""
    text = match[0]
    return text if text.startswith("<![CDATA[") else "\n" * text.count("\n")


def placed(translation: NDArray, rotation: NDArray) -> NDArray:
    """Return the (4, 4) read-only transform."""
    T = transform(translation, rotation)
    T.setflags(write=False)
    return T


def counted(what: str, names: list[str]) -> tuple[str, ...]:
    """Return a line with the number of things left out, and the first names."""
    if not names:
        return ()
    named = [name for name in names if name]
    few = ", ".join(named[:3]) + (", ..." if len(named) > 3 else "")
    return (f"{what}: {len(names)}{f' ({few})' if few else ''}",)
