"""TOML reader with precise error messages.

Each message states the file, the place in the file, the value found and what is
expected.  For an unknown name, the message suggests the most similar valid name; see
``forcefit/inputs/errors.py``.
"""

import csv
import difflib
import math
import re
import tomllib
from collections.abc import Iterable
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import (
    BadInput,
    describe,
    nearest,
    one_line,
    printable,
    quoted,
)
from forcefit.inputs.number_arrays import as_number, find_fault, number_array

__all__ = [
    "BadInput",
    "Table",
    "describe",
    "nearest",
    "quoted",
    "read_bytes",
    "read_rows",
    "read_text",
    "read_toml",
]

# [byte] largest accepted file; even a robot file with a million frames is smaller
_LARGEST_FILE = 64 << 20
# matches a key that consists of more than 100 names, such as a.a.a. ...
_DEEP_KEY = re.compile(r"(?<![\w-])(?:[\w-]+\s*\.\s*){100}")


class Mending(Protocol):
    """Replacement of faulty values while a file is read; see ``mending.py``."""

    def text(self, path: str, text: str) -> str:
        """Return the text to parse in place of the text of a file."""

    def root(self, content: dict[str, Any], file: str) -> "Table":
        """Return the root table to read in place of the content of a file."""


MENDING: ContextVar[Mending | None] = ContextVar("mending", default=None)


