"""Cache folder, in which meshes and link solutions are stored for later runs.

The first writable folder in a list of candidates is used.  If none is writable, results
are not cached.  This is not an error, because the installation may be read-only, the
user may have no home folder, or the disk may be full.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def cache_folder() -> Path | None:
    """Return the cache folder, which is created if it does not exist.

    Returns:
        The first writable one among ``$FORCEFIT_CACHE``, the user's cache folder and a
        private temporary folder; None if none of them is writable.
    """
    return next((folder for folder in _candidates() if is_writable(folder)), None)


def is_writable(folder: Path) -> bool:
    """Return whether files can be created in a folder; create the folder if needed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _candidates() -> Iterator[Path]:
    """Yield candidate folders in order of preference."""
    if given := os.environ.get("FORCEFIT_CACHE"):
        yield Path(given)
    with suppress(RuntimeError):  # raised if the user has no home folder
        yield _of_user() / "forcefit"
    # OSError is raised if there is no temporary folder or if another user owns it
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
    """Return a temporary folder to which only this user can write."""
    # in a shared folder, other users could plant values that forcefit would then read
    user = os.getuid() if hasattr(os, "getuid") else 0
    folder = Path(tempfile.gettempdir()) / f"forcefit-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if hasattr(os, "getuid") and (found.st_uid != user or found.st_mode & 0o022):
        raise PermissionError(
            f"{folder}: found a folder that another user owns or can write to; "
            "expected a private folder: set FORCEFIT_CACHE"
        )
    return folder
