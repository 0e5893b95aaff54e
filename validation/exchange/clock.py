"""Convert the times of devices and controllers to seconds."""

import re
from datetime import UTC, datetime

import numpy as np

from forcefit.inputs.errors import BadInput, describe
from forcefit.validation.campaign.dialect import parse_number
from forcefit.validation.exchange.reading import Writing

DATES = ("day_first", "month_first")
_DATE = re.compile(r"(\d{1,2})([./])(\d{1,2})[./](\d{4})(.*)")
_CLOCK = re.compile(r"\d{1,2}:\d{2}:\d{2}(?:[.,]\d+)?(?: ?[APap][Mm])?")


def parse_time(place: str, text: str, writing: Writing) -> float:
    """Convert the text of a time to seconds.

    Accepted forms are a number of seconds, a time of day, ISO 8601, 14 digits such as
    20261122103000, and a date with a time of day.

    Args:
        place: file and line, for messages.
        text: content of the cell, or a date and a time.
        writing: declared format, which contains the decimal mark and the order of day
            and month in dates with slashes.

    Returns:
        The time [s].  Its origin is arbitrary.

    Raises:
        BadInput: the text has none of these forms.
    """
    number = parse_number(text, writing.decimal)
    digits = text.isascii() and text.isdigit() and len(text) == 14
    if np.isfinite(number) and not digits:
        return float(number)
    try:
        if digits:
            return _seconds(text, "%Y%m%d%H%M%S")
        if _CLOCK.fullmatch(text):
            return _dated("1970", "1", "1", text)
        if match := _DATE.fullmatch(text):
            a, mark, b, year, rest = match.groups()
            if mark == "/" and writing.dates is None:
                raise BadInput(
                    f"{place}: found {describe(text)} with an unknown order of day "
                    'and month; expected dates = "day_first" or "month_first" in '
                    "the targets file"
                )
            swap = mark == "/" and writing.dates == "month_first"
            day, month = (b, a) if swap else (a, b)
            return _dated(year, month, day, rest.strip())
        moment = datetime.fromisoformat(text)
    except BadInput:
        raise
    except ValueError:
        raise BadInput(
            f"{place}: found {describe(text)}, expected a time: seconds, "
            "2026-11-22T10:30:00, 20261122103000 or 22.11.2026 10:30:00"
        ) from None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _dated(year: str, month: str, day: str, clock: str) -> float:
    """Return the time [s] of a date and a clock time such as 9:30:00 PM."""
    clock = clock.replace(",", ".")
    half = clock[-2:].upper() if clock[-1:] in {"M", "m"} else ""
    clock = clock[: len(clock) - len(half)].strip()
    style = ("%I:%M:%S" if half else "%H:%M:%S") + (".%f" if "." in clock else "")
    if "." in clock:
        clock = clock[: clock.index(".") + 7]  # strptime accepts at most six decimals
    suffix = " %p" if half else ""
    text = f"{year}-{month}-{day} {clock} {half}".strip()
    return _seconds(text, f"%Y-%m-%d {style}{suffix}")


def _seconds(text: str, style: str) -> float:
    """Return the seconds since 1970 of a UTC time in a ``strptime`` format."""
    return datetime.strptime(text, style).replace(tzinfo=UTC).timestamp()
