"""Formatting of TOML, with numbers at full precision and one line per array."""

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
        tables: tables by type, each written as ``[[type]]``.
        diagnosis: values in the table ``[diagnosis]``, which precedes all other tables.

    Returns:
        Text whose first line marks the file as one that may be overwritten.
    """
    lines = [ROBOT_MARK, *_lines(values)]
    if diagnosis:
        lines += ["", "[diagnosis]", *_lines(diagnosis)]
    for kind, each in tables.items():
        for table in each:
            lines += ["", f"[[{kind}]]", *_lines(table)]
    return "\n".join(lines) + "\n"


def _lines(table: Mapping[str, Any]) -> list[str]:
    """Return one line of text per key."""
    return [f"{key} = {toml_value(value)}" for key, value in table.items()]


def toml_value(value: Any) -> str:
    """Format a value in TOML."""
    # tomli-w is not used, because it puts each number in an array on its own line
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
    """Format a key, with quotes if necessary."""
    bare = name and all(c.isascii() and (c.isalnum() or c in "-_") for c in name)
    return name if bare else toml_value(name)


def _escaped(c: str) -> str:
    """Escape a character for a string in double quotes."""
    return f"\\u{ord(c):04x}" if c < " " or c in '"\\\x7f' else c
