"""Reader of numbers written by Fortran, with a D or no letter before the exponent."""

import re
from pathlib import Path

from forcefit.inputs.errors import BadInput, describe

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]?\d+))?")


def real(path: Path | str, word: str) -> float:
    """Convert a number written by Fortran to a float.

    Args:
        path: path of the file, for error messages.
        word: text of the number, with or without surrounding blanks.

    Returns:
        The value of the number.

    Raises:
        BadInput: the text is not a number.
    """
    match = _REAL.fullmatch(word.strip())
    if not match:
        raise BadInput(f"{path}: found {describe(word.strip())}, expected a number")
    mantissa, exponent = match.groups()
    return float(f"{mantissa}e{exponent or 0}")


def whole(path: Path | str, word: str) -> int:
    """Convert a text from a file to an integer.

    Args:
        path: path of the file, for error messages.
        word: text of the number, with or without surrounding blanks.

    Returns:
        The value of the number.

    Raises:
        BadInput: the text is not an integer.
    """
    try:
        return int(word)
    except ValueError:
        raise BadInput(
            f"{path}: found {describe(word.strip())}, expected a whole number"
        ) from None
