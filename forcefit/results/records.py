"""Records: which quantities a result in JSON holds, and how they are nested."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Union

from forcefit.results.quantities import QUANTITIES, Quantity

Content = Union[str, Quantity, "Record", "Each", "Listed", "Either", "Words"]


@dataclass(frozen=True)
class Record:
    """An object whose keys are known.

    Attributes:
        content: of each key.
        optional: keys that may be absent.
        closed: whether no other keys may be there.
    """

    content: Mapping[str, Content]
    optional: frozenset[str] = field(default_factory=frozenset)
    closed: bool = True


@dataclass(frozen=True)
class Each:
    """An object whose keys are names, of frames for example, with equal contents."""

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

    words: tuple[str, ...]


def record(names: str = "", /, *merged: Record, **content: Content) -> Record:
    """A record from names of the table of quantities, other records, and contents.

    Args:
        names: between blanks; a ``?`` after a name, or an underscore after a key, marks
            it as optional.
        merged: records whose keys it also has.
        content: of other keys.

    Returns:
        The record, keys in this order.

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
