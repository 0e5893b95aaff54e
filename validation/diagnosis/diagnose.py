"""The diagnosis of a campaign: which effects its model lacks, and how sure that is.

Steps, each opened once:

1. rows that judge are chosen (:mod:`.holdout`); nothing reads them until step 5;
2. effects and functions are searched for in the other rows (:mod:`.trace`);
3. all unknown numbers of the machine are fitted together, through the function that
   predicts with the saved file (:mod:`.fit`); effects that the readings do not support
   are dropped (:mod:`.claims`);
4. where folds judge, 2 and 3 are done for each fold and for all rows;
5. the errors of the fitted robots on the held-out rows, and the verdict.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.campaign.campaign import Campaign
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.fit import MachineFit
from validation.diagnosis.holdout import HeldOut, hidden, hold_out
from validation.diagnosis.judge import Judged, judge
from validation.diagnosis.trace import Traced, trace

Update = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class _Found:
    """What was searched for and fitted without some rows.

    Attributes:
        traced: what the search found.
        fit: the machine that has it.
    """

    traced: Traced
    fit: MachineFit


def diagnose(
    campaign: Campaign,
    *,
    finite: bool = False,
    update: Update = lambda what, done, total: None,
) -> Diagnosis:
    """Trace a campaign's residual to the effect that the declared model lacks.

    Args:
        campaign: measured deviations.
        finite: whether motions of the declared model are finite in the search; they
            are too if the robot's file has the effect ``geometric_stiffening``.
        update: told what is done, how much of it and of how much.

    Returns:
        The diagnosis.

    Raises:
        BadInput: the measuring frame is not known and cannot be found.
    """
    held = hold_out(campaign)
    folds = []
    for k, rows in enumerate(held.folds):
        if held.how == "folds":
            update("folds", k, len(held.folds))
        folds.append(_found(campaign, _fitted_rows(held, rows), update, finite))
    best = folds[0]
    if held.how == "folds":
        update("folds", len(held.folds), len(held.folds))
        every = np.ones(len(campaign), dtype=bool)
        best = _found(campaign, every, update, finite)
    judged = [
        Judged(one.fit, one.traced.used, rows)
        for one, rows in zip(folds, held.folds, strict=True)
    ]
    return judge(campaign, best.traced, best.fit, held, judged)


def _fitted_rows(held: HeldOut, rows: NDArray) -> NDArray:
    """(R,) bool, rows that are fitted where others judge; all where none is spared."""
    return np.ones(len(rows), dtype=bool) if held.how == "none" else ~rows


def _found(campaign: Campaign, fitted: NDArray, update: Update, finite: bool) -> _Found:
    """Search and fit in some rows; readings of others are not there."""
    return _Found(*trace(hidden(campaign, ~fitted), fitted, update, finite=finite))
