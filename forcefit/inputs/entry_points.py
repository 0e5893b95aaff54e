"""Entry points: objects that other installed distributions add to forcefit.

A distribution names its objects in its ``pyproject.toml``::

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
    """Return the names in a group in alphabetical order, without importing anything."""
    return tuple(sorted({point.name for point in _points(group, tuple(sys.path))}))


def load_installed(group: str, name: str, kind: str) -> tuple[Any, str]:
    """Import the object that a distribution installed under a name.

    Args:
        group: group of the entry points, such as ``"forcefit.effects"``.
        name: one of :func:`installed_names`.
        kind: word for the kind of object in messages, such as ``"effect"``.

    Returns:
        The object, and a text that names it: ``"the effect their:WEAR of
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
    """Return a function whose errors name the distribution that installed it.

    Args:
        function: function of another distribution.
        words: text that names the function, from :func:`load_installed`.

    Returns:
        A function with the same result.  An error other than ``BadInput`` is replaced
        by a ``BadInput`` that contains ``words`` and has this error as its cause.
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
    """Return the type and the message of an error in one line."""
    return one_line(f"{type(error).__name__}: {error}", 200)


def version_of_installed(group: str, name: str) -> str:
    """Return the name and version of the distribution that installs an object."""
    dists = [point.dist for point in _named(group, name) if point.dist is not None]
    return ", ".join(f"{dist.name} {dist.version}" for dist in dists)


def _named(group: str, name: str) -> list[EntryPoint]:
    """Return the entry points with a given name."""
    return [p for p in _points(group, tuple(sys.path)) if p.name == name]


@lru_cache(maxsize=16)
def _points(group: str, path: tuple[str, ...]) -> tuple[EntryPoint, ...]:
    """Return the entry points of a group; ``path`` is ``sys.path``, the cache key."""
    return tuple(entry_points(group=group))


def _owner(point: EntryPoint) -> str:
    """Return the name of the distribution that contains an entry point."""
    return "an unknown distribution" if point.dist is None else point.dist.name
