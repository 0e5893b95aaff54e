"""Entry points through which other installed distributions extend forcefit.

A distribution declares its objects in its ``pyproject.toml``::

    [project.entry-points."forcefit.readers"]
    cad = "their_package.robots:read"

The groups are ``forcefit.readers``, ``forcefit.effects`` and ``forcefit.link_models``;
docs/extensions.md describes them.
"""

import sys
from collections.abc import Callable
from functools import lru_cache, wraps
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from forcefit.inputs.errors import BadInput, one_line

Result = TypeVar("Result")


def installed_names(group: str) -> tuple[str, ...]:
    """Return the names in a group, sorted alphabetically, without importing them."""
    return tuple(sorted({point.name for point in _points(group, tuple(sys.path))}))


def load_installed(group: str, name: str, kind: str) -> tuple[Any, str]:
    """Import the object that a distribution has installed under a name.

    Args:
        group: entry point group, for example ``"forcefit.effects"``.
        name: one of :func:`installed_names`.
        kind: type of the object as used in messages, for example ``"effect"``.

    Returns:
        The object, and a description such as ``"the effect their:WEAR of
        their-robots"``.

    Raises:
        BadInput: several distributions install this name, or the object cannot be
            imported; the message names the distributions.
    """
    found = _named(group, name)
    if len(found) > 1:
        owners = " and ".join(sorted(map(_owner, found)))
        raise BadInput(
            f"found the {kind} {name} in {owners}, expected it in one distribution; "
            "uninstall the others"
        )
    (point,) = found
    words = f"the {kind} {point.value} of {_owner(point)}"
    try:
        return point.load(), words
    except Exception as error:  # code of other distributions may raise any error
        fault = f"{type(error).__name__}: {error}"
        text = str(error) if isinstance(error, ImportError) else fault
        raise BadInput(
            f"{words} cannot be imported: {' '.join(text.split())}"
        ) from None


def naming_owner(function: Callable[..., Result], words: str) -> Callable[..., Result]:
    """Wrap a function so that its errors name the distribution that installed it.

    Args:
        function: function from another distribution.
        words: description of the function, from :func:`load_installed`.

    Returns:
        Function with the same result.  An error other than ``BadInput`` is replaced by
        a ``BadInput`` that contains ``words`` and has the original error as its cause.
    """

    @wraps(function)
    def call(*values: Any, **options: Any) -> Result:
        try:
            return function(*values, **options)
        except BadInput:
            raise
        except Exception as error:  # code of other distributions may raise any error
            raise BadInput(f"{words} failed: {_fault(error)}") from error

    return call


def _fault(error: Exception) -> str:
    """Return the type and message of an error on one line."""
    return one_line(f"{type(error).__name__}: {error}", 200)


def version_of_installed(group: str, name: str) -> str:
    """Return the name and version of the distribution that provides an object."""
    dists = [point.dist for point in _named(group, name) if point.dist is not None]
    return ", ".join(f"{dist.name} {dist.version}" for dist in dists)


def _named(group: str, name: str) -> list[EntryPoint]:
    """Return the entry points with a given name."""
    return [p for p in _points(group, tuple(sys.path)) if p.name == name]


@lru_cache(maxsize=16)
def _points(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group; the cache key ``path`` is ``sys.path``."""
    return tuple(entry_points(group=group))


def _owner(point: EntryPoint) -> str:
    """Return the name of the distribution that contains an entry point."""
    return "an unknown distribution" if point.dist is None else point.dist.name
