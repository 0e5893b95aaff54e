"""Old names of arguments, fields and values: they work for one release and warn."""

import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)


def warn_renamed(old: str, new: str, frames: int = 3) -> None:
    """Warn that a name is an old one.

    Args:
        old: name in the caller's code.
        new: present name.
        frames: number of frames of the call stack up to the caller's line with the
            name.
    """
    warnings.warn(f"{old} is now {new}", FutureWarning, stacklevel=frames)


def renamed_keywords(
    **new_names: str | tuple[str, Mapping[Any, Any]],
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that accepts old names of keywords, each with a warning.

    Args:
        new_names: the present keyword by the old one; or the present keyword and the
            present values by the old values.

    Returns:
        A decorator.
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
    """Let a dataclass be made with fields by their old names too, with a warning.

    Args:
        new_names: the new field by the old one.

    Returns:
        A decorator.
    """

    def decorate(cls: C) -> C:
        init = renamed_keywords(**new_names)(cls.__init__)  # type: ignore[misc]
        cls.__init__ = init  # type: ignore[misc]
        return cls

    return decorate


def current_value(argument: str, value: str, new_values: Mapping[str, str]) -> str:
    """Return the present word for a value given by its old word, with a warning.

    Args:
        argument: name of the argument, for the warning.
        value: word in the caller's code.
        new_values: the present word by the old word.

    Returns:
        The present word; ``value`` itself if it is not an old word.
    """
    if value not in new_values:
        return value
    new = new_values[value]
    warn_renamed(f"{argument}={value!r}", f"{argument}={new!r}", 4)
    return new
