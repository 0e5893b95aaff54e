"""Journal that stores the results of a deterministic computation in order.

When an interrupted computation is restarted, it reads stored results instead of
computing them. Each result is stored with a digest of its arguments. If the digest
differs, the result is computed again.
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

from forcefit.assembly.sweeps.journal import Journal, open_journal
from forcefit.assembly.sweeps.sweep import journal_path

RECORD = np.dtype("u1")
_DIGEST = 32


@dataclass(eq=False)
class Replay:
    """Results of a computation, read from a journal if available.

    Attributes:
        journal: journal with records of type :data:`RECORD`; None to store nothing.
        asked: number of results requested so far.
    """

    journal: Journal | None = None
    asked: int = field(default=0, init=False)

    def recall(
        self, compute: Callable[[], tuple[ArrayLike, ...]], *given: ArrayLike
    ) -> tuple[NDArray, ...]:
        """Return the next result, which is computed unless the journal contains it.

        Args:
            compute: function that computes the result.
            given: all arguments on which the result depends.

        Returns:
            The return values of ``compute``, as arrays.
        """
        if self.journal is None:
            return tuple(np.asarray(a) for a in compute())
        number, self.asked = self.asked, self.asked + 1
        digest = sha256()
        for one in map(np.asarray, given):
            digest.update(f"{one.dtype} {one.shape} ".encode() + one.tobytes())
        if number in self.journal.places:
            stored = self.journal.read(number)[0].tobytes()
            if stored[:_DIGEST] == digest.digest():
                with np.load(io.BytesIO(stored[_DIGEST:])) as arrays:
                    return tuple(arrays[f"arr_{i}"] for i in range(len(arrays)))
        results = tuple(np.asarray(a) for a in compute())
        content = io.BytesIO()
        np.savez(content, *results)
        record = np.frombuffer(digest.digest() + content.getvalue(), dtype=RECORD)
        self.journal.add(number, record, {})
        return results


@contextmanager
def journalled(
    path: Path | None, whose: dict[str, Any]
) -> Generator[Replay, None, None]:
    """Store results in a journal next to an output file.

    Args:
        path: path of the output file; None to store nothing.
        whose: values that identify the computation.

    Yields:
        The results. The journal is removed after the ``with`` block unless an exception
            is raised.

    Raises:
        BadInput: the journal belongs to another computation, or cannot be written.
    """
    if path is None:
        yield Replay()
        return
    with open_journal(journal_path(path), whose, RECORD) as journal:
        yield Replay(journal)
        journal.path.unlink(missing_ok=True)