def read_bytes(path: Path | str) -> bytes:
    """Return the content of a file.

    Args:
        path: path of the file.

    Returns:
        The bytes of the file.

    Raises:
        BadInput: the file does not exist, is a folder, is unreadable, or is too large.
    """
    try:
        with Path(path).open("rb") as file:  # a pipe may never end
            content = file.read(_LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise BadInput(f"{path}: cannot be read: {reason}") from None
    if len(content) > _LARGEST_FILE:
        raise BadInput(
            f"{path}: found a file larger than {_LARGEST_FILE >> 20} MiB, "
            "expected a smaller file"
        )
    return content


def read_text(path: Path | str, encoding: str = "utf-8-sig") -> str:
    r"""Return the text of a UTF-8 file, with or without a byte order mark.

    Args:
        path: path of the file.
        encoding: text encoding, if the file itself states one other than UTF-8.

    Returns:
        Text with line endings ``\n``.

    Raises:
        BadInput: the file does not exist, is a folder, is unreadable, is too large, is
            not in this encoding, or contains a NUL character.
    """
    content, name = read_bytes(path), encoding.upper().removesuffix("-SIG")
    try:
        text = content.decode(encoding).replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise BadInput(
            f"{path}: byte {error.start} is not {name}; expected a text file in {name}"
        ) from None
    if (place := text.find("\0")) >= 0:
        line = text.count("\n", 0, place) + 1
        raise BadInput(
            f"{path}: line {line} contains NUL; expected a text file in UTF-8"
        )
    mending = MENDING.get()
    return text if mending is None else mending.text(str(path), text)


def read_rows(path: Path | str) -> list[list[str]]:
    """Return the cells of a CSV file, as one list per line.

    Args:
        path: path of the file.

    Returns:
        Cells as strings; an empty list for a blank line.

    Raises:
        BadInput: the file cannot be read, or a quoted cell is not closed.
    """
    rows = csv.reader(read_text(path).splitlines())
    try:
        return list(rows)
    except csv.Error as error:
        raise BadInput(f"{path}: line {rows.line_num}: not CSV: {error}") from None


def read_toml(path: Path | str) -> "Table":
    """Return the root table of a TOML file.

    Args:
        path: path of the file.

    Returns:
        Root table, whose methods read the keys.

    Raises:
        BadInput: the file cannot be read or is not valid TOML.
    """
    text = read_text(path)
    if _DEEP_KEY.search(text):  # tomllib would take minutes to parse such a key
        raise BadInput(f"{path}: not valid TOML: nested too deeply")
    mending = MENDING.get()
    try:
        content = tomllib.loads(text)
        if mending is not None:
            return mending.root(content, str(path))
        return Table(content, str(path), "")
    except RecursionError:
        raise BadInput(f"{path}: not valid TOML: nested too deeply") from None
    # the message of tomllib ends with the line and column
    except tomllib.TOMLDecodeError as error:
        reason = one_line(str(error), 200)
        raise BadInput(f"{path}: not valid TOML: {reason}") from None
    except ValueError:  # Python does not parse integers with thousands of digits
        reason = "found an integer with thousands of digits"
        raise BadInput(f"{path}: not valid TOML: {reason}") from None


@dataclass(eq=False)
class Table:
    """TOML table that records which keys are read, so that unknown keys are detected.

    Attributes:
        content: keys and values of the table.
        file: name of the file, for error messages.
        place: place in the file, for example ``frame "elbow".link``; empty for the
            root.
    """

    content: dict[str, Any]
    file: str
    place: str
    _asked: set[str] = field(default_factory=set)

    def bad(self, key: str, message: str) -> BadInput:
        """Create the error for a key of this table; the caller raises it."""
        where = ".".join(part for part in (self.place, key) if part)
        return BadInput(f"{self.file}: {where}{': ' if where else ''}{message}")

    def has(self, key: str) -> bool:
        """Return whether the key exists, and mark it as read."""
        self._asked.add(key)
        return key in self.content

    def get(self, key: str, default: object = None) -> Any:
        """Return the raw value of a key, or the default."""
        self._asked.add(key)
        return self.content.get(key, default)

    def require(self, key: str, expected: str) -> Any:
        """Return the unchecked value of a required key.

        Args:
            key: name of the key.
            expected: description of a valid value, for the error message.

        Returns:
            The value.

        Raises:
            BadInput: the key is missing.
        """
        if not self.has(key):
            near = difflib.get_close_matches(key, set(self.content), n=1, cutoff=0.7)
            hint = f"; found {quoted(near[0])} instead" if near else ""
            raise self.bad(key, f"missing; expected {expected}{hint}")
        return self.content[key]

    def text(
        self,
        key: str,
        default: str | None = None,
        *,
        expected: str = "a string",
        longest: int = 4000,
    ) -> str:
        """Return a string without line breaks.

        Args:
            key: name of the key.
            default: value of an absent key; without a default, an absent key is an
                error.
            expected: description of a valid value, for the error message.
            longest: maximum number of characters.

        Returns:
            The string.

        Raises:
            BadInput: the key is missing and has no default, or the value is not a
                string, is empty or too long, or contains line breaks or other control
                characters.
        """
        if default is not None and not self.has(key):
            return default
        value = self.require(key, expected)
        if not isinstance(value, str) or not value.strip():
            raise self.bad(key, f"found {describe(value)}, expected {expected}")
        if len(value) > longest:
            excess = f"found {quoted(value)} of {len(value)} characters"
            raise self.bad(key, f"{excess}, expected at most {longest}")
        if not printable(value):
            message = f"found {describe(value)}, expected no control characters"
            raise self.bad(key, message)
        return value

    def choice(self, key: str, valid: Iterable[str], default: str | None = None) -> str:
        """Return a string that must be one of several valid strings.

        Returns:
            The string.

        Raises:
            BadInput: the key is missing and has no default, or the string is not valid.
        """
        valid = tuple(valid)
        names = " | ".join(f'"{v}"' for v in valid)
        value = self.text(key, default, expected=names)
        if value not in valid:
            hint = nearest(value, valid)
            hint = hint if "did you mean" in hint else ""
            raise self.bad(key, f"found {describe(value)}, expected {names}{hint}")
        return value

    def boolean(self, key: str, default: bool) -> bool:
        """Return a boolean.

        Returns:
            The value, or the default if the key is absent.

        Raises:
            BadInput: the value is neither true nor false.
        """
        value = self.get(key, default)
        if not isinstance(value, bool):
            raise self.bad(key, f"found {describe(value)}, expected true or false")
        return value

    def integer(self, key: str, default: int | None = None, least: int = 0) -> int:
        """Return an integer of at least ``least``.

        Returns:
            The number.

        Raises:
            BadInput: the key is missing and has no default, or the value is not such an
                integer.
        """
        expected = f"a whole number >= {least}"
        if default is not None and not self.has(key):
            return default
        value = self.require(key, expected)
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise self.bad(key, f"found {describe(value)}, expected {expected}")
        return value

    def number(
        self,
        key: str,
        unit: str,
        default: float | None = None,
        *,
        above: float = -math.inf,
        least: float = -math.inf,
        below: float = math.inf,
        largest: float = math.inf,
    ) -> float:
        """Return a finite number.

        Args:
            key: name of the key.
            unit: unit for the error message.
            default: value of an absent key; without a default, an absent key is an
                error.
            above: exclusive lower bound.
            least: inclusive lower bound.
            below: exclusive upper bound.
            largest: largest accepted absolute value.

        Returns:
            The number.

        Raises:
            BadInput: the key is missing and has no default, or the value is not a
                number or is out of range.
        """
        limits = [
            f"> {above:g}" if above > -math.inf else "",
            f">= {least:g}" if least > -math.inf else "",
            f"< {below:g}" if below < math.inf else "",
        ]
        range_ = " and ".join(filter(None, limits))
        of_unit = f"[{unit}]" if unit else ""
        expected = " ".join(filter(None, ["a finite number", range_, of_unit]))
        if default is not None and not self.has(key):
            return default
        value = as_number(self.require(key, expected))
        if not (math.isfinite(value) and above < value < below and value >= least):
            value_text = describe(self.content[key])
            raise self.bad(key, f"found {value_text}, expected {expected}")
        if abs(value) > largest:
            value_text = describe(self.content[key])
            expected = f"a number of magnitude at most {largest:g} {of_unit}".rstrip()
            raise self.bad(key, f"found {value_text}, expected {expected}")
        return value

    def array(
        self,
        key: str,
        shape: tuple[int, ...],
        unit: str,
        default: NDArray | None = None,
        *,
        largest: float = math.inf,
    ) -> NDArray:
        """Return an array of finite numbers with a given shape.

        Args:
            key: name of the key.
            shape: expected shape.
            unit: unit for the error message.
            default: value of an absent key; without a default, an absent key is an
                error.
            largest: largest accepted absolute value of each entry.

        Returns:
            The array.

        Raises:
            BadInput: the key is missing and has no default, or the value has a
                different shape or entries that are not finite numbers.
        """
        size = " rows of ".join(str(n) for n in shape)
        expected = f"{size} finite numbers [{unit}]"
        if default is not None and not self.has(key):
            return default
        value = self.require(key, expected)
        array = number_array(value)
        if array is None or array.shape != shape or not np.isfinite(array).all():
            fault = find_fault(value, shape)
            raise self.bad(key, f"found {fault}, expected {expected}")
        if np.abs(array).max(initial=0.0) > largest:
            expected = f"numbers of magnitude at most {largest:g} [{unit}]"
            raise self.bad(key, f"found {describe(value)}, expected {expected}")
        return array

    def table(self, key: str) -> "Table":
        """Return the inner table with a given key.

        Returns:
            The table.

        Raises:
            BadInput: the key is missing, or its value is not a table.
        """
        value = self.require(key, "a table")
        if not isinstance(value, dict):
            raise self.bad(key, f"found {describe(value)}, expected a table")
        return self._inner(value, ".".join(filter(None, (self.place, key))), key)

    def tables(self, key: str) -> list["Table"]:
        """Return the list of tables ``[[key]]``, which is empty if the key is absent.

        Returns:
            One :class:`Table` per list item; messages number the items from 1.

        Raises:
            BadInput: the value is not a list of tables.
        """
        value = self.get(key, [])
        if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
            message = f"found {describe(value)}, expected tables [[{key}]]"
            raise self.bad(key, message)
        prefix = f"{self.place}." if self.place else ""
        return [
            self._inner(v, f"{prefix}{key}[{i}]", key, i)
            for i, v in enumerate(value, 1)
        ]

    def _inner(
        self, content: dict[str, Any], place: str, *at: str | int
    ) -> "Table":  # fmt: skip
        """Create an inner table; ``at`` is its key and, in a list, its number."""
        return Table(content, self.file, place)

    def finish(self) -> None:
        """Check that the table contains no keys other than those that were read.

        Raises:
            BadInput: the table contains an unknown key, which the message names.
        """
        for key in self.content:
            if key not in self._asked:
                hint = nearest(key, self._asked)
                raise self.bad("", f"unknown key {quoted(key)}{hint}")
