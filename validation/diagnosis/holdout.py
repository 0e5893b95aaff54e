"""Rows kept aside: whole configurations or spans of time, shared by no two folds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.campaign.campaign import Campaign

_FEWEST = 8  # configurations from which blocks can be kept aside
_SHARE = 4  # one block in this many
SPANS = "spans of time"
_TAIL = 4.0  # degrees of freedom of Student's t


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
    return order * count // len(campaign), SPANS


def gain_over_blocks(
    before: NDArray, after: NDArray, blocks: NDArray
) -> tuple[float, float]:
    """How much likelier readings are foretold, by the scatter between blocks.

    Errors are those of Student's t, so that a reading which neither model foretells,
    a blunder or one next to a singularity, does not decide alone.

    Args:
        before: (N,) squared errors of the cells, over that of the noise.
        after: (N,) the same by another model.
        blocks: (N,) whose each cell is, see :func:`blocks_of`.

    Returns:
        Twice the logarithm of the likelihoods' ratio, and its standard error; zero of
        a single block.  Of errors of about one sigma, the sum by which squares fall.

    Sources:
        Lange, Little, Taylor (1989), Robust statistical modeling using the t
        distribution, J. Am. Stat. Assoc. 84, 881.
    """
    less = (_TAIL + 1) * (np.log1p(before / _TAIL) - np.log1p(after / _TAIL))
    gains = np.array([float(less[blocks == name].sum()) for name in np.unique(blocks)])
    error = gains.std(ddof=1) * np.sqrt(len(gains)) if len(gains) > 1 else 0.0
    return float(gains.sum()), float(error)
