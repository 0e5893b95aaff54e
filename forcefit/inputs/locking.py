"""Files that one program at a time may write.

The lock is the operating system's, on a file ``FILE.lock`` next to the file; it ends
with the program that holds it.  A killed one leaves ``FILE.lock``, which the next takes
away.
"""

import atexit
import errno
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

_NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP}  # some network disks
_POLL = 0.01  # [s] between looks at a file that another program has locked


@contextmanager
def locked_file(path: Path, wait: bool = True) -> Generator[None, None, None]:
    """Lock a file against other programs.

    Where the package filelock is missing, or a disk has no locks, nothing is locked.

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
    with _lock(path.with_name(path.name + ".lock"), wait):
        path.touch()
        yield


@contextmanager
def _lock(own: Path, wait: bool) -> Generator[None, None, None]:
    """Hold the lock on a file that is there for that alone, and is removed."""
    try:
        from filelock import FileLock, Timeout
    except ModuleNotFoundError:  # the least that forcefit is installed with
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
        except BaseException as error:  # a full disk, or a signal
            if new and not lock.is_locked:
                own.unlink(missing_ok=True)
            if getattr(error, "errno", None) not in _NO_LOCKS:
                raise
        yield
    finally:
        _release(lock, own)
        del _locks[id(lock)]


# a signal may come before a lock is released: what is left is released at the end
_locks: dict[int, tuple[Any, Path]] = {}


@atexit.register
def _release_all() -> None:
    for lock, own in list(_locks.values()):
        _release(lock, own)


def _release(lock: Any, own: Path) -> None:
    """Remove a lock's file, and release it; that of another program stays."""
    # while it is held: who waits for it sees that it is gone, and makes another;
    # where no open file can be removed (Windows), releasing it does that
    if lock.is_locked:
        with suppress(OSError):
            own.unlink()
        lock.release()
