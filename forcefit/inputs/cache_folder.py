"""Folder that stores meshes and solutions of links for later runs.

The first writable folder of a list is used.  If no folder is writable, results are not
stored.  This is not an error: the installation may be read-only, the user may have no
home folder, or the disk may be full.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def cache_folder() -> Path | None:
    """Return the folder of cached results; create it if it is absent.

    Returns:
        The first writable folder of ``$FORCEFIT_CACHE``, the user's cache folder and
        the user's folder among the temporary files; None if none is writable.
    """
    return next((folder for folder in _candidates() if is_writable(folder)), None)


def is_writable(folder: Path) -> bool:
    """Return whether a file can be created in a folder; an absent folder is created."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _candidates() -> Iterator[Path]:
    """Yield the candidate folders in the order in which they are tried."""
    if given := os.environ.get("FORCEFIT_CACHE"):
        yield Path(given)
    with suppress(RuntimeError):  # the user has no home folder
        yield _of_user() / "forcefit"
    # no temporary folder exists, or it belongs to another user
    with suppress(OSError):
        yield _temporary()


def _of_user() -> Path:
    """Return the folder in which this operating system stores a user's caches."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home())
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _temporary() -> Path:
    """Return a temporary folder that only this user can write to."""
    # in a shared folder, other users could write values that forcefit then reads
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"forcefit-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if hasattr(os, "getuid") and (found.st_uid != user or found.st_mode & 0o022):
        raise PermissionError(
            f"{folder}: found a folder of another user or one that others can write "
            "to; expected a private folder: set FORCEFIT_CACHE"
        )
    return folder
