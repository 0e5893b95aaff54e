"""Old names of arguments, fields and values, valid for one release with a warning."""

import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)


def warn_renamed(old: str, new: str, frames: int = 3) -> None:
    """Warn that a name in the caller's code has been replaced.

    Args:
        old: name in the caller's code.
        new: present name.
        frames: number of frames of the call stack from here to the caller's line that
            contains the name.
    """
    warnings.warn(f"{old} is now {new}", FutureWarning, stacklevel=frames)


def renamed_keywords(
    **new_names: str | tuple[str, Mapping[Any, Any]],
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that accepts old names of keyword arguments and warns.

    Args:
        new_names: for each old keyword, the present keyword; or the present keyword
            together with a mapping from old to present values.

    Returns:
        The decorator.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            for old in new_names.keys() & kwargs.keys():
                given, entry = kwargs.pop(old), new_names[old]
                name = function.__qualname__.removesuffix(".__init__")
                new, values = (entry, {}) if isinstance(entry, str) else entry
                kwargs[new] = values.get(given, given)
                warn_renamed(
                    f"{name}({old}={given!r})", f"{name}({new}={kwargs[new]!r})"
                )
            return function(*args, **kwargs)

        return call

    return decorate


def renamed_fields(**new_names: str) -> Callable[[C], C]:
    """Return a decorator for dataclasses that accepts old names of fields and warns.

    Args:
        new_names: present field for each old field.

    Returns:
        The decorator.
    """

    def decorate(cls: C) -> C:
        init = renamed_keywords(**new_names)(cls.__init__)  # type: ignore[misc]
        cls.__init__ = init  # type: ignore[misc]
        return cls

    return decorate


def current_value(argument: str, value: str, new_values: Mapping[str, str]) -> str:
    """Return the present word for an old word, with a warning.

    Args:
        argument: name of the argument, for the warning.
        value: word in the caller's code.
        new_values: present word for each old word.

    Returns:
        The present word; ``value`` itself if it is not an old word.
    """
    if value not in new_values:
        return value
    new = new_values[value]
    warn_renamed(f"{argument}={value!r}", f"{argument}={new!r}", 4)
    return new
