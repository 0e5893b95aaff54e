"""Digest of the program's sources and of the versions of its libraries."""

import hashlib
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType


def sources_hash(packages: Sequence[ModuleType], libraries: Sequence[str]) -> str:
    """Return the SHA-256 of packages' Python sources and of the versions of libraries.

    Args:
        packages: all ``.py`` files in their folders are digested.
        libraries: names of distributions; the digest also covers missing ones.

    Returns:
        The digest, the same wherever the packages are installed.
    """
    digest = hashlib.sha256()
    for package in packages:
        root = Path(str(package.__file__)).parent
        for path in sorted(root.rglob("*.py")):
            # line ends depend on the checkout, so they are unified
            source = path.read_bytes().replace(b"\r\n", b"\n")
            name = path.relative_to(root.parent).as_posix()
            digest.update(f"{name} {len(source)}\n".encode() + source)
    digest.update("\n".join(f"{n} {_version(n)}" for n in libraries).encode())
    return digest.hexdigest()


def _version(name: str) -> str:
    """Return the version of a distribution, or the text that it is absent."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"
