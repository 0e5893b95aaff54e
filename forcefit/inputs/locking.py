"""File locks, with which only one program at a time writes a file.

The operating system locks an extra file ``FILE.lock`` next to the file until the
program ends.  If a program is killed, ``FILE.lock`` remains; the next program removes
it.
"""

import atexit
import errno
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

# error numbers that network disks without support for locks return
_NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP}
_POLL = 0.01  # [s] time between two attempts to lock a file


@contextmanager
def locked_file(path: Path, wait: bool = True) -> Generator[None, None, None]:
    """Lock a file so that other forcefit programs cannot write it.

    Nothing is locked if the package filelock is not installed or the disk does not
    support locks.

    Args:
        path: file to lock.  The program that holds the lock may rename or remove it.
        wait: whether to wait until another program unlocks the file.

    Yields:
        None; the file is locked until the block ends.

    Raises:
        BlockingIOError: another program has locked the file, and ``wait`` is False.
        OSError: the file cannot be opened.
    """
    with _lock(path.with_name(path.name + ".lock"), wait):
        path.touch()
        yield


@contextmanager
def _lock(own: Path, wait: bool) -> Generator[None, None, None]:
    """Lock an extra file during a block, and remove this file at the end."""
    try:
        from filelock import FileLock, Timeout
    except ModuleNotFoundError:  # forcefit also works without the package filelock
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
        except BaseException as error:  # for example because of a full disk or a signal
            if new and not lock.is_locked:
                own.unlink(missing_ok=True)
            if getattr(error, "errno", None) not in _NO_LOCKS:
                raise
        yield
    finally:
        _release(lock, own)
        del _locks[id(lock)]


# locks that are released when the program ends, because a signal may have prevented
# their release
_locks: dict[int, tuple[Any, Path]] = {}


@atexit.register
def _release_all() -> None:
    for lock, own in list(_locks.values()):
        _release(lock, own)


def _release(lock: Any, own: Path) -> None:
    """Remove a lock file and release the lock; keep other programs' lock files."""
    # The file is removed while it is locked: a waiting program then notices the removal
    # and creates a new file.  Windows removes the file when the lock is released.
    if lock.is_locked:
        with suppress(OSError):
            own.unlink()
        lock.release()
