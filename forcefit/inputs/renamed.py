"""Deprecated names of arguments, fields and values, supported for one more release."""

import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)


def warn_renamed(old: str, new: str, frames: int = 3) -> None:
    """Warn that a name in the caller's code is deprecated.

    Args:
        old: name in the caller's code.
        new: current name.
        frames: number of stack frames from this function to the caller's line that
            contains the name.
    """
    warnings.warn(f"{old} is now {new}", FutureWarning, stacklevel=frames)


def renamed_keywords(
    **new_names: str | tuple[str, Mapping[Any, Any]],
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that accepts deprecated keyword arguments with a warning.

    Args:
        new_names: for each old keyword, the current keyword, or the current keyword
            together with a mapping from old to current values.

    Returns:
        Decorator.
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
    """Return a dataclass decorator that accepts deprecated fields with a warning.

    Args:
        new_names: current field name for each old name.

    Returns:
        Decorator.
    """

    def decorate(cls: C) -> C:
        init = renamed_keywords(**new_names)(cls.__init__)  # type: ignore[misc]
        cls.__init__ = init  # type: ignore[misc]
        return cls

    return decorate


def current_value(argument: str, value: str, new_values: Mapping[str, str]) -> str:
    """Replace a deprecated argument value by the current one, with a warning.

    Args:
        argument: name of the argument, for the warning.
        value: value in the caller's code.
        new_values: current value for each deprecated value.

    Returns:
        The current value, which is ``value`` itself unless it is deprecated.
    """
    if value not in new_values:
        return value
    new = new_values[value]
    warn_renamed(f"{argument}={value!r}", f"{argument}={new!r}", 4)
    return new
