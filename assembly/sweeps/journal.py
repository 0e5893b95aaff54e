"""A sweep's journal: finished blocks on disk, whatever happens to the program.

The file begins with one line of JSON that says whose it is.  Records follow, each
appended by one write: a block's number, its length and a check sum, then its rows and
texts.  A record cut short by a kill fails its check and is dropped when the file is
opened again; all before it stand.  Records may come in any order, and twice.
"""

import json
import os
import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from stiffness.reading import BadInput

_MAGIC = b"FFB1"
_HEAD = struct.Struct("<4sQQI")  # magic, block, length of what follows, its check sum
_KIND = "forcefit sweep journal 1"


@dataclass(frozen=True, eq=False)
class Journal:
    """An open journal.

    Attributes:
        path: of the file.
        record_type: of the rows.
        places: where each finished block stands: offset and length of its record.
    """

    path: Path
    record_type: np.dtype
    places: dict[int, tuple[int, int]] = field(default_factory=dict)

    def add(
        self, block: int, records: NDArray, texts: dict[str, dict[int, str]]
    ) -> None:
        """Append a finished block; it stands once this returns.

        Args:
            block: its number.
            records: its rows.
            texts: by name, the text of rows that have one.

        Raises:
            BadInput: the file cannot be written, as on a full disk.
        """
        said = json.dumps(texts, separators=(",", ":"), sort_keys=True).encode()
        content = struct.pack("<Q", len(records)) + records.tobytes() + said
        head = _HEAD.pack(_MAGIC, block, len(content), zlib.crc32(content))
        try:
            with self.path.open("ab", buffering=0) as file:
                start = file.seek(0, os.SEEK_END)
                written = file.write(head + content)
        except OSError as error:
            raise BadInput(_unwritable(self.path, error)) from None
        if written != len(head) + len(content):
            raise BadInput(f"{self.path}: cannot be written: no space left")
        self.places[block] = start + len(head), len(content)

    def read(self, block: int) -> tuple[NDArray, dict[str, dict[int, str]]]:
        """Rows and texts of a finished block."""
        start, length = self.places[block]
        with self.path.open("rb") as file:
            file.seek(start)
            content = file.read(length)
        (count,) = struct.unpack_from("<Q", content)
        end = 8 + count * self.record_type.itemsize
        records = np.frombuffer(content[8:end], dtype=self.record_type)
        texts = json.loads(content[end:])
        return records, {
            name: {int(row): text for row, text in some.items()}
            for name, some in texts.items()
        }


def open_journal(path: Path, whose: dict[str, Any], record_type: np.dtype) -> Journal:
    """A new journal, or the one that a sweep left behind.

    Args:
        path: of the file.
        whose: plain values that say which sweep this is: all must be the same.
        record_type: of the rows.

    Returns:
        The journal, with the blocks that are finished.

    Raises:
        BadInput: the file is another sweep's, or no journal, or cannot be written.
    """
    header = json.dumps({"kind": _KIND} | whose).encode() + b"\n"
    try:
        if not path.exists() or path.stat().st_size == 0:
            path.write_bytes(header)
        with path.open("r+b") as file:
            found = file.readline()
            if found != header:
                if not found.endswith(b"\n") and header.startswith(found):
                    # killed while the first line was written
                    file.seek(0)
                    file.write(header)
                else:
                    raise BadInput(f"{path}: {_difference(found, header)}")
            places, end = _scan(file, len(header), path.stat().st_size)
            file.truncate(end)
    except OSError as error:
        raise BadInput(_unwritable(path, error)) from None
    return Journal(path, record_type, places)


def _unwritable(path: Path, error: OSError) -> str:
    """The message of a file that cannot be written."""
    return f"{path}: cannot be written: {error.strerror}"


def _scan(
    file: BinaryIO, start: int, size: int
) -> tuple[dict[int, tuple[int, int]], int]:
    """Places of all whole records, and where the last one ends."""
    places, end = {}, start
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        magic, block, length, check = _HEAD.unpack(head)
        place = end + _HEAD.size
        if magic != _MAGIC or length > size - place:
            break
        if zlib.crc32(file.read(length)) != check:
            break
        places[block] = place, length
        end = place + length
    return places, end


def _difference(found: bytes, header: bytes) -> str:
    """How a journal differs from the one expected."""
    expected = json.loads(header)
    try:
        other = json.loads(found)
    except ValueError:
        other = {}
    if not isinstance(other, dict) or other.get("kind") != _KIND:
        return "found no journal of a sweep; expected one, or no such file"
    keys = [k for k in expected if other.get(k) != expected[k]]
    said = ", ".join(f"{k} {str(other.get(k))[:60]!r}" for k in keys)
    wanted = ", ".join(f"{k} {str(expected[k])[:60]!r}" for k in keys)
    return (
        f"journal of another sweep: found {said}; expected {wanted} (finish that "
        "sweep, delete its journal, or write to another file)"
    )
