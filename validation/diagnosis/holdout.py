"""Rows kept aside: whole configurations or spans of time, shared by no two folds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.campaign.campaign import Campaign

_FEWEST = 8  # configurations from which blocks can be kept aside
_SHARE = 4  # one block in this many


@dataclass(frozen=True, eq=False)
class Split:
    """Which rows choose and fit the effects, and which only judge.

    Attributes:
        fitted: (R,) bool.
        how: in words.
    """

    fitted: NDArray
    how: str


def split(campaign: Campaign) -> Split:
    """Keep whole configurations aside; spans of time where there are too few.

    Args:
        campaign: of R rows.

    Returns:
        The split; the same for the same campaign.
    """
    blocks, kind = blocks_of(campaign)
    names = np.unique(blocks)
    kept = np.random.default_rng(0).permutation(names)[: max(1, len(names) // _SHARE)]
    if len(names) < 2:
        return Split(np.ones(len(campaign), dtype=bool), "no rows: too few to spare")
    held = np.isin(blocks, kept)
    how = (
        f"{int(held.sum())} rows of {len(kept)} of {len(names)} {kind}, drawn once, "
        "kept aside from choosing and fitting"
    )
    return Split(~held, how)


def blocks_of(campaign: Campaign) -> tuple[NDArray, str]:
    """What rows that are foretold must not share with rows that are fitted.

    Args:
        campaign: of R rows.

    Returns:
        (R,) number of the configuration, or of a span of time where there are too few;
        and which of the two, in words.
    """
    blocks = campaign.configuration
    if len(np.unique(blocks)) >= _FEWEST:
        return blocks, "configurations"
    time = campaign.covariates.get("time", np.arange(len(campaign)))
    order = np.argsort(np.argsort(time, kind="stable"))
    count = min(2 * _FEWEST, len(campaign))
    return order * count // len(campaign), "spans of time"


def gain_over_blocks(less: NDArray, blocks: NDArray) -> tuple[float, float]:
    """How much smaller errors are in all, by the scatter between blocks.

    Args:
        less: (N,) by which each cell's squared error is smaller.
        blocks: (N,) whose each cell is, see :func:`blocks_of`.

    Returns:
        The sum, and its standard error; zero of a single block.
    """
    gains = np.array([float(less[blocks == name].sum()) for name in np.unique(blocks)])
    error = gains.std(ddof=1) * np.sqrt(len(gains)) if len(gains) > 1 else 0.0
    return float(gains.sum()), float(error)
