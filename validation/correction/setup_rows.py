"""Interpret the option ``--setup``, which selects set-up rows."""

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, nearest, quoted
from forcefit.validation.campaign.campaign import Campaign


def setup_rows(campaign: Campaign, text: str) -> NDArray:
    """Return the rows selected by ``--setup``.

    Args:
        campaign: campaign with rows in the order of its file.
        text: ``20`` for the first 20 rows of each session, or a list of row numbers,
            ranges and labels, for example ``1-20,31``.

    Returns:
        Mask (R,) of the rows.  All points in a row of the file are selected together.

    Raises:
        BadInput: the text is neither a number of rows nor a list of existing rows.
    """
    labels = list(campaign.labels)
    order = list(dict.fromkeys(labels))
    parts = [part.strip() for part in text.split(",")]
    if len(parts) == 1 and parts[0].isascii() and parts[0].isdigit():
        chosen = _first(campaign, labels, int(parts[0]))
    else:
        chosen = {label for part in parts for label in _range(part, order)}
    return np.array([label in chosen for label in labels])


def _first(campaign: Campaign, labels: list[str], count: int) -> set[str]:
    """Return the first rows of every session."""
    chosen: set[str] = set()
    for session in campaign.sessions or (None,):
        own = zip(labels, campaign.in_session(session), strict=True)
        there = dict.fromkeys(label for label, is_own in own if is_own)
        chosen |= set(list(there)[:count])
    return chosen


def _range(part: str, order: list[str]) -> list[str]:
    """Return the labels selected by a number, a range of numbers, or a label."""
    if part in order:
        return [part]
    begin, dash, end = part.partition("-")
    numbers = [begin, end] if dash else [begin, begin]
    if all(n.isascii() and n.isdigit() for n in numbers):
        first, last = map(int, numbers)
        if 1 <= first <= last <= len(order):
            return order[first - 1 : last]
        raise BadInput(
            f"--setup: found {quoted(part)}, expected rows 1 to {len(order)}"
        )
    hint = nearest(part, order)
    raise BadInput(
        f"--setup: found {quoted(part)}, expected a row number or a label{hint}"
    )
