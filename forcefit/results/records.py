"""Declare the structure of JSON results."""

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
    """JSON object with a declared list of keys.

    Attributes:
        content: declared type of the value of each key.
        optional: keys that may be absent.
        closed: whether undeclared keys are forbidden.
    """

    content: Mapping[str, Content]
    optional: frozenset[str] = field(default_factory=frozenset)
    closed: bool = True


@dataclass(frozen=True)
class Each:
    """JSON object whose keys are arbitrary names, for example of frames.

    All values have the same declared type.
    """

    content: Content


@dataclass(frozen=True)
class Listed:
    """JSON list whose items all have the same declared type."""

    content: Content


@dataclass(frozen=True)
class Either:
    """Value of one of several declared types."""

    contents: tuple[Content, ...]


@dataclass(frozen=True)
class Words:
    """Value that equals one of several words."""

    words: tuple[str | int, ...]


@dataclass(frozen=True)
class Anything:
    """Value of any type."""


@dataclass(frozen=True)
class WithUnits:
    """Content in which each number may also be a string with a unit."""

    content: Content


def record(names: str = "", /, *merged: Record, **content: Content) -> Record:
    """Compose a record of quantities, other records and additional keys.

    Args:
        names: names of quantities, separated by blanks. A trailing question mark marks
            an optional quantity.
        merged: records whose keys are included.
        content: additional keys and their declared types. A trailing underscore marks
            an optional key and is not part of the key.

    Returns:
        Record with its keys in the order of the arguments.

    Raises:
        KeyError: a name is not in the table of quantities.
    """
    every: dict[str, Content] = {}
    optional: set[str] = set()
    for name in names.split():
        key = name.rstrip("?")
        QUANTITIES[key]  # raises KeyError for an unknown name
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
