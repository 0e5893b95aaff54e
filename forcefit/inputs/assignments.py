"""Parsing of numbers given by name, such as ``young=2e11,poisson=0.3``."""

import math
from collections.abc import Iterable

from forcefit.inputs.errors import BadInput, nearest


def check_components(given: Iterable[str], place: str, names: Iterable[str]) -> None:
    """Raise an error if numbers are given for unknown components.

    Args:
        given: names for which numbers are given.
        place: option or argument, for the message.
        names: valid names of components.

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
    """Return numbers given as ``NAME=VALUE``, separated by commas or in several texts.

    Args:
        texts: texts such as ``["tx=0.1,tz=-0.5", "rz=0"]``.
        option: name of the option, for error messages.
        largest: largest accepted absolute value.

    Returns:
        The numbers by name.

    Raises:
        BadInput: a text has a different form, or a number is not finite, too large or
            given twice.
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
                f"{option} {name[:60]}: found {value:g}, expected a number of size at "
                f"most {largest:g}"
            )
        values[name] = value
    return values
