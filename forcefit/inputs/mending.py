"""Collect all messages about a file from a reader that stops at the first error.

:func:`all_messages` runs the reader repeatedly.  After each error, it replaces the
faulty value at the place named in the message, either by the valid name suggested in
the message or by a value of the required type.  If neither is known, the row or table
is omitted.  All messages therefore come from the reader, and its rules are not
duplicated here.

Some messages do not refer to a value in the file, for example when a closure has a gap.
Such a message could be caused by a replaced value.  It is therefore reported only if it
is the first message, or if it reappears after all replaced numbers have been changed.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from forcefit.inputs.mended_table import (
    MendedTable,
    Place,
    Reading,
    changed_numbers,
    is_numeric,
    texts_of,
)
from forcefit.inputs.table import MENDING, BadInput, Table

MOST_MESSAGES = 50  # limited, because a wrong unit may cause one message per row
# tables that are referred to by name: omitting one would invalidate each reference
_NAMED = {"frame", "body", "joint", "leg"}
_HINT = re.compile(r'(?:did you mean |; valid: |; found )"?([^",?]+)"?')
_FOUND = re.compile(r"""(?:found|no frame) ["']([^"']*)["']""")
_UNKNOWN = re.compile(r'unknown key "([^"]*)"')
_LINE = re.compile(r"line (\d+)\b")


@dataclass
class _Mended:
    """Values to replace in the next run of the reader.

    Attributes:
        renamed: new names of keys; a key with an empty new name is omitted.
        values: replacement values, of which the last one is used; None means that the
            key is omitted.
        lines: file and line number of each line that is replaced by a blank line.
        reading: record of the current run, including omitted tables.
        guessed: whether a value was omitted, or replaced by text that no message
            suggests, so that later messages may be a consequence.
    """

    renamed: dict[Place, str] = field(default_factory=dict)
    values: dict[Place, list[Any]] = field(default_factory=dict)
    lines: set[tuple[str, int]] = field(default_factory=set)
    reading: Reading = field(default_factory=Reading)
    guessed: bool = False

    def text(self, path: str, text: str) -> str:
        """Replace the faulty lines in the text of a file by blank lines."""
        blank = {number for file, number in self.lines if file == path}
        if not blank:
            return text
        lines = text.split("\n")
        return "\n".join("" if n in blank else x for n, x in enumerate(lines, 1))

    def root(self, content: dict[str, Any], file: str) -> Table:
        """Return the root table of a file, with faulty values replaced."""
        for (name, path), new in self.renamed.items():
            if name == file:
                owner, key = _owner(content, path), path[-1]
                if key in owner:
                    value = owner.pop(key)
                    if new:
                        owner.setdefault(new, value)
        for (name, path), values in self.values.items():
            if name == file:
                owner = _owner(content, path)
                owner.pop(path[-1], None)
                if values[-1] is not None:
                    owner[path[-1]] = values[-1]
        return MendedTable(content, file, "", reading=self.reading)

    def mend(self, message: str) -> tuple[bool, bool]:
        """Replace the value at the place named in a message.

        Returns:
            Whether such a value exists, and whether it has been replaced before.
        """
        for table in sorted(self.reading.tables, key=lambda t: -len(t.place)):
            for start in dict.fromkeys((table.place, table.first_place)):
                head = f"{table.file}: {start}"
                rest = message[len(head) :]
                if not message.startswith(head) or (start and rest[:1] not in ".:"):
                    continue
                rest = rest.lstrip(".: ") if start else rest
                return self._mend_key(table, rest)
        return self._mend_line(message)

    def change_numbers(self) -> None:
        """Change every replacement value that is a number or a list of numbers."""
        for k, tried in enumerate(self.values.values()):
            tried[-1] = changed_numbers(tried[-1], k)

    def _mend_line(self, message: str) -> tuple[bool, bool]:
        """Replace the CSV row named in a message by a blank line."""
        file, _, rest = message.partition(": ")
        line = _LINE.match(rest)
        if line is None or not file.endswith(".csv") or int(line[1]) == 1:
            return False, False
        place = file, int(line[1])
        again = place in self.lines
        self.lines.add(place)
        self.guessed = True
        return not again, again

    def _mend_key(self, table: MendedTable, rest: str) -> tuple[bool, bool]:
        """Replace the value of the key at the start of ``rest``."""
        path, content = table.path, table.content
        key, rest = _key_of(content, rest)
        while key and rest.startswith(".") and isinstance(content[key], dict):
            path, content = (*path, key), content[key]
            key, rest = _key_of(content, rest[1:])
        hint, found = _HINT.search(rest), _FOUND.search(rest)
        if key:
            value = _suggested(content[key], found, hint)
            return self._replace((table.file, (*path, key)), value)
        if unknown := _UNKNOWN.search(rest):
            near = hint[1] if hint and "did you mean" in hint[0] else ""
            return self._rename((table.file, (*path, unknown[1])), near)
        key = re.split(r"[:.\[]", rest, maxsplit=1)[0]
        if not rest[len(key) :].startswith(": missing"):
            return self._leave_out((table.file, path))
        place = table.file, (*path, key)
        # if this key has been omitted before, the message is a consequence
        if hint is not None and hint[0].startswith("; found ") and (
            place not in self.values
        ):  # fmt: skip
            return self._rename((table.file, (*path, hint[1])), key)
        return self._replace(place, None)

    def _rename(self, place: Place, name: str) -> tuple[bool, bool]:
        """Rename a key, or omit it if the new name is empty."""
        again = place in self.renamed
        if again and not self.renamed[place]:
            return False, again
        self.renamed[place] = "" if again else name
        self.guessed = self.guessed or not self.renamed[place]
        return True, again

    def _replace(self, place: Place, value: Any) -> tuple[bool, bool]:
        """Replace a value, or omit it or the list item that contains it."""
        tried = self.values.setdefault(place, [])
        again = bool(tried)
        known = [value, self.reading.offers.get(place)]
        for one in [*(v for v in known if v is not None), None]:
            if one not in tried and len(tried) < 3:
                tried.append(one)
                if one is None or (one != value and not is_numeric(one)):
                    self.guessed = True
                return True, again
        return self._leave_out(place)[0], again

    def _leave_out(self, place: Place) -> tuple[bool, bool]:
        """Omit the list item that contains a place, unless other tables refer to it."""
        file, path = place
        while path and not isinstance(path[-1], int):
            path = path[:-1]
        unused = bool(path) and self._is_unused(file, path)
        named = bool(path) and path[-2] in _NAMED and not unused
        if not path or named or (file, path) in self.reading.left_out:
            return False, False
        of_list = {
            (t.file, t.path) for t in self.reading.tables
            if t.file == file and t.path[:-1] == path[:-1]
        }  # fmt: skip
        if of_list <= self.reading.left_out | {(file, path)}:
            return False, False  # the reader requires at least one such table
        self.reading.left_out.add((file, path))
        self.guessed = self.guessed or not unused or path[-2] == "joint"
        return True, False

    def _is_unused(self, file: str, path: tuple[str | int, ...]) -> bool:
        """Return whether a body or joint is not referred to anywhere in the file."""
        tables = {t.path: t.content for t in self.reading.tables if t.file == file}
        if path[-2] not in {"body", "joint"} or path not in tables:
            return False
        name = str(tables[path].get("name"))
        return not any(
            text == name or text.endswith(f".{name}") for text in texts_of(tables[()])
        )


def all_messages(read: Callable[[], object]) -> list[str]:
    """Collect all messages of a reader about the files that it reads.

    Args:
        read: reader that raises :class:`BadInput` at the first mistake.  It is called
            once per message, plus a few additional times.

    Returns:
        Messages in the order in which the mistakes are found, at most
        :data:`MOST_MESSAGES`.
    """
    mended, messages = _Mended(), list[str]()
    token = MENDING.set(mended)
    try:
        while len(messages) < MOST_MESSAGES:
            mended.reading.tables.clear()
            mended.reading.offers.clear()
            try:
                read()
            except BadInput as error:
                message = str(error)
            else:
                break
            placed, again = mended.mend(message)
            if not messages or (
                not again if placed else _is_repeated(read, mended, message)
            ):
                messages.append(message)
            if not placed:
                break
    finally:
        MENDING.reset(token)
    return messages


def _is_repeated(
    read: Callable[[], object], mended: _Mended, message: str
) -> bool:  # fmt: skip
    """Return whether a message is independent of the replaced numbers."""
    if mended.guessed:
        return False
    before = {place: list(tried) for place, tried in mended.values.items()}
    mended.change_numbers()
    try:
        read()
    except BadInput as error:
        return str(error) == message
    else:
        return False
    finally:
        mended.values = before


def _owner(content: dict[str, Any], path: tuple[str | int, ...]) -> Any:
    """Return the table that contains the last key of a path, or an empty table."""
    found: Any = content
    for step in path[:-1]:
        try:
            found = found[step - 1 if isinstance(step, int) else step]
        except (KeyError, IndexError, TypeError):
            return {}
    return found if isinstance(found, dict) else {}


def _key_of(content: dict[str, Any], text: str) -> tuple[str, str]:
    """Split a text into the longest key at its start and the text that follows."""
    for key in sorted(content, key=len, reverse=True):
        if text.startswith(key) and text[len(key) : len(key) + 1] in {".", ":", "["}:
            return key, text[len(key) :]
    return "", text


def _suggested(
    value: Any, found: re.Match[str] | None, hint: re.Match[str] | None
) -> Any:  # fmt: skip
    """Return a value with the name suggested in a message, or None if there is none."""
    if found is None or hint is None:
        return None
    if value == found[1]:
        return hint[1]
    if isinstance(value, list) and found[1] in value:
        return [hint[1] if one == found[1] else one for one in value]
    return None
