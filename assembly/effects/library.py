"""Library of effects provided by forcefit and by other distributions.

A distribution registers an :class:`forcefit.assembly.effects.effect.Effect`::

    [project.entry-points."forcefit.effects"]
    drive_gain = "their_package:DRIVE_GAIN"   # an Effect of this name

The effect is imported on first use.  Its name must be unique.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from forcefit.assembly.effects.effect import Effect
from forcefit.inputs.entry_points import (
    installed_names,
    load_installed,
    naming_owner,
    version_of_installed,
)
from forcefit.inputs.errors import BadInput

GROUP = "forcefit.effects"


class Library(Mapping[str, Effect]):
    """Effects by name, in the order in which they are applied.

    Effects of other distributions are applied before the foundation, the last effect of
    forcefit.

    Args:
        own: effects of forcefit, in the order of application.
    """

    def __init__(self, own: Sequence[Effect]) -> None:
        self._own = {effect.name: effect for effect in own}

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the effects of other distributions."""
        found = installed_names(GROUP)
        return tuple(name for name in found if name not in self._own)

    def version(self, name: str) -> str:
        """Return the name and version of a distribution; empty for forcefit."""
        return "" if name in self._own else version_of_installed(GROUP, name)

    def __getitem__(self, name: str) -> Effect:
        if name in self._own:
            return self._own[name]
        if name not in self.others:
            raise KeyError(name)
        effect, words = load_installed(GROUP, name, "effect")
        if not isinstance(effect, Effect):
            kind = type(effect).__name__
            raise BadInput(f"{words}: found {kind}, expected an Effect")
        if effect.name != name:
            raise BadInput(
                f"{words}: found the name {effect.name!r}, expected {name!r} as in its "
                "entry point"
            )
        return _naming_owner(effect, words)

    def __iter__(self) -> Iterator[str]:
        *first, last = self._own
        yield from (*first, *self.others, last)

    def __len__(self) -> int:
        return len(self._own) + len(self.others)

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self.others


def _naming_owner(effect: Effect, words: str) -> Effect:
    """Add the name of the distribution to exceptions that its effect raises."""
    functions = {
        one.name: getattr(effect, one.name) for one in fields(effect)
        if callable(getattr(effect, one.name))
    }  # fmt: skip
    named: dict[str, Any] = {
        name: naming_owner(one, words) for name, one in functions.items()
    }
    return replace(effect, **named)
