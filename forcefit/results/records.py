"""Records: the quantities of a result in JSON, and their nesting."""

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
    """An object whose keys are known.

    Attributes:
        content: content of each key.
        optional: keys that may be absent.
        closed: whether other keys are forbidden.
    """

    content: Mapping[str, Content]
    optional: frozenset[str] = field(default_factory=frozenset)
    closed: bool = True


@dataclass(frozen=True)
class Each:
    """An object whose keys are names, such as names of frames, with equal contents."""

    content: Content


@dataclass(frozen=True)
class Listed:
    """A list whose items have equal contents."""

    content: Content


@dataclass(frozen=True)
class Either:
    """One of several contents."""

    contents: tuple[Content, ...]


@dataclass(frozen=True)
class Words:
    """One of several words."""

    words: tuple[str | int, ...]


@dataclass(frozen=True)
class Anything:
    """Any content."""


@dataclass(frozen=True)
class WithUnits:
    """A content whose numbers may be texts with a unit."""

    content: Content


def record(names: str = "", /, *merged: Record, **content: Content) -> Record:
    """Return a record from names of quantities, other records, and contents.

    Args:
        names: names separated by blanks; a question mark after a name, or an underscore
            after a key, marks it as optional.
        merged: records whose keys are added.
        content: contents of other keys.

    Returns:
        The record, with its keys in this order.

    Raises:
        KeyError: a name is not in the table.
    """
    every: dict[str, Content] = {}
    optional: set[str] = set()
    for name in names.split():
        key = name.rstrip("?")
        QUANTITIES[key]  # refuses a name that is not in the table
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
