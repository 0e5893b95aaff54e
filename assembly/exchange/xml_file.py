"""Reader for XML files, which rejects entities and external files."""

import codecs
import re
from collections.abc import Container, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.largest import LARGEST_LENGTH
from forcefit.inputs.errors import BadInput, describe, nearest, one_line, quoted
from forcefit.inputs.table import read_bytes, read_text
from forcefit.stiffness.screws import transform

_DEEPEST = 200  # maximum depth of nested elements
# comments that contain "--" and misplaced declarations, both of which expat rejects
_SKIPPED = re.compile(
    r"<!\[CDATA\[.*?(?:\]\]>|\Z)|<!--.*?(?:-->|\Z)|<\?xml\s[^<>]*>", re.S
)

_DECLARED = re.compile(rb"""<\?xml\s[^<>]*?encoding\s*=\s*["']([A-Za-z][\w.-]*)["']""")
_WHOLE = ("model", "world")  # SDF elements that contain links and joints
_ENDLESS = 1e3  # [rad or m] larger limits are ignored


@dataclass(frozen=True)
class Node:
    """Element of an XML file, with its position for messages.

    Attributes:
        element: element of :mod:`xml.etree.ElementTree`.
        file: name of the file.
        within: path from the nearest outer element with a name, for messages; empty
            without such an element; None for the root.
    """

    element: Any
    file: str
    within: str | None = None

    @property
    def tag(self) -> str:
        """Tag of the element."""
        return str(self.element.tag)

    @property
    def place(self) -> str:
        """Position of the element for messages, such as ``joint "elbow".origin``."""
        name = self.element.get("name")
        if name is not None:
            return f"{self.tag} {quoted(name)}"
        return f"{self.within}.{self.tag}" if self.within else self.tag

    def bad(self, key: str, message: str) -> BadInput:
        """Return an error about an attribute of the element."""
        place = f"{self.place}.{key}" if key else self.place
        return BadInput(f"{self.file}: {place}: {message}")

    def children(self, *tags: str) -> Iterator["Node"]:
        """Yield the inner elements with the given tags, or all inner elements."""
        for element in self.element:
            if not tags or element.tag in tags:
                yield Node(element, self.file, self._within_children())

    def descendants(self) -> Iterator["Node"]:
        """Yield the element itself and all inner elements at any depth."""
        for element in self.element.iter():
            yield Node(element, self.file)

    def _within_children(self) -> str:
        """Return the attribute ``within`` of the inner elements."""
        if self.within is None or self.tag in _WHOLE:
            return ""
        return self.place if self.within or self.has("name") else ""

    @property
    def content(self) -> str:
        """Text of the element without surrounding blanks."""
        return (self.element.text or "").strip()

    def names_in(self, valid: Container[str]) -> list[str]:
        """Return the valid names that occur in the element and its inner elements."""
        found: dict[str, None] = {}
        for node in self.descendants():
            words = [*node.element.attrib.values(), node.content]
            found |= {word: None for word in map(str.strip, words) if word in valid}
        return list(found)

    def child(self, tag: str) -> "Node | None":
        """Return the first inner element with a tag, or None."""
        return next(self.children(tag), None)

    def has(self, key: str) -> bool:
        """Return whether an attribute exists."""
        return self.element.get(key) is not None

    def optional(self, key: str) -> str:
        """Return the text of an attribute; an empty text if it is absent."""
        return str(self.element.get(key, "")).strip()

    def text(self, key: str, default: str | None = None) -> str:
        """Return the text of an attribute.

        Args:
            key: name of the attribute.
            default: default value; None if the attribute is required.

        Returns:
            The text without surrounding blanks.

        Raises:
            BadInput: the attribute is absent and has no default, or it is empty.
        """
        value = self.element.get(key, default)
        if value is None or not (value.strip() or value == default):
            raise self.bad(key, "missing; expected a text")
        return str(value).strip()

    def choice(self, key: str, valid: tuple[str, ...], default: str) -> str:
        """Return the value of an attribute, which must be one of the valid words."""
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
        """Return the finite numbers in an attribute.

        Args:
            key: name of the attribute; empty for the text of the element.
            count: number of values.
            unit: unit for the error message.
            default: default values; None if the attribute is required.

        Returns:
            Numbers, (count,).

        Raises:
            BadInput: the attribute is absent and has no default, the number of values
                is wrong, or a value is not finite or too large.
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
        """Return the finite number in an attribute; see :meth:`numbers`."""
        given = None if default is None else np.array([default])
        return float(self.numbers(key, 1, unit, given)[0])

    def limits(
        self, lower: str | None, upper: str | None, unit: float = 1.0
    ) -> tuple[float, float] | None:
        """Return the smallest and largest coordinate of a joint.

        Args:
            lower: text of the lower limit; None if absent.
            upper: text of the upper limit; None if absent.
            unit: factor by which both limits are multiplied.

        Returns:
            Both limits [rad or m]; an absent limit is -1e6 or 1e6.  None if the range
            is empty or both limits are too large to be effective.

        Raises:
            BadInput: a text is not a number.
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
        """Return the vector in an attribute, normalised to length 1, (3,)."""
        vector = self.numbers(key, 3, "-", default)
        length = float(np.linalg.norm(vector))
        if length < 1e-9:
            raise self.bad(
                key, f"found {describe(vector.tolist())}, expected a nonzero vector"
            )
        # unit vectors are returned unchanged to avoid rounding errors
        return vector if abs(length - 1.0) < 1e-15 else vector / length


