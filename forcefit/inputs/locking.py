"""File locks, which ensure that only one process at a time writes a file.

The lock is held on an additional file ``FILE.lock`` in the same folder.  If a process
is killed, the operating system releases the lock, and the next process that uses it
removes ``FILE.lock``.
"""

import atexit
import errno
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

# error numbers returned by network disks that do not support locks
_NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP}
_POLL = 0.01  # [s] time between attempts to lock a file


@contextmanager
def locked_file(path: Path, wait: bool = True) -> Generator[None, None, None]:
    """Lock a file so that other forcefit processes cannot write it.

    The file is not locked if the package filelock is missing or if the disk does not
    support locks.

    Args:
        path: file to lock.  The process that holds the lock may rename or remove it.
        wait: whether to wait until other processes have released the lock.

    Yields:
        None; the file is locked until the block ends.

    Raises:
        BlockingIOError: another process has locked the file, and ``wait`` is False.
        OSError: the file cannot be opened.
    """
    with _lock(path.with_name(path.name + ".lock"), wait):
        path.touch()
        yield


@contextmanager
def _lock(own: Path, wait: bool) -> Generator[None, None, None]:
    """Hold a lock on the file ``own`` during a block, and then remove this file."""
    try:
        from filelock import FileLock, Timeout
    except ModuleNotFoundError:  # filelock is optional
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
        except BaseException as error:  # for example a full disk or a signal
            if new and not lock.is_locked:
                own.unlink(missing_ok=True)
            if getattr(error, "errno", None) not in _NO_LOCKS:
                raise
        yield
    finally:
        _release(lock, own)
        del _locks[id(lock)]


# locks to release when the process ends, because a signal may have prevented their
# release
_locks: dict[int, tuple[Any, Path]] = {}


@atexit.register
def _release_all() -> None:
    for lock, own in list(_locks.values()):
        _release(lock, own)


def _release(lock: Any, own: Path) -> None:
    """Release a lock and remove its file, unless another process holds the lock."""
    # The file is removed while it is still locked, so that a waiting process notices
    # the removal and creates a new file.  Windows removes it on release.
    if lock.is_locked:
        with suppress(OSError):
            own.unlink()
        lock.release()
