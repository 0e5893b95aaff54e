"""Locks on files, so that only one program at a time writes them.

The operating system locks a file ``FILE.lock`` next to the file, until the program
ends.  A killed program leaves ``FILE.lock``; the next program removes it.
"""

import atexit
import errno
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

# errors of network disks that do not support locks
_NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP}
_POLL = 0.01  # [s] time between two attempts to lock a file


@contextmanager
def locked_file(path: Path, wait: bool = True) -> Generator[None, None, None]:
    """Lock a file against other programs.

    Nothing is locked if the package filelock is missing or the disk has no locks.

    Args:
        path: file to lock, created if it is absent.  The program with the lock may
            rename or remove it.
        wait: wait until another program unlocks the file.

    Yields:
        Nothing; the file is locked until the block ends.

    Raises:
        BlockingIOError: another program has locked it, and ``wait`` is False.
        OSError: the file cannot be opened.
    """
    with _lock(path.with_name(path.name + ".lock"), wait):
        path.touch()
        yield


@contextmanager
def _lock(own: Path, wait: bool) -> Generator[None, None, None]:
    """Hold the lock on a file that exists only for it; remove it at the end."""
    try:
        from filelock import FileLock, Timeout
    except ModuleNotFoundError:  # forcefit works without the package
        yield
        return
    lock = FileLock(own, thread_local=False, poll_interval=_POLL)
    _locks[id(lock)] = lock, own
    new = not own.exists()
    try:
        try:
            lock.acquire(timeout=-1 if wait else 0)
        except Timeout:
            raise BlockingIOError(errno.EWOULDBLOCK, "locked", str(own)) from None
        except BaseException as error:  # such as a full disk or a signal
            if new and not lock.is_locked:
                own.unlink(missing_ok=True)
            if getattr(error, "errno", None) not in _NO_LOCKS:
                raise
        yield
    finally:
        _release(lock, own)
        del _locks[id(lock)]


# locks to release when the program ends, because a signal may prevent an earlier
# release
_locks: dict[int, tuple[Any, Path]] = {}


@atexit.register
def _release_all() -> None:
    for lock, own in list(_locks.values()):
        _release(lock, own)


def _release(lock: Any, own: Path) -> None:
    """Remove the file of a lock and release it; another program's lock remains."""
    # removed while it is locked, so that a waiting program notices this and creates a
    # new file; Windows cannot remove an open file, but releasing the lock removes it
    if lock.is_locked:
        with suppress(OSError):
            own.unlink()
        lock.release()
