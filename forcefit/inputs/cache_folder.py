"""Where meshes and links' solutions are kept: the first folder that can be written.

A read-only installation, a user without a home or with a read-only one, and a full
disk are no errors: the next folder is tried, and where there is none nothing is kept.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def cache_folder() -> Path | None:
    """Return the folder for what is computed once: an absent one is made.

    Returns:
        ``$FORCEFIT_CACHE``, the user's cache folder or one of the user's own among the
        temporary files, the first that can be written; None if none can.
    """
    return next((folder for folder in _candidates() if is_writable(folder)), None)


def is_writable(folder: Path) -> bool:
    """Return whether a file can be made in a folder, which is made if it is absent."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _candidates() -> Iterator[Path]:
    """Folders in the order in which they are tried."""
    if given := os.environ.get("FORCEFIT_CACHE"):
        yield Path(given)
    with suppress(RuntimeError):  # a user without a home
        yield _of_user() / "forcefit"
    with suppress(OSError):  # no temporary folder, or somebody else's
        yield _temporary()


def _of_user() -> Path:
    """Return the user's cache folder, as each system has it."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home())
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _temporary() -> Path:
    """The user's own folder among the temporary files, writable by this user only."""
    # numbers of other programs are read from it
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"forcefit-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if hasattr(os, "getuid") and (found.st_uid != user or found.st_mode & 0o022):
        raise PermissionError(f"{folder}: belongs to somebody else")
    return folder
