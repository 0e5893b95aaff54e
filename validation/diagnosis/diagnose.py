"""Diagnose a campaign, that is, find effects missing from its declared model.

Steps:

1. choose the held-out rows (:mod:`.holdout`); their readings are first used in step 5;
2. search the other rows for set-up blunders (:mod:`.setup_blunders`), then for effects
and functions (:mod:`.trace`);
3. fit all unknown parameters of the machine together, by the function that predicts
with the saved file (:mod:`.fit`); drop effects that the readings do not support
(:mod:`.claims`);
4. with folds, repeat steps 2 and 3 for each fold and for all rows;
5. compute the errors of the fitted robots on the held-out rows, and the verdict.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.columns import FUNCTION
from forcefit.validation.diagnosis.declared import declared
from forcefit.validation.diagnosis.diagnosis import Diagnosis
from forcefit.validation.diagnosis.fit import MachineFit
from forcefit.validation.diagnosis.holdout import HeldOut, hidden, hold_out
from forcefit.validation.diagnosis.judge import Judged, judge
from forcefit.validation.diagnosis.nuisance import GEOMETRY, SPRINGS
from forcefit.validation.diagnosis.setup_blunders import SetupBlunder, setup_blunders
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.diagnosis.trace import Traced, trace

Update = Callable[[str, int, int], None]


def diagnose(
    campaign: Campaign,
    *,
    finite: bool = False,
    odds: Mapping[str, float] = MappingProxyType({}),
    update: Update = lambda what, done, total: None,
) -> Diagnosis:
    """Find the effects that explain a campaign's residual from the declared model.

    Args:
        campaign: measured deviations.
        finite: whether the declared model computes finite motions in the search.
            Finite motions are always computed if the robot file contains the effect
            ``geometric_stiffening``.
        odds: mapping from the name of an effect, ``"function"`` (any function),
            ``"geometry"`` or ``"springs"`` to a factor on its prior odds; 0 excludes
            it.
        update: function called with the name of the step, the finished count and the
            total.

    Returns:
        The diagnosis.

    Raises:
        BadInput: the pose of the measuring frame is unknown and the readings do not
            determine it.
    """
    held = hold_out(campaign)
    design = declared(campaign, finite=finite)  # common to all folds

    def found(rows: NDArray) -> tuple[Traced, MachineFit, tuple[SetupBlunder, ...]]:
        """Search and fit selected rows; return search, fitted machine and blunders."""
        part = hidden(campaign, ~rows)
        seen = part.cells.any(axis=1)
        setup = setup_blunders(part.take(seen), conditions_of(part).take(seen))
        # Set-up blunders rule out a search for effects, which would imitate them.
        nothing = dict.fromkeys((*LIBRARY, FUNCTION, GEOMETRY, SPRINGS), 0.0)
        own = nothing if setup else odds
        return *trace(part, rows, design, update, odds=own), setup

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
        Judged(fit, traced.used, rows)
        for (traced, fit, _), rows in zip(folds, held.folds, strict=True)
    ]
    traced, fit, setup = best
    return replace(judge(campaign, traced, fit, held, judged), setup=setup)


def _fitted_rows(held: HeldOut, rows: NDArray) -> NDArray:
    """Return a mask (R,) of rows that are not held out, or all if none can be."""
    return np.ones(len(rows), dtype=bool) if held.how == "none" else ~rows
