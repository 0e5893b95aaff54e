"""All messages about a file, although readers stop at the first mistake.

:func:`all_messages` runs a reader again and again.  After each error it mends the value
at the place that the message names: it takes the valid name that the message suggests,
or a value of the required kind, or leaves out the row of a table.  So every message is
the reader's own, and no second set of rules exists.

A message without a place in the file, for example that a closure is open, is reported
only if it is the first: after a mended value it could be due to that value.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from forcefit.inputs.mended_table import MendedTable, Place, Reading
from forcefit.inputs.table import MENDING, BadInput, Table

MOST_MESSAGES = 50  # a wrong unit is a mistake in every row of a table
# tables that others name: without them the others' names would be reported
_NAMED = {"frame", "body", "joint", "leg"}
_HINT = re.compile(r'(?:did you mean |; valid: |; found )"?([^",?]+)"?')
_FOUND = re.compile(r"""(?:found|no frame) ["']([^"']*)["']""")
_UNKNOWN = re.compile(r'unknown key "([^"]*)"')
_LINE = re.compile(r"line (\d+)\b")


@dataclass
class _Mended:
    """The values that are mended in the next run of the reader.

    Attributes:
        renamed: new names of keys, empty where the key is left out.
        values: new values, the last one in use; None where the key is left out.
        lines: files and numbers of lines that are left blank.
        reading: the present run, and the tables of lists that are left out.
    """

    renamed: dict[Place, str] = field(default_factory=dict)
    values: dict[Place, list[Any]] = field(default_factory=dict)
    lines: set[tuple[str, int]] = field(default_factory=set)
    reading: Reading = field(default_factory=Reading)

    def text(self, path: str, text: str) -> str:
        """Return the text of a file with its faulty lines left blank."""
        blank = {number for file, number in self.lines if file == path}
        if not blank:
            return text
        lines = text.split("\n")
        return "\n".join("" if n in blank else x for n, x in enumerate(lines, 1))

    def root(self, content: dict[str, Any], file: str) -> Table:
        """Return the root table of a file with its faulty values mended."""
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
        """Mend the value at the place of a message.

        Returns:
            Whether there is such a value, and whether it was mended before.
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

    def _mend_line(self, message: str) -> tuple[bool, bool]:
        """Leave the line of a message blank, if it is a row of a table."""
        file, _, rest = message.partition(": ")
        line = _LINE.match(rest)
        if line is None or not file.endswith(".csv") or int(line[1]) == 1:
            return False, False
        place = file, int(line[1])
        again = place in self.lines
        self.lines.add(place)
        return not again, again

    def _mend_key(self, table: MendedTable, rest: str) -> tuple[bool, bool]:
        """Mend the value of the table's key that begins a text."""
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
        # a key that was left out here is missing: no other key is meant
        if hint is not None and hint[0].startswith("; found ") and (
            place not in self.values
        ):  # fmt: skip
            return self._rename((table.file, (*path, hint[1])), key)
        return self._replace(place, None)

    def _rename(self, place: Place, name: str) -> tuple[bool, bool]:
        """Read a value under another name, or not at all."""
        again = place in self.renamed
        if again and not self.renamed[place]:
            return False, again
        self.renamed[place] = "" if again else name
        return True, again

    def _replace(self, place: Place, value: Any) -> tuple[bool, bool]:
        """Read another value, or none, or leave out the table of a list it is in."""
        tried = self.values.setdefault(place, [])
        again = bool(tried)
        known = [value, self.reading.offers.get(place)]
        for one in [*(v for v in known if v is not None), None]:
            if one not in tried and len(tried) < 3:
                tried.append(one)
                return True, again
        return self._leave_out(place)[0], again

    def _leave_out(self, place: Place) -> tuple[bool, bool]:
        """Leave out the table of a list that a place is in, if nothing names it."""
        file, path = place
        while path and not isinstance(path[-1], int):
            path = path[:-1]
        if not path or path[-2] in _NAMED or (file, path) in self.reading.left_out:
            return False, False
        of_list = {
            (t.file, t.path) for t in self.reading.tables
            if t.file == file and t.path[:-1] == path[:-1]
        }  # fmt: skip
        if of_list <= self.reading.left_out | {(file, path)}:
            return False, False  # a file with none of them would be refused
        self.reading.left_out.add((file, path))
        return True, False


def all_messages(read: Callable[[], object]) -> list[str]:
    """Return the messages of a reader about everything that it reads.

    Args:
        read: reader, which raises :class:`BadInput` at the first mistake; it is called
            once for each message and a few times more.

    Returns:
        The messages in the order in which the mistakes are found, at most
        :data:`MOST_MESSAGES`; empty if there are none.
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
            if not messages or (placed and not again):
                messages.append(message)
            if not placed:
                break
    finally:
        MENDING.reset(token)
    return messages


def _owner(content: dict[str, Any], path: tuple[str | int, ...]) -> Any:
    """Return the table that has the last key of a path; an empty one if none has."""
    found: Any = content
    for step in path[:-1]:
        try:
            found = found[step - 1 if isinstance(step, int) else step]
        except (KeyError, IndexError, TypeError):
            return {}
    return found if isinstance(found, dict) else {}


def _key_of(content: dict[str, Any], text: str) -> tuple[str, str]:
    """Return the longest key that begins a text, and the text after it."""
    for key in sorted(content, key=len, reverse=True):
        if text.startswith(key) and text[len(key) : len(key) + 1] in {".", ":", "["}:
            return key, text[len(key) :]
    return "", text


def _suggested(
    value: Any, found: re.Match[str] | None, hint: re.Match[str] | None
) -> Any:  # fmt: skip
    """Return a value with the name that a message suggests; None if there is none."""
    if found is None or hint is None:
        return None
    if value == found[1]:
        return hint[1]
    if isinstance(value, list) and found[1] in value:
        return [hint[1] if one == found[1] else one for one in value]
    return None
