"""Choose the rows that are held out of the fits to test the identified machine.

All rows of a configuration, or of a time span, are held out together. A campaign of at
least 60 configurations is split once into fitted and held-out rows.  A smaller campaign
is tested by nested cross-validation.  In each fold, the whole diagnosis is repeated
without the held-out rows of the fold.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.campaign.campaign import Campaign

FEWEST = 8  # smallest number of configurations or time spans for a held-out test
# Smallest number of configurations for a single split.
_SPLIT = 60
# Held-out fraction of the blocks for few blocks, and for many blocks.
_SHARES = (1 / 4, 1 / 10)
_ENOUGH = 60  # number of held-out blocks that is sufficient
# Number of folds (Hastie, Tibshirani, Friedman, Elements of Statistical Learning,
# 7.10).
_FOLDS = 5
SPANS = "spans of time"


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The held-out rows and how they were chosen.

    Attributes:
        how: ``"split"``, ``"folds"`` or ``"none"``.
        folds: mask (R,) of the held-out rows of each fold.  A split has one fold.
        words: description of how the rows were chosen.
    """

    how: str
    folds: tuple[NDArray, ...]
    words: str

    @property
    def rows(self) -> NDArray:
        """Mask (R,), True for rows held out in at least one fold."""
        return np.any(self.folds, axis=0)


def hold_out(campaign: Campaign) -> HeldOut:
    """Choose the held-out rows of a diagnosis.

    Returns:
        The held-out rows. If there are fewer than two blocks, ``how`` is ``"none"``,
        and all rows are both fitted and tested.
    """
    blocks, kind = blocks_of(campaign)
    names = np.random.default_rng(0).permutation(np.unique(blocks))
    count = len(names)
    if count < 2:
        every = np.ones(len(campaign), dtype=bool)
        return HeldOut("none", (every,), "no rows held out: there are too few rows")
    if count >= _SPLIT:
        quarter, tenth = (round(share * count) for share in _SHARES)
        chosen = max(min(quarter, _ENOUGH), tenth)
        held = np.isin(blocks, names[:chosen])
        words = (
            f"{int(held.sum())} rows of {chosen} of {count} {kind}, which were not "
            "used to select or fit models"
        )
        return HeldOut("split", (held,), words)
    parts = np.array_split(names, min(_FOLDS, count))
    words = (
        f"{len(parts)} folds over {count} {kind}: the diagnosis is repeated without "
        "the rows of each fold"
    )
    return HeldOut("folds", tuple(np.isin(blocks, part) for part in parts), words)


def hidden(campaign: Campaign, rows: NDArray) -> Campaign:
    """Return a campaign without the readings of selected rows (R,)."""
    readings = np.where(rows[:, None], np.nan, campaign.measured)
    return replace(campaign, measured=readings)


def drawn(visit: NDArray, most: int) -> NDArray:
    """Return a mask (R,) of about ``most`` random rows.

    Rows that were measured together are selected together.
    """
    listed = np.unique(visit)
    count = most * len(listed) // max(len(visit), 1)
    return np.isin(visit, np.random.default_rng(0).permutation(listed)[:count])


def blocks_of(campaign: Campaign) -> tuple[NDArray, str]:
    """Return the blocks, which are groups of rows that are held out together.

    Returns:
        (R,) index of the block of each row, and a description of the blocks. A block
        contains the rows of one configuration. If there are too few configurations, a
        block contains the rows of one time span.
    """
    blocks = campaign.configuration
    if len(np.unique(blocks)) >= FEWEST:
        return blocks, "configurations"
    time = campaign.covariates.get("time", np.arange(len(campaign)))
    # Points measured together belong to one time span.
    _, first, visit = np.unique(
        campaign.measured_at_once, return_index=True, return_inverse=True
    )
    order = np.argsort(np.argsort(time[first], kind="stable"))[visit]
    count = min(2 * FEWEST, len(first))
    return order * count // len(first), SPANS
