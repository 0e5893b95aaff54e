"""The diagnosis of a campaign: effects that its model lacks, with probabilities.

Steps:

1. choose the rows that judge (:mod:`.holdout`); step 5 is the first to read them;
2. search for set-up blunders (:mod:`.setup_blunders`), then for effects and functions
(:mod:`.trace`), in the other rows;
3. fit all unknown numbers of the machine together, through the function that
      predicts with the saved file (:mod:`.fit`); drop effects that the readings do not
      support (:mod:`.claims`);
4. if there are folds, repeat 2 and 3 for each fold and for all rows;
5. compute the errors of the fitted robots on the held-out rows, and the verdict.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY
from validation.campaign.campaign import Campaign
from validation.diagnosis.columns import FUNCTION
from validation.diagnosis.declared import declared
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.fit import MachineFit
from validation.diagnosis.holdout import HeldOut, hidden, hold_out
from validation.diagnosis.judge import Judged, judge
from validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from validation.diagnosis.setup_blunders import SetupBlunder, setup_blunders
from validation.diagnosis.signatures import conditions_of
from validation.diagnosis.trace import Traced, trace

Update = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class _Found:
    """Result of search and fit without some rows.

    Attributes:
        traced: result of the search.
        fit: the fitted machine.
        setup: blunders of the set-up.
    """

    traced: Traced
    fit: MachineFit
    setup: tuple[SetupBlunder, ...]


def diagnose(
    campaign: Campaign,
    *,
    finite: bool = False,
    odds: Mapping[str, float] = MappingProxyType({}),
    update: Update = lambda what, done, total: None,
) -> Diagnosis:
    """Trace a campaign's residual to the effect that the declared model lacks.

    Args:
        campaign: measured deviations.
        finite: whether motions of the declared model are finite in the search; they
            also are if the robot's file has the effect ``geometric_stiffening``.
        odds: factors on the prior odds of effects by name, of ``"function"`` (any
            function), ``"geometry"`` and ``"springs"``; 0 excludes one.
        update: function called with the step, its progress and its total.

    Returns:
        The diagnosis.

    Raises:
        BadInput: the measuring frame is unknown and cannot be estimated.
    """
    held = hold_out(campaign)
    design = declared(campaign, finite=finite)  # the same in all folds

    def found(rows: NDArray) -> _Found:
        part = hidden(campaign, ~rows)
        seen = part.cells.any(axis=1)
        setup = setup_blunders(part.take(seen), conditions_of(part).take(seen))
        # with blunders any other effect found would imitate them
        nothing = dict.fromkeys((*LIBRARY, FUNCTION, GEOMETRY, SPRINGS), 0.0)
        own = nothing if setup else odds
        return _Found(*trace(part, rows, design, update, odds=own), setup)

    folds = []
    for k, rows in enumerate(held.folds):
        if held.how == "folds":
            update("folds", k, len(held.folds))
        folds.append(found(_fitted_rows(held, rows)))
    best = folds[0]
    if held.how == "folds":
        update("folds", len(held.folds), len(held.folds))
        best = found(np.ones(len(campaign), dtype=bool))
    judged = [
        Judged(one.fit, one.traced.used, rows)
        for one, rows in zip(folds, held.folds, strict=True)
    ]
    diagnosis = judge(campaign, best.traced, best.fit, held, judged)
    return replace(diagnosis, setup=best.setup)


def _fitted_rows(held: HeldOut, rows: NDArray) -> NDArray:
    """Return (R,) bool of rows to fit while others judge; all if none are spared."""
    return np.ones(len(rows), dtype=bool) if held.how == "none" else ~rows
