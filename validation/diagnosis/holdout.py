"""Choose held-out rows as whole configurations or time spans.

A campaign of at least 60 configurations is split once into fitted and held-out rows.  A
smaller campaign is tested by nested cross-validation, because a quarter of few
configurations is too small a sample: in each fold, the whole diagnosis is repeated
without the fold's held-out rows.  No held-out reading is used before the verdict.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.campaign.campaign import Campaign

FEWEST = 8  # smallest number of blocks (configurations or time spans) for a test
# Number of configurations from which a single split is used.
_SPLIT = 60
# Fraction of held-out blocks for 60 blocks, and for many blocks.
_SHARES = (1 / 4, 1 / 10)
_ENOUGH = 60  # number of held-out blocks that suffices for any campaign
# Number of folds (Hastie, Tibshirani, Friedman, Elements of Statistical Learning,
# 7.10).
_FOLDS = 5
SPANS = "spans of time"


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The held-out rows and how they were chosen.

    Attributes:
        how: ``"split"``, ``"folds"`` or ``"none"``.
        folds: (R,) mask of the held-out rows of each fold; a split has a single fold.
        words: description of the method.
    """

    how: str
    folds: tuple[NDArray, ...]
    words: str

    @property
    def rows(self) -> NDArray:
        """(R,) bool, True for rows held out in any fold."""
        return np.any(self.folds, axis=0)


def hold_out(campaign: Campaign) -> HeldOut:
    """Choose the held-out rows of a diagnosis.

    Returns:
        The held-out rows, chosen reproducibly.  The method is ``"none"`` for fewer than
        two blocks; all rows are then both fitted and tested.
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
            f"{int(held.sum())} rows of {chosen} of {count} {kind}, drawn once, "
            "held out from every choice and every fit"
        )
        return HeldOut("split", (held,), words)
    parts = np.array_split(names, min(_FOLDS, count))
    words = (
        f"{len(parts)} folds over {count} {kind}: in each, the whole diagnosis is "
        "repeated without its rows"
    )
    return HeldOut("folds", tuple(np.isin(blocks, part) for part in parts), words)


def hidden(campaign: Campaign, rows: NDArray) -> Campaign:
    """Return a campaign in which the readings of selected rows (R,) are NaN."""
    readings = np.where(rows[:, None], np.nan, campaign.measured)
    return replace(campaign, measured=readings)


def drawn(visit: NDArray, most: int) -> NDArray:
    """Return a mask (R,) of about ``most`` random rows; visits are not split."""
    listed = np.unique(visit)
    count = most * len(listed) // max(len(visit), 1)
    return np.isin(visit, np.random.default_rng(0).permutation(listed)[:count])


def blocks_of(campaign: Campaign) -> tuple[NDArray, str]:
    """Return the blocks that are fitted or predicted as a whole.

    Returns:
        (R,) index of the configuration, or of the time span if there are too few
        configurations; and the kind of block as text.
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
