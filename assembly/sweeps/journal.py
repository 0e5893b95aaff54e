"""Journal of a sweep: file of finished blocks, from which a sweep resumes.

The first line is a JSON object that identifies the sweep, followed by a checksum. Each
record consists of block index, length of the content, checksum and content. The
checksum of a record depends on the first line. Records with a wrong checksum are
ignored. Records may be in any order and may occur twice. The file is locked while it is
open.
"""

import json
import mmap
import os
import struct
import zlib
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.locking import locked_file
from forcefit.inputs.table import BadInput
from forcefit.inputs.writing import check_writable, unwritable

_MAGIC = b"FFB2"
_HEAD = struct.Struct("<4sQQI")  # signature, block, length of the content, checksum
_KIND = "forcefit sweep journal 2"


@dataclass(frozen=True, eq=False)
class Journal:
    """An open journal.

    Attributes:
        path: path of the file.
        record_type: type of the records.
        owner: checksum of the first line.
        places: file offset and length of each finished block [bytes].
    """

    path: Path
    record_type: np.dtype
    owner: int
    places: dict[int, tuple[int, int]]

    def add(
        self, block: int, records: NDArray, texts: dict[str, dict[int, str]]
    ) -> None:
        """Append a finished block to the file.

        Args:
            block: index of the block.
            records: records of its points.
            texts: for each text variable, its nonempty texts by point index within the
                block.

        Raises:
            BadInput: the file cannot be written, for example because the disk is full.
        """
        text = json.dumps(texts, separators=(",", ":"), sort_keys=True).encode()
        content = struct.pack("<Q", len(records)) + records.tobytes() + text
        check = _check(self.owner, block, content)
        head = _HEAD.pack(_MAGIC, block, len(content), check)
        try:
            with self.path.open("ab", buffering=0) as file:
                start = file.seek(0, os.SEEK_END)
                written = file.write(head + content)
        except OSError as error:
            raise BadInput(unwritable(self.path, error)) from None
        if written != len(head) + len(content):
            raise BadInput(f"{self.path}: cannot be written: no space left")
        self.places[block] = start + len(head), len(content)

    def remove_after(self, held: ExitStack) -> None:
        """Remove the file when the stack ``held`` is closed without an exception."""

        def remove(kind: object, *_: object) -> None:
            if kind is None:
                self.path.unlink()

        held.push(remove)

    def read(self, block: int) -> tuple[NDArray, dict[str, dict[int, str]]]:
        """Return the records and texts of a finished block.

        Args:
            block: index of the block.

        Returns:
            The records and texts, as in :meth:`add`.

        Raises:
            BadInput: the file cannot be read or has been changed.
        """
        start, length = self.places[block]
        try:
            with self.path.open("rb") as file:
                file.seek(start - _HEAD.size)
                head, content = file.read(_HEAD.size), file.read(length)
        except OSError as error:
            raise BadInput(f"{self.path}: cannot be read: {error.strerror}") from None
        check = _check(self.owner, block, content)
        if head != _HEAD.pack(_MAGIC, block, length, check):
            raise BadInput(
                f"{self.path}: block {block} was changed during the sweep; run the "
                "same command again to compute it"
            )
        (count,) = struct.unpack_from("<Q", content)
        end = 8 + count * self.record_type.itemsize
        records = np.frombuffer(content[8:end], dtype=self.record_type)
        texts = json.loads(content[end:])
        return records, {
            name: {int(row): text for row, text in some.items()}
            for name, some in texts.items()
        }


@contextmanager
def open_journal(
    path: Path, whose: dict[str, Any], record_type: np.dtype
) -> Generator[Journal, None, None]:
    """Open a new or an existing journal as a context manager.

    Args:
        path: path of the file.
        whose: values that identify the sweep. To resume a sweep, all values except
            ``program`` must be equal.
        record_type: type of the records.

    Yields:
        The journal with the finished blocks.

    Raises:
        BadInput: another process uses the file, or the file belongs to another sweep,
            is not a journal, or cannot be written.
    """
    check_writable(path)
    equal = {name: value for name, value in whose.items() if name != "program"}
    line = json.dumps({"kind": _KIND} | equal).encode()
    header = b"%s %08x\n" % (line, zlib.crc32(line))
    with ExitStack() as held:
        try:
            held.enter_context(locked_file(path, wait=False))
        except BlockingIOError:
            raise BadInput(
                f"{path}: another process uses this journal; wait until it has "
                "finished, or write to another file"
            ) from None
        except OSError as error:
            raise BadInput(unwritable(path, error)) from None
        owner = zlib.crc32(header)
        yield Journal(path, record_type, owner, _recover(path, header, owner))


def _recover(path: Path, header: bytes, owner: int) -> dict[int, tuple[int, int]]:
    """Return the positions of finished blocks in a journal, and repair the file."""
    try:
        with path.open("r+b") as file:
            size = os.fstat(file.fileno()).st_size
            first_line = file.read(len(header))
            places: dict[int, tuple[int, int]] = {}
            end = len(header)
            if size > len(header):
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                    places, end = _scan(content, len(header), owner)
            if first_line != header:
                # If the journal has valid records, it belongs to this sweep and only
                # its first line is damaged.
                if not places and not header.startswith(first_line):
                    file.seek(0)
                    raise BadInput(f"{path}: {_difference(file.readline(), header)}")
                file.seek(0)
                file.write(header)
            file.truncate(end)
    except OSError as error:
        raise BadInput(unwritable(path, error)) from None
    return places


def _scan(
    content: mmap.mmap, start: int, owner: int
) -> tuple[dict[int, tuple[int, int]], int]:
    """Return the positions of all valid records, and the end of the last record."""
    places: dict[int, tuple[int, int]] = {}
    end = start
    place = content.find(_MAGIC, start)
    while 0 <= place <= len(content) - _HEAD.size:
        _, block, length, check = _HEAD.unpack_from(content, place)
        first = place + _HEAD.size
        if (
            length <= len(content) - first
            and _check(owner, block, content[first : first + length]) == check
        ):
            places[block] = first, length
            place = end = first + length
        else:
            place += 1
        place = content.find(_MAGIC, place)
    return places, end


def _check(owner: int, block: int, content: bytes) -> int:
    """Return the checksum of a record."""
    head = struct.pack("<QQ", block, len(content))
    return zlib.crc32(content, zlib.crc32(head, owner))


def _difference(first_line: bytes, header: bytes) -> str:
    """Return a text on the differences between a journal and the expected journal."""
    expected = json.loads(header.rpartition(b" ")[0])
    line, _, check = first_line.rstrip(b"\n").rpartition(b" ")
    if not first_line.startswith(b'{"kind": "forcefit sweep journal'):
        return (
            "found a file that is not a journal of a sweep; expected a journal or "
            "no file: delete it or write to another file"
        )
    if check != b"%08x" % zlib.crc32(line):
        return (
            "the checksum of the first line is wrong, because the journal is damaged "
            "or of another version; delete the file to start again"
        )
    other = json.loads(line)
    keys = [k for k in expected if other.get(k) != expected[k]]
    # If a more specific key differs, omit the digest of the whole input.
    keys = [k for k in keys if k != "question_sha256"] or keys
    theirs = ", ".join(f"{k} {str(other.get(k))[:60]!r}" for k in keys)
    wanted = ", ".join(f"{k} {str(expected[k])[:60]!r}" for k in keys)
    return (
        f"journal of another sweep: found {theirs}; expected {wanted} (finish that "
        "sweep, delete its journal, or write to another file)"
    )
