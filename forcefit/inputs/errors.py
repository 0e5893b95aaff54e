"""Error messages: one line that states the place, the value found and what is expected.

The command line prints :class:`BadInput`, a subclass of ``ValueError``, and exits with
status 2.  Long values are abbreviated to keep the message short.
"""

import difflib
import math
import reprlib
import sys
import unicodedata
from collections.abc import Iterable

# [characters] longest message, including path, place, value found and value expected
_LONGEST_MESSAGE = 800


class BadInput(ValueError):
    """Error in the input, with a one-line message."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message, _LONGEST_MESSAGE))


def one_line(text: str, longest: int) -> str:
    """Escape control characters and shorten a long text in the middle."""
    if len(text) > longest:
        half = (longest - 5) // 2
        text = f"{text[:half]} ... {text[-half:]}"
    return "".join(c if printable(c) else ascii(c)[1:-1] for c in text)


def printable(text: str) -> bool:
    """Return whether a text has no line breaks, control codes or lone surrogates."""
    return not any(unicodedata.category(c) in {"Cc", "Cs", "Zl", "Zp"} for c in text)


def plot_label(text: str) -> str:
    """Escape dollar signs, between which matplotlib would parse a formula.

    Args:
        text: text that may contain a user-defined name.

    Returns:
        Escaped text.
    """
    return text.replace("$", r"\$")


def quoted(name: str) -> str:
    """Return a name in double quotes, on one line and abbreviated if necessary."""
    return f'"{one_line(name, 60)}"'


def nearest(name: str, valid: Iterable[str]) -> str:
    """Return ``'; did you mean "x"?'``, or list the valid names if none is similar."""
    names = list(dict.fromkeys(str(v) for v in valid))
    close = difflib.get_close_matches(name[:200], names, n=1, cutoff=0.6)
    if close:
        return f"; did you mean {quoted(close[0])}?"
    few = [one_line(v, 40) for v in sorted(names)[:12]]
    shown = ", ".join(few) + (", ..." if len(names) > 12 else "")
    return f"; valid: {shown}" if names else ""


def describe(value: object) -> str:
    """Return a short description of an invalid value."""
    text = _SHORT.repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


class _Short(reprlib.Repr):
    """Abbreviated ``repr`` that also handles integers with thousands of digits."""

    def repr_bool(self, x: bool, level: int) -> str:
        return str(x).lower()

    def repr_int(self, x: int, level: int) -> str:
        if x.bit_length() < 100:
            return str(x)
        return f"an integer of {x.bit_length()} bits"


_SHORT = _Short()
_SHORT.maxstring = 60
_SHORT.maxlist = 8


# upper limit in SI units, which exceeds any length, modulus or density; its inverse is
# the lower limit
LARGEST = 1e15


def checked(
    option: str,
    value: float,
    unit: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    below: float = math.inf,
) -> float:
    """Check that a number is finite and within its range, and return it.

    Args:
        option: name of the option, for example ``--length``, for the error message.
        value: number given by the user.
        unit: unit, for the error message.
        above: exclusive lower bound.
        least: inclusive lower bound.
        below: exclusive upper bound.

    Returns:
        The value.

    Raises:
        BadInput: the value is not finite, is out of range, or is too large or too small
            for a physical quantity.
    """
    if abs(value) > sys.float_info.max:  # true for very large integers
        value = math.copysign(math.inf, 1 if value > 0 else -1)
    if math.isfinite(value) and above < value < below and value >= least:
        in_range = abs(value) <= LARGEST and (above != 0 or value >= 1 / LARGEST)
        if not in_range:
            raise BadInput(
                f"{option}: found {value:g}, expected a magnitude between "
                f"{1 / LARGEST:g} and {LARGEST:g} [{unit}]"
            )
        return value
    limits = [
        f"> {above:g}" if above > -math.inf else "",
        f">= {least:g}" if least > -math.inf else "",
        f"< {below:g}" if below < math.inf else "",
    ]
    range_ = " and ".join(filter(None, limits))
    expected = " ".join(filter(None, ["a finite number", range_, f"[{unit}]"]))
    raise BadInput(f"{option}: found {value:g}, expected {expected}")
