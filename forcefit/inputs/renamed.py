"""Old names of arguments, fields and values: they work for one release and warn."""

import warnings
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)


def warn_renamed(old: str, new: str, frames: int = 3) -> None:
    """Warn that a name is old.

    Args:
        old: the name found.
        new: the name to write in its place.
        frames: of the call stack from here up to the caller's line that has it.
    """
    warnings.warn(f"{old} is now {new}", FutureWarning, stacklevel=frames)


def renamed_keywords(
    **new_names: str | tuple[str, Mapping[Any, Any]],
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Let a function take keywords by their old names too, each with a warning.

    Args:
        new_names: the new keyword by the old one; or a pair of that and of the new
            values by the old ones.

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
    """Return the present word for a value given by its old one, with a warning.

    Args:
        argument: its name, for the warning.
        value: as given.
        new_values: the new word by the old one.

    Returns:
        The new word; the value itself where it is no old one.
    """
    if value not in new_values:
        return value
    new = new_values[value]
    warn_renamed(f"{argument}={value!r}", f"{argument}={new!r}", 4)
    return new
