"""Numbers given by name in text, such as ``young=2e11,poisson=0.3``."""

import math
from collections.abc import Iterable

from forcefit.inputs.errors import BadInput


def parse_assignments(
    texts: Iterable[str], option: str, largest: float = 1e40
) -> dict[str, float]:
    """Return the numbers given as ``NAME=VALUE``, with commas or in several texts.

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
            raise BadInput(f'{option}: "{name[:60]}" is given twice')
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