def read_xml(path: Path | str, *roots: str) -> Node:
    """Return the root element of an XML file.

    Args:
        path: path of the file.
        roots: allowed tags of the root element.

    Returns:
        The root element.  Namespaces are not resolved: a tag includes its prefix, and
            ``xmlns`` has no effect.

    Raises:
        BadInput: the file cannot be read, is not XML, declares entities or a document
            type, or has a different root element.
    """
    text = _SKIPPED.sub(_blank_lines, read_text(path, _encoding(read_bytes(path))))
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


def _encoding(content: bytes) -> str:
    """Return the encoding according to the byte order mark or the XML declaration.

    The default encoding is UTF-8, which also replaces an unknown encoding.

    Sources:
        W3C, XML 1.0, 4.3.3 and appendix F.
    """
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    declared = _DECLARED.search(content[:200])
    name = declared[1].decode() if declared else "utf-8"
    try:
        known = codecs.lookup(name).name
        codecs.decode(b"", known)
    except LookupError:
        return "utf-8-sig"
    # the encoding is not UTF-16, because the declaration is readable as ASCII
    return "utf-8-sig" if known.startswith("utf") else known


def _parsed(text: str, path: Path | str) -> Any:
    """Parse an XML text without entities and document types, and return its root."""
    from xml.etree.ElementTree import TreeBuilder
    from xml.parsers.expat import ExpatError, ParserCreate

    def refuse(*_: object) -> int:
        raise ValueError(
            "found a document type or an entity, which could load other files; "
            "expected neither; remove them"
        )

    builder = TreeBuilder()
    parser = ParserCreate()  # without namespaces, so that tags include prefixes
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.ExternalEntityRefHandler = refuse
    try:
        parser.Parse(text, True)
    except ExpatError as error:  # the message contains line and column
        reason = one_line(str(error), 200)
        raise BadInput(f"{path}: not valid XML: {reason}") from None
    except ValueError as error:
        raise BadInput(f"{path}: not valid XML: {one_line(str(error), 200)}") from None
    return builder.close()


def _blank_lines(match: re.Match[str]) -> str:
    """Return the line breaks in removed text, so that line numbers are preserved."""
    text = match[0]
    return text if text.startswith("<![CDATA[") else "\n" * text.count("\n")


def placed(translation: NDArray, rotation: NDArray) -> NDArray:
    """Return the read-only transform of a translation and a rotation, (4, 4)."""
    T = transform(translation, rotation)
    T.setflags(write=False)
    return T


def counted(what: str, names: list[str]) -> tuple[str, ...]:
    """Return a line with the number of items and the first names, or no line."""
    if not names:
        return ()
    named = [name for name in names if name]
    few = ", ".join(named[:3]) + (", ..." if len(named) > 3 else "")
    return (f"{what}: {len(names)}{f' ({few})' if few else ''}",)
