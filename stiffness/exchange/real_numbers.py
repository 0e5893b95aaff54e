"""Conversion of numbers in the format of Fortran, such as 1.5D3 and 1.5+3."""

import re
from pathlib import Path

from forcefit.inputs.errors import BadInput, describe

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]?\d+))?")


def real(path: Path | str, word: str) -> float:
    """Convert a text in the format of Fortran to a number.

    Args:
        path: path of the file, for error messages.
        word: text of the number.

    Returns:
        The number.

    Raises:
        BadInput: the text is not a number.
    """
    match = _REAL.fullmatch(word.strip())
    if not match:
        raise BadInput(f"{path}: found {describe(word.strip())}, expected a number")
    mantissa, exponent = match.groups()
    return float(f"{mantissa}e{exponent or 0}")


def whole(path: Path | str, word: str) -> int:
    """Convert a text to an integer.

    Args:
        path: path of the file, for error messages.
        word: text of the number.

    Returns:
        The number.

    Raises:
        BadInput: the text is not an integer.
    """
    try:
        return int(word)
    except ValueError:
        raise BadInput(
            f"{path}: found {describe(word.strip())}, expected a whole number"
        ) from None
