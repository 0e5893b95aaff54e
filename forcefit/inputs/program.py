"""Hash of the program's source code and of the versions of its libraries."""

import hashlib
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType


def sources_hash(packages: Sequence[ModuleType], libraries: Sequence[str]) -> str:
    """Return the SHA-256 of packages' Python sources and of the versions of libraries.

    Args:
        packages: packages; the contents of all ``.py`` files in their folders are
            hashed.
        libraries: names of distributions; a missing distribution changes the hash.

    Returns:
        The hash, which does not depend on where the packages are installed.
    """
    digest = hashlib.sha256()
    for package in packages:
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*.py")):
            # line ends differ between checkouts and are therefore unified before
            # hashing
            source = path.read_bytes().replace(b"\r\n", b"\n")
            name = path.relative_to(root.parent).as_posix()
            digest.update(f"{name} {len(source)}\n".encode() + source)
    digest.update("\n".join(f"{n} {_version(n)}" for n in libraries).encode())
    return digest.hexdigest()


def _version(name: str) -> str:
    """Return the version of a distribution, or a text that states its absence."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"
