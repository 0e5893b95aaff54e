"""Determine the order in which repeats were measured.

Repeated measurements may be spread over the session or made consecutively. If the
machine drifts slowly, consecutive measurements do not contain the drift. Their scatter
then underestimates the variation in the session.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.campaign.campaign import Campaign

# Limits on the fraction of consecutive repeats for the order "mixed".
_FEW, _MOST = 0.2, 0.8
# Smallest time span of interleaved repeats, as a fraction of the session.
_SHORT = 0.1


@dataclass(frozen=True)
class Revisits:
    """Measuring order of rows that were measured more than once.

    Attributes:
        sets: number of sets. A set contains all rows with the same conditions, at least
            two.
        rows: number of rows in these sets.
        others: number of rows outside these sets.
        adjacent: fraction of the repeated rows that directly follow a row of the same
            set.
        span: median time from the first to the last row of a set, as a fraction of the
            duration of the campaign.
    """

    sets: int
    rows: int
    others: int
    adjacent: float
    span: float

    @property
    def order(self) -> str:
        """Order of the repeats as one word or phrase.

        It is ``"interleaved"``, ``"back to back"``, ``"mixed"``, ``"all"`` if the whole
        campaign is one set, or ``"none"`` without repeats.
        """
        if self.sets == 0:
            return "none"
        if self.sets == 1 and self.others == 0:
            return "all"
        if self.adjacent >= _MOST:
            return "back to back"
        if self.adjacent <= _FEW and self.span >= _SHORT:
            return "interleaved"
        return "mixed"


def revisits(campaign: Campaign, kinds: NDArray) -> Revisits:
    """Return the measuring order of rows that were measured more than once.

    Args:
        campaign: campaign of R rows, ordered by ``cov.time`` if it is recorded.
        kinds: (R,) labels, which are equal for repeated rows, such as
            ``campaign.repeat``.
    """
    clock = session_clock(campaign)
    # All points of one measurement are treated as one row.
    visit = campaign.measured_at_once
    _, first = np.unique(np.column_stack([kinds, visit]), axis=0, return_index=True)
    kinds, clock, visit = kinds[first], clock[first], visit[first]
    when = np.full(visit.max(initial=-1) + 1, np.inf)
    np.minimum.at(when, visit, clock)
    place = np.argsort(np.argsort(when, kind="stable"))[visit]
    rows = adjacent = steps = 0
    spans = []
    for kind in np.unique(kinds):
        visits = np.sort(place[kinds == kind])
        if len(visits) > 1:
            rows += len(visits)
            steps += len(visits) - 1
            adjacent += int((np.diff(visits) == 1).sum())
            spans.append(np.ptp(clock[kinds == kind]))
    if not spans:
        return Revisits(0, 0, len(kinds), 0.0, 0.0)
    return Revisits(
        len(spans), rows, len(kinds) - rows, adjacent / steps, float(np.median(spans))
    )


def session_clock(campaign: Campaign) -> NDArray:
    """Return relative times (R,), from 0 at the first to 1 at the last row.

    Args:
        campaign: campaign of R rows.  If ``cov.time`` is absent or constant, rows are
            assumed to be equally spaced in time.
    """
    order = np.arange(len(campaign), dtype=float)
    time = campaign.covariates.get("time", order)
    span = np.ptp(time) if len(time) else 0.0
    return (time - time.min()) / span if span > 0 else order / max(len(order) - 1, 1)
