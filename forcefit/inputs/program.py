"""Hash of the source code and of the library versions."""

import hashlib
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType


def sources_hash(packages: Sequence[ModuleType], libraries: Sequence[str]) -> str:
    """Return the SHA-256 hash of Python sources and library versions.

    Args:
        packages: packages whose ``.py`` files are hashed, including subfolders.
        libraries: names of distributions; installing or removing one changes the hash.

    Returns:
        Hash that does not depend on where the packages are installed.
    """
    digest = hashlib.sha256()
    for package in packages:
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*.py")):
            # line endings may differ between checkouts
            source = path.read_bytes().replace(b"\r\n", b"\n")
            name = path.relative_to(root.parent).as_posix()
            digest.update(f"{name} {len(source)}\n".encode() + source)
    digest.update("\n".join(f"{n} {_version(n)}" for n in libraries).encode())
    return digest.hexdigest()


def _version(name: str) -> str:
    """Return the version of a distribution, or ``absent`` if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"
