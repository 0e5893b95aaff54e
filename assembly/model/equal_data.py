"""Comparison of objects by a digest of their data.

Numbers are compared bit by bit, so that equal objects have identical results.  For
example, 0.0 differs from -0.0.  An integer equals the float with the same value.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache, cached_property
from hashlib import blake2b
from itertools import chain
from struct import pack
from typing import Any

import numpy as np

_CACHED = {"_digest", "_hash"}


class EqualData:
    """Base class for frozen dataclasses (``eq=False``) compared by their data."""

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(other) is not type(self):
            return NotImplemented
        return self._digest == other._digest

    def __hash__(self) -> int:
        return self._hash

    def _data(self) -> Iterable[Any]:
        """Return the values that are compared."""
        return _fields_of(self)

    @cached_property
    def _digest(self) -> bytes:
        digest = blake2b(digest_size=16)
        for value in self._data():
            _feed(digest.update, value)
        return digest.digest()

    @cached_property
    def _hash(self) -> int:
        # Subclasses can override this method with a faster hash.
        return hash(self._digest)

    def __getstate__(self) -> dict[str, Any]:
        # The digest is not pickled, because hashes differ between processes.
        return {key: value for key, value in vars(self).items() if key not in _CACHED}


def _fields_of(thing: Any) -> Iterable[Any]:
    """Return the field values of a dataclass."""
    return map(vars(thing).__getitem__, type(thing).__dataclass_fields__)


def _feed(update: Callable[[bytes], None], value: Any) -> None:
    """Add a value with its type and length to a digest."""
    kind = type(value)
    if kind is np.ndarray:
        update(_head(value.dtype.char, value.shape))
        update(value.tobytes())
    elif kind is float or kind is int:
        update(b"f" + pack("<d", value))
    elif kind is str:
        text = value.encode(errors="surrogatepass")
        update(b"s%d:" % len(text) + text)
    elif value is None or kind is bool:
        update(b"n" if value is None else b"b%d" % value)
    elif isinstance(value, EqualData):
        update(b"=" + value._digest)
    else:
        _feed_parts(update, value)


def _feed_parts(update: Callable[[bytes], None], value: Any) -> None:
    """Add the items of a collection, or the text of any other value, to a digest."""
    if is_dataclass(value):
        update(type(value).__name__.encode())
        parts = _fields_of(value)
    elif isinstance(value, Mapping):
        update(b"m%d:" % len(value))
        parts = chain.from_iterable(value.items())
    elif isinstance(value, Sequence):
        update(b"t%d:" % len(value))
        parts = value
    else:
        parts = (value.item() if isinstance(value, np.generic) else str(value),)
    for part in parts:
        _feed(update, part)


@cache
def _head(kind: str, shape: tuple[int, ...]) -> bytes:
    """Return the bytes that precede the numbers of an array in a digest."""
    return f"a{kind}{shape}".encode()
