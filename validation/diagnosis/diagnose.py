"""Diagnose a campaign, that is, find effects that its robot file does not contain.

Steps:

1. Choose the held-out rows (:mod:`.holdout`), which are first used in step 5.
2. Search the other rows for set-up blunders (:mod:`.setup_blunders`), then for effects
   and functions (:mod:`.trace`).
3. Fit all unknown parameters of the machine together (:mod:`.fit`). Drop effects that
   the readings do not support (:mod:`.claims`).
4. With cross-validation, repeat steps 2 and 3 for each fold.
5. Compute the errors of the fitted robots on the held-out rows, and the verdict.
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
    """Find the effects that explain the deviations of a machine from its model.

    Args:
        campaign: measured deviations.
        finite: whether the search computes finite motions of the declared model.  It
            always does if the robot file contains ``geometric_stiffening``.
        odds: factors on prior odds, by name of the effect. The names ``"function"``
            (any function), ``"geometry"`` and ``"springs"`` are also accepted. A factor
            of 0 excludes the effect.
        update: function called with the name of the step, the number of finished parts
            of the step and the number of all parts.

    Returns:
        The diagnosis.

    Raises:
        BadInput: the pose of the measuring frame is unknown and the readings do not
            determine it.
    """
    held = hold_out(campaign)
    design = declared(campaign, finite=finite)  # the same for all folds

    def found(rows: NDArray) -> tuple[Traced, MachineFit, tuple[SetupBlunder, ...]]:
        """Search for effects in selected rows, and fit the machine to these rows.

        Returns:
            The result of the search, the fitted machine, and the set-up blunders.
        """
        part = hidden(campaign, ~rows)
        seen = part.cells.any(axis=1)
        setup = setup_blunders(part.take(seen), conditions_of(part).take(seen))
        # If there are set-up blunders, no effects are searched for, because an effect
        # can explain the same deviations as a blunder.
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
    """Return a mask (R,) of the fitted rows.

    These are the rows that are not held out.  If all rows are held out in folds, all
    rows are fitted.
    """
    return np.ones(len(rows), dtype=bool) if held.how == "none" else ~rows
