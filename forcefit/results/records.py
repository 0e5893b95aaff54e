"""Records, which declare the quantities in a JSON result and their nesting."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Union

from forcefit.results.quantities import QUANTITIES, Quantity

Content = Union[
    str,
    Quantity,
    "Record",
    "Each",
    "Listed",
    "Either",
    "Words",
    "Anything",
    "WithUnits",
]


@dataclass(frozen=True)
class Record:
    """A JSON object whose keys are declared.

    Attributes:
        content: declared content of each key.
        optional: keys that may be absent.
        closed: whether undeclared keys are forbidden.
    """

    content: Mapping[str, Content]
    optional: frozenset[str] = field(default_factory=frozenset)
    closed: bool = True


@dataclass(frozen=True)
class Each:
    """A JSON object whose keys are names, such as frame names, with equal contents."""

    content: Content


@dataclass(frozen=True)
class Listed:
    """A JSON list whose items all have the same declared content."""

    content: Content


@dataclass(frozen=True)
class Either:
    """A value that matches one of several declared contents."""

    contents: tuple[Content, ...]


@dataclass(frozen=True)
class Words:
    """A text that equals one of several words."""

    words: tuple[str | int, ...]


@dataclass(frozen=True)
class Anything:
    """A value of any type."""


@dataclass(frozen=True)
class WithUnits:
    """A content in which each number may also be a text with a unit."""

    content: Content


def record(names: str = "", /, *merged: Record, **content: Content) -> Record:
    """Return a record composed of quantities, other records and further contents.

    Args:
        names: names separated by blanks; a question mark after a name, or an underscore
            after a key, marks it as optional.
        merged: other records, whose keys are added to the record.
        content: contents of further keys.

    Returns:
        The record, with its keys in the order of the arguments.

    Raises:
        KeyError: a name is not in the table.
    """
    every: dict[str, Content] = {}
    optional: set[str] = set()
    for name in names.split():
        key = name.rstrip("?")
        QUANTITIES[key]  # raises the error for a name that is not in the table
        every[key] = key
        optional |= {key} if name.endswith("?") else set()
    for other in merged:
        every |= other.content
        optional |= other.optional
    for name, one in content.items():
        key = name.rstrip("_")
        every[key] = one
        optional |= {key} if name.endswith("_") else set()
    return Record(every, frozenset(optional))
