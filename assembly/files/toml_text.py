"""Formatting of TOML text, with numbers in full precision and arrays on one line."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from forcefit.inputs.writing import ROBOT_MARK


def file_text(
    values: Mapping[str, Any], tables: Mapping[str, Iterable[Mapping[str, Any]]],
    diagnosis: Mapping[str, Any] | None = None,
) -> str:  # fmt: skip
    """Return the text of a robot file.

    Args:
        values: values in the root table.
        tables: lists of tables, by name.
        diagnosis: values in the table ``[diagnosis]``.

    Returns:
        Text. Its first line shows that the file was written by forcefit and may be
        overwritten.
    """
    lines = [ROBOT_MARK, *_lines(values)]
    if diagnosis:
        lines += ["", "[diagnosis]", *_lines(diagnosis)]
    for kind, each in tables.items():
        for table in each:
            lines += ["", f"[[{kind}]]", *_lines(table)]
    return "\n".join(lines) + "\n"


def _lines(table: Mapping[str, Any]) -> list[str]:
    """Return a line of text for each key."""
    return [f"{key} = {toml_value(value)}" for key, value in table.items()]


def toml_value(value: Any) -> str:
    """Return the TOML text of a value."""
    # the package tomli-w writes each number of an array on a separate line
    if isinstance(value, bool | np.bool_):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{"".join(map(_escaped, value))}"'
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(k)} = {toml_value(v)}" for k, v in value.items())
        return "{ " + inner + " }" if inner else "{}"
    if isinstance(value, Iterable):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return repr(value) if isinstance(value, int) else repr(float(value))


def _key(name: str) -> str:
    """Return the TOML text of a key, with quotes if necessary."""
    bare = name and all(c.isascii() and (c.isalnum() or c in "-_") for c in name)
    return name if bare else toml_value(name)


def _escaped(c: str) -> str:
    """Return a character, or its escape sequence for a string in double quotes."""
    return f"\\u{ord(c):04x}" if c < " " or c in '"\\\x7f' else c
