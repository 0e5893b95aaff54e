"""Held-out rows: whole configurations or time spans, which are never split.

A campaign of 60 configurations or more is split once.  A smaller one is tested by
nested cross-validation, because a quarter of few configurations is too small a sample:
in each fold the whole diagnosis is repeated without the fold's rows.  No reading of a
held-out row is used before the verdict.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.campaign.campaign import Campaign

FEWEST = 8  # smallest number of blocks of rows for a test on held-out rows
# number of configurations from which on a single part of the rows is held out
_SPLIT = 60
# share of held-out blocks if there are 60 blocks, and if there are many blocks
_SHARES = (1 / 4, 1 / 10)
_ENOUGH = 60  # number of held-out blocks that is sufficient for any campaign
# number of folds (Hastie, Tibshirani, Friedman, Elements of Statistical Learning, 7.10)
_FOLDS = 5
SPANS = "spans of time"


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The held-out rows, and the method of holding out.

    Attributes:
        how: ``"split"``, ``"folds"`` or ``"none"``.
        folds: (R,) bool for each fold, True for its held-out rows; a split has one
            fold.
        words: description of the method.
    """

    how: str
    folds: tuple[NDArray, ...]
    words: str

    @property
    def rows(self) -> NDArray:
        """(R,) bool, True for rows that are held out in any fold."""
        return np.any(self.folds, axis=0)


def hold_out(campaign: Campaign) -> HeldOut:
    """Choose the held-out rows of a diagnosis.

    Returns:
        The held-out rows, always the same for the same campaign.  The method is
        ``"none"`` for fewer than two blocks; all rows are then tested by their own fit.
    """
    blocks, kind = blocks_of(campaign)
    names = np.random.default_rng(0).permutation(np.unique(blocks))
    count = len(names)
    if count < 2:
        every = np.ones(len(campaign), dtype=bool)
        return HeldOut("none", (every,), "no rows held out: too few to spare")
    if count >= _SPLIT:
        quarter, tenth = (round(share * count) for share in _SHARES)
        chosen = max(min(quarter, _ENOUGH), tenth)
        held = np.isin(blocks, names[:chosen])
        words = (
            f"{int(held.sum())} rows of {chosen} of {count} {kind}, drawn once, "
            "held out from every choice and every fit"
        )
        return HeldOut("split", (held,), words)
    parts = np.array_split(names, min(_FOLDS, count))
    words = (
        f"{len(parts)} folds over {count} {kind}: in each the whole diagnosis is "
        "made without its rows"
    )
    return HeldOut("folds", tuple(np.isin(blocks, part) for part in parts), words)


def hidden(campaign: Campaign, rows: NDArray) -> Campaign:
    """Return campaign with readings of rows (R,) bool set to NaN; commands remain."""
    readings = np.where(rows[:, None], np.nan, campaign.measured)
    return replace(campaign, measured=readings)


def drawn(visit: NDArray, most: int) -> NDArray:
    """Return (R,) bool: about ``most`` random rows, rows of a visit together."""
    listed = np.unique(visit)
    count = most * len(listed) // max(len(visit), 1)
    return np.isin(visit, np.random.default_rng(0).permutation(listed)[:count])


def blocks_of(campaign: Campaign) -> tuple[NDArray, str]:
    """Return the blocks that are either fitted or predicted as a whole.

    Returns:
        (R,) number of the configuration, or of a time span if there are too few
        configurations; and which of the two, as text.
    """
    blocks = campaign.configuration
    if len(np.unique(blocks)) >= FEWEST:
        return blocks, "configurations"
    time = campaign.covariates.get("time", np.arange(len(campaign)))
    # points that are measured together are in one time span
    _, first, visit = np.unique(
        campaign.measured_at_once, return_index=True, return_inverse=True
    )
    order = np.argsort(np.argsort(time[first], kind="stable"))[visit]
    count = min(2 * FEWEST, len(first))
    return order * count // len(first), SPANS
