"""Files that one program at a time may write.

The lock is the operating system's (``flock``): it ends with the program that holds it.
Where there is none (Windows, some network disks) nothing is locked.
"""

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


@contextmanager
def locked_file(path: Path, wait: bool = True) -> Generator[None, None, None]:
    """Lock a file against other programs.

    Args:
        path: of the file, created if it is absent.  The program with the lock may
            rename or remove it.
        wait: until it is unlocked.

    Yields:
        Nothing; the file is locked until the block ends.

    Raises:
        BlockingIOError: another program has locked it, and ``wait`` is False.
        OSError: it cannot be opened.
    """
    if fcntl is None:  # and no open file can be renamed there
        path.touch()
        yield
        return
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(handle, wait)
            if _stands_at(handle, path):
                yield
                return
            # renamed or removed by the other program: there may be a new file
        finally:
            os.close(handle)


def _lock(handle: int, wait: bool) -> None:
    """Lock an open file, if its file system supports locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        raise
    except OSError:  # a disk without locks
        return


def _stands_at(handle: int, path: Path) -> bool:
    """Whether an open file is still the one at its path."""
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(handle), path.stat())
    return False
