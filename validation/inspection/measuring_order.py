"""Order of a campaign's repeats: spread over the session, or directly in a row.

Under a slow drift, repeats directly in a row agree better with each other than with the
other rows.  Their noise is then smaller than the effect of the drift on the other rows.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.campaign.campaign import Campaign

_FEW, _MOST = 0.2, 0.8  # limits of the share of repeats that directly follow each other
# largest share of the session between first and last row of a set measured in a row
_SHORT = 0.1


@dataclass(frozen=True)
class Revisits:
    """Order of rows of one kind in the session.

    Attributes:
        sets: number of sets, that is kinds of rows that were measured more than once.
        rows: number of rows in these sets.
        others: number of rows outside these sets.
        adjacent: share of the repeats that directly follow another row of their set.
        span: median time from the first to the last row of a set, as a share of the
            session.
    """

    sets: int
    rows: int
    others: int
    adjacent: float
    span: float

    @property
    def order(self) -> str:
        """``"interleaved"``, ``"back to back"``, ``"mixed"``, ``"all"``, ``"none"``.

        ``"all"`` means that the whole campaign is one set.
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
    """Return the order in the session of rows that were measured more than once.

    Args:
        campaign: campaign of R rows, ordered by ``cov.time`` or else as in the file.
        kinds: (R,) int, such as ``campaign.repeat`` or ``campaign.configuration``.

    Returns:
        The order of the rows.
    """
    clock = session_clock(campaign)
    # rows of several points measured at once count as one row
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
    """Return (R,) times, from 0 at the first to 1 at the last measurement.

    Args:
        campaign: campaign with a varying ``cov.time``; otherwise the order of its rows
            is used.

    Returns:
        The relative times.
    """
    order = np.arange(len(campaign), dtype=float)
    time = campaign.covariates.get("time", order)
    span = np.ptp(time) if len(time) else 0.0
    return (time - time.min()) / span if span > 0 else order / max(len(order) - 1, 1)
