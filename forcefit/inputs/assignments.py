"""Parsing of named numbers, for example ``young=2e11,poisson=0.3``."""

import math
from collections.abc import Iterable

from forcefit.inputs.errors import BadInput, nearest


def check_components(given: Iterable[str], place: str, names: Iterable[str]) -> None:
    """Check that all component names are known.

    Args:
        given: names to check.
        place: option or argument, for the message.
        names: valid component names.

    Raises:
        BadInput: a given name is not valid.
    """
    for name in given:
        if name not in names:
            hint = nearest(str(name), names)
            raise BadInput(f'{place}: unknown component "{str(name)[:60]}"{hint}')


def parse_assignments(
    texts: Iterable[str], option: str, largest: float = 1e40
) -> dict[str, float]:
    """Parse ``NAME=VALUE`` assignments, separated by commas or in several strings.

    Args:
        texts: for example ``["tx=0.1,tz=-0.5", "rz=0"]``.
        option: name of the option, for error messages.
        largest: largest accepted absolute value.

    Returns:
        Numbers by name.

    Raises:
        BadInput: an assignment has an invalid form, or a number is not finite, too
            large or given twice.
    """
    values: dict[str, float] = {}
    for part in ",".join(texts).split(","):
        name, equals, text = (piece.strip() for piece in part.partition("="))
        try:
            value = float(text)
        except ValueError:
            equals = ""
        if not (name and equals):
            raise BadInput(f'{option}: found "{part[:60]}", expected NAME=NUMBER')
        if name in values:
            raise BadInput(f'{option}: found "{name[:60]}" twice, expected it once')
        if not math.isfinite(value):
            raise BadInput(
                f"{option} {name[:60]}: found {value}, expected a finite number"
            )
        if abs(value) > largest:
            raise BadInput(
                f"{option} {name[:60]}: found {value:g}, expected a number of "
                f"magnitude at most {largest:g}"
            )
        values[name] = value
    return values
