"""The diagnosis of a campaign: residual, the effects it shows, and how sure that is.

Order of things, each opened once:

1. rows of whole configurations are kept aside;
2. the measuring frame is found, where it is not known;
3. every hypothesis's signature; all small sets scored; the best refitted in the full
   model, signatures retaken there, and scored again until the best set stays;
4. outlying rows are named, left out, and 3 repeated;
5. is what is left noise?  The verdict;
6. errors before and after on the rows kept aside.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import predict, with_finite_motions, with_second_order
from validation.campaign.campaign import Campaign
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.holdout import split
from validation.diagnosis.judge import BLUNDERS, Settled, judge
from validation.diagnosis.lack_of_fit import (
    believed_noise,
    lack_of_fit,
    outlying,
)
from validation.diagnosis.plausible import impossible_rows
from validation.diagnosis.registration import register
from validation.diagnosis.selection import Selection, Update, select
from validation.diagnosis.signatures import conditions_of, whiten
from validation.diagnosis.small_terms import screws_of
from validation.diagnosis.teaching import taught

_PASSES = 8  # of leaving out rows, believing repeats, and finite geometric errors
_LOOSE = 1.25  # [sigma] what may be left before fits are made less sure
_BENT = 0.1  # [sigma] change of what finite geometric errors add that is looked at


def diagnose(
    campaign: Campaign,
    *,
    finite: bool = False,
    update: Update = lambda what, done, total: None,
) -> Diagnosis:
    """Trace a campaign's residual to the effect that the declared model lacks.

    Args:
        campaign: measured deviations.
        finite: whether motions of the declared model are finite; they are too if the
            robot's file has the effect ``geometric_stiffening``.
        update: told what is done, how much of it and of how much.

    Returns:
        The diagnosis.

    Raises:
        BadInput: the measuring frame is not known and cannot be found.
    """
    rows = split(campaign)
    declared = conditions_of(campaign)
    finite = finite or declared.exact
    complete = with_finite_motions if finite else with_second_order
    declared = conditions = complete(declared)
    if campaign.registration == "unknown":
        conditions = register(campaign.take(rows.fitted), conditions)
    impossible = impossible_rows(campaign)
    outliers = impossible.copy()
    factor, inflation = np.ones(6), 1.0
    for _ in range(_PASSES):
        used = rows.fitted & ~outliers
        fitting = campaign.take(used)
        selection = select(fitting, conditions.take(used), update, finite=finite)
        left = selection.behind.left(selection.fit.residual)
        far = np.zeros_like(outliers)
        called = int((outliers & ~impossible).sum())
        most = max(0, len(campaign) // BLUNDERS - called)
        far[used] = outlying(fitting, left, most)
        bent = _with_errors(campaign, conditions, used, selection, complete)
        if far.any():
            outliers |= far
            continue
        if bent is not conditions:
            conditions = bent
            continue
        selection, learned = taught(campaign, conditions, used, selection, update)
        left = selection.behind.left(selection.fit.residual)
        larger = believed_noise(fitting, left)
        lack = lack_of_fit(
            fitting, left, selection.unknowns + round(selection.behind.unknowns)
        )
        if np.any(larger > 1.0):
            factor = factor * larger
        elif inflation == 1.0 and lack.significant and lack.rms > _LOOSE:
            # what nothing explains must not be fitted as if it were known to a sigma
            inflation = lack.rms
            larger = np.full(6, inflation)
        else:
            break
        campaign = replace(campaign, sigma=campaign.sigma * larger)
    return judge(
        Settled(
            campaign=campaign,
            unregistered=declared,
            conditions=conditions,
            split=rows,
            outliers=outliers,
            noise_factor=factor,
            inflation=inflation,
            selection=selection,
            learned=learned,
            finite=finite,
        )
    )


def _with_errors(
    campaign: Campaign, conditions: Conditions, used: NDArray, selection: Selection,
    complete: Callable[[Conditions], Conditions],
) -> Conditions:  # fmt: skip
    """Conditions whose finite part is that of the geometric errors found, too."""
    # the errors change with it, and are followed until it stays
    behind, fitting = selection.behind, campaign.take(used)
    raw = behind.raw(selection.fit.residual)
    own = [conditions.robot.index(frame.name) for frame in campaign.robot.frames]
    for _ in range(_PASSES):
        values = behind.values(behind.whitened(raw))
        errors = screws_of(campaign, behind.terms, values)
        if not errors.any():
            break
        errors_added = conditions.errors.copy()
        errors_added[:, own] += errors
        bent = complete(replace(conditions, errors=errors_added))
        bent = replace(conditions, second_order=bent.second_order)
        change = (
            predict(bent.take(used)).deviation
            - predict(conditions.take(used)).deviation
        )
        if np.nanmax(np.abs(change / fitting.sigma), initial=0.0) < _BENT:
            break
        conditions, raw = bent, raw - np.nan_to_num(whiten(fitting, change))
    return conditions
