"""Numbers as Fortran writes them: exponents without a letter, or with a D."""

import re
from pathlib import Path

from forcefit.inputs.errors import BadInput, describe

_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]?\d+))?")


def real(path: Path | str, word: str) -> float:
    """Return a number of a file.

    Args:
        path: path of the file, for error messages.
        word: the number, with blanks around it or none.

    Returns:
        Its value.

    Raises:
        BadInput: the text is not a number.
    """
    match = _REAL.fullmatch(word.strip())
    if not match:
        raise BadInput(f"{path}: found {describe(word.strip())}, expected a number")
    mantissa, exponent = match.groups()
    return float(f"{mantissa}e{exponent or 0}")


def whole(path: Path | str, word: str) -> int:
    """Return a whole number of a file.

    Args:
        path: path of the file, for error messages.
        word: the number, with blanks around it or none.

    Returns:
        Its value.

    Raises:
        BadInput: the text is not a whole number.
    """
    try:
        return int(word)
    except ValueError:
        raise BadInput(
            f"{path}: found {describe(word.strip())}, expected a whole number"
        ) from None
