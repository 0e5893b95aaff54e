"""Costly results in the order they are asked for, kept in a journal.

A computation that takes its steps from earlier results, the same each time, goes on
after a kill by asking again: what stands in the journal is not computed anew.  Each
result is kept with a digest of what it was asked for; where that differs, as after a
change of the program, it is computed again.
"""

import io
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.sweeps.journal import Journal, open_journal
from assembly.sweeps.sweep import journal_path

RECORD = np.dtype("u1")
_DIGEST = 32


@dataclass(eq=False)
class Replay:
    """Results so far.

    Attributes:
        journal: of records :data:`RECORD`; None to keep nothing.
        asked: how many results were asked for.
    """

    journal: Journal | None = None
    asked: int = field(default=0, init=False)

    def recall(
        self, compute: Callable[[], tuple[ArrayLike, ...]], *given: ArrayLike
    ) -> tuple[NDArray, ...]:
        """The next result.

        Args:
            compute: finds it.
            given: numbers and words on which it depends.

        Returns:
            What ``compute`` returns, as arrays.
        """
        if self.journal is None:
            return tuple(np.asarray(a) for a in compute())
        number, self.asked = self.asked, self.asked + 1
        digest = sha256()
        for one in map(np.asarray, given):
            digest.update(f"{one.dtype} {one.shape} ".encode() + one.tobytes())
        if number in self.journal.places:
            kept = self.journal.read(number)[0].tobytes()
            if kept[:_DIGEST] == digest.digest():
                with np.load(io.BytesIO(kept[_DIGEST:])) as arrays:
                    return tuple(arrays[f"arr_{i}"] for i in range(len(arrays)))
        found = tuple(np.asarray(a) for a in compute())
        content = io.BytesIO()
        np.savez(content, *found)
        record = np.frombuffer(digest.digest() + content.getvalue(), dtype=RECORD)
        self.journal.add(number, record, {})
        return found


@contextmanager
def journalled(
    path: Path | None, whose: dict[str, Any]
) -> Generator[Replay, None, None]:
    """Results kept beside a file until it is written.

    Args:
        path: of the file; None to keep nothing.
        whose: what must be the same for two computations to share results.

    Yields:
        Where results are kept; the journal goes when the block ends without an error.

    Raises:
        BadInput: the journal is of something else, or cannot be written.
    """
    if path is None:
        yield Replay()
        return
    with open_journal(journal_path(path), whose, RECORD) as journal:
        yield Replay(journal)
        journal.path.unlink(missing_ok=True)
