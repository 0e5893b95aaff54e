"""Held-out rows: whole configurations or spans of time, never split between sets.

A campaign of 60 configurations or more is split once.  A smaller one is judged by
cross-validation, because a quarter of few configurations is too small a sample: in each
fold the whole diagnosis is repeated without its rows (nested).  No readings of a
held-out row are used before the verdict.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from validation.campaign.campaign import Campaign

FEWEST = 8  # least number of blocks of rows that can judge
_SPLIT = 60  # number of configurations above which one split judges
_SHARES = (1 / 4, 1 / 10)  # of the blocks held out: of 60, and of many
_ENOUGH = 60  # number of held-out blocks that suffices for any campaign
_FOLDS = 5  # Hastie, Tibshirani, Friedman, Elements of Statistical Learning, 7.10
SPANS = "spans of time"


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The rows that judge, and the method.

    Attributes:
        how: ``"split"``, ``"folds"`` or ``"none"``.
        folds: (R,) bool each, rows held out together; one for a split.
        words: the method in words.
    """

    how: str
    folds: tuple[NDArray, ...]
    words: str

    @property
    def rows(self) -> NDArray:
        """(R,) bool, rows that judge."""
        return np.any(self.folds, axis=0)


def hold_out(campaign: Campaign) -> HeldOut:
    """Choose the rows that judge a diagnosis.

    Returns:
        The same for the same campaign; ``"none"`` for fewer than two blocks, where all
        rows are judged by their own fit.
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
    """Return the campaign with readings of rows (R,) bool set to NaN; commands stay."""
    readings = np.where(rows[:, None], np.nan, campaign.measured)
    return replace(campaign, measured=readings)


def drawn(visit: NDArray, most: int) -> NDArray:
    """Return (R,) bool: about ``most`` rows drawn once, rows of one visit together."""
    listed = np.unique(visit)
    count = most * len(listed) // max(len(visit), 1)
    return np.isin(visit, np.random.default_rng(0).permutation(listed)[:count])


def blocks_of(campaign: Campaign) -> tuple[NDArray, str]:
    """Return the blocks that must not be shared by predicted and fitted rows.

    Returns:
        (R,) number of the configuration, or of a span of time if configurations are too
        few; and which of the two, in words.
    """
    blocks = campaign.configuration
    if len(np.unique(blocks)) >= FEWEST:
        return blocks, "configurations"
    time = campaign.covariates.get("time", np.arange(len(campaign)))
    # points that are measured together are in one span
    _, first, visit = np.unique(
        campaign.measured_at_once, return_index=True, return_inverse=True
    )
    order = np.argsort(np.argsort(time[first], kind="stable"))[visit]
    count = min(2 * FEWEST, len(first))
    return order * count // len(first), SPANS
