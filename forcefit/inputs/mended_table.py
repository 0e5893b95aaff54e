"""Tables that record valid values while they are read; see ``mending.py``."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import Table

# file name, and the keys that lead to a value; tables in a list are numbered from 1
Place = tuple[str, tuple[str | int, ...]]
# relative change of replaced numbers, large enough to show up in a rounded message
_CHANGE = 0.07


@dataclass
class Reading:
    """Record of one run of a reader.

    Attributes:
        left_out: tables omitted from their lists.
        offers: for each key, a value of the type that the reader requires.
        tables: all tables that were read.
    """

    left_out: set[Place] = field(default_factory=set)
    offers: dict[Place, Any] = field(default_factory=dict)
    tables: list["MendedTable"] = field(default_factory=list)


@dataclass(eq=False)
class MendedTable(Table):
    """Table that records a valid value for each key that is read.

    Attributes:
        reading: record of the run in which the table is read.
        path: keys that lead to the table in its file.
        first_place: original place of the table in messages; a reader may change it.
    """

    reading: Reading = field(default_factory=Reading)
    path: tuple[str | int, ...] = ()
    first_place: str = ""

    def __post_init__(self) -> None:
        self.first_place = self.place
        self.reading.tables.append(self)

    def _inner(self, content: dict[str, Any], place: str, *at: str | int) -> Table:
        return MendedTable(
            content, self.file, place, reading=self.reading, path=(*self.path, *at)
        )

    def _offer(self, key: str, value: Any) -> None:
        """Record a valid value for a key."""
        self.reading.offers[self.file, (*self.path, key)] = value

    def text(self, key: str, default: str | None = None, **rules: Any) -> str:
        """Call :meth:`Table.text`, and record a valid string."""
        self._offer(key, default or f"stand-in {len(self.reading.offers)}")
        return super().text(key, default, **rules)

    def choice(self, key: str, valid: Iterable[str], default: str | None = None) -> str:
        """Call :meth:`Table.choice`, and record the default or the first valid word."""
        valid = tuple(valid)
        try:
            return super().choice(key, valid, default)
        finally:  # overwrites the arbitrary string that ``text`` has recorded
            self._offer(key, default or valid[0])

    def boolean(self, key: str, default: bool) -> bool:
        """Call :meth:`Table.boolean`, and record the default."""
        self._offer(key, default)
        return super().boolean(key, default)

    def integer(self, key: str, default: int | None = None, least: int = 0) -> int:
        """Call :meth:`Table.integer`, and record a valid integer."""
        self._offer(key, max(least, 1) if default is None else default)
        return super().integer(key, default, least)

    def number(
        self, key: str, unit: str, default: float | None = None, **rules: Any
    ) -> float:
        """Call :meth:`Table.number`, and record a number within its range."""
        self._offer(key, _inside(**rules))
        return super().number(key, unit, default, **rules)

    def array(
        self, key: str, shape: tuple[int, ...], unit: str,
        default: NDArray | None = None, **rules: Any,
    ) -> NDArray:  # fmt: skip
        """Call :meth:`Table.array`, and record an array in general position."""
        self._offer(key, _in_general_position(shape).tolist())
        return super().array(key, shape, unit, default, **rules)

    def table(self, key: str) -> Table:
        """Call :meth:`Table.table`, and record an empty table."""
        self._offer(key, {})
        return super().table(key)

    def tables(self, key: str) -> list[Table]:
        """Call :meth:`Table.tables`, and record an empty list."""
        self._offer(key, [])
        numbered = enumerate(super().tables(key), 1)
        paths = {path for file, path in self.reading.left_out if file == self.file}
        return [t for i, t in numbered if (*self.path, key, i) not in paths]


def _inside(
    above: float = -math.inf, least: float = -math.inf, below: float = math.inf,
    largest: float = math.inf,
) -> float:  # fmt: skip
    """Return a number within the given limits."""
    low, high = max(above, least), min(below, largest)
    if math.isinf(low):
        return max(min(0.3, high - 1.0), -largest)
    return min(low + 1.0, (low + high) / 2)


def _in_general_position(shape: tuple[int, ...]) -> NDArray:
    """Return increasing small numbers, or a positive definite matrix if square."""
    if len(shape) == 2 and shape[0] == shape[1]:
        return np.diag(np.linspace(1.0, 2.0, shape[0]))
    return np.linspace(0.11, 0.37, math.prod(shape)).reshape(shape)


def changed_numbers(value: Any, k: int) -> Any:
    """Multiply each number in a value by a different factor close to 1."""
    if isinstance(value, list):
        return [changed_numbers(one, k + 3 * i) for i, one in enumerate(value)]
    return value * (1 + _CHANGE / (1 + k)) if isinstance(value, float) else value


def is_numeric(value: Any) -> bool:
    """Return whether a value is a float or a nested list of floats."""
    if isinstance(value, list):
        return bool(value) and all(map(is_numeric, value))
    return isinstance(value, float)


def texts_of(value: Any) -> Iterator[str]:
    """Yield all strings in nested tables and lists, except the names of the tables."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        yield from texts_of([one for key, one in value.items() if key != "name"])
    elif isinstance(value, list):
        for one in value:
            yield from texts_of(one)
