"""In which order a campaign was measured: repeats spread over the session, or in a row.

Under a slow drift repeats in a row agree with each other better than with anything
else, so the noise looks smaller than what the drift does to the rest.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.campaign.campaign import Campaign

_FEW, _MOST = 0.2, 0.8  # share of repeats that follow each other directly
_SHORT = 0.1  # of the session, between the first and the last of a set


@dataclass(frozen=True)
class Revisits:
    """How rows of one kind lie in the session.

    Attributes:
        sets: kinds that were measured more than once.
        rows: rows in these sets.
        others: rows of no set.
        adjacent: share of the revisits that follow the visit before directly.
        span: median time from the first to the last visit, as a share of the session.
    """

    sets: int
    rows: int
    others: int
    adjacent: float
    span: float

    @property
    def order(self) -> str:
        """``"interleaved"``, ``"back to back"``, ``"mixed"``, ``"all"``, ``"none"``.

        All: the whole campaign is one set.
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
    """Return how often, and when, the same was measured again.

    Args:
        campaign: of R rows; their order is that of ``cov.time``, else of the file.
        kinds: (R,) int, such as ``campaign.repeat`` or ``campaign.configuration``.

    Returns:
        The answer.
    """
    clock = session_clock(campaign)
    # rows that read points at once are one visit
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
    """(R,) from 0 at the first to 1 at the last measurement.

    Args:
        campaign: whose ``cov.time``, if it varies, or else whose order is taken.

    Returns:
        The clock.
    """
    order = np.arange(len(campaign), dtype=float)
    time = campaign.covariates.get("time", order)
    span = np.ptp(time) if len(time) else 0.0
    return (time - time.min()) / span if span > 0 else order / max(len(order) - 1, 1)
