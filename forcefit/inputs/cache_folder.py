"""Folder in which meshes and solutions of links are kept.

The first writable folder of a list is used.  A read-only installation, a user without a
home folder and a full disk are not errors: if no folder is writable, nothing is kept.
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
    """Return the folders in the order in which they are tried."""
    if given := os.environ.get("FORCEFIT_CACHE"):
        yield Path(given)
    with suppress(RuntimeError):  # no home folder
        yield _of_user() / "forcefit"
    # there is no temporary folder, or it belongs to another user
    with suppress(OSError):
        yield _temporary()


def _of_user() -> Path:
    """Return the user's cache folder on this operating system."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home())
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _temporary() -> Path:
    """Return the user's temporary folder, which only this user can write to."""
    # otherwise other users could write values that forcefit reads
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
