"""Functions learned beside the library's best set, or instead of it.

What the library leaves is searched twice: after its best set, and from the declared
machine as if there were no library.  The simpler story of both is kept, if it foretells
what was kept aside better than the library alone.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from assembly.model.function import Function
from validation.campaign.campaign import Campaign
from validation.diagnosis.background import background
from validation.diagnosis.candidates import Sensitivities
from validation.diagnosis.holdout import blocks_of, gain_over_blocks
from validation.diagnosis.kept_aside import FittedModel
from validation.diagnosis.lack_of_fit import SIGNIFICANT, lack_of_fit
from validation.diagnosis.learning import Learned, cost, learn, term_name
from validation.diagnosis.refit import refit, with_clearance_held
from validation.diagnosis.registration import device_frame
from validation.diagnosis.remainder import Unexplained
from validation.diagnosis.responses import responses
from validation.diagnosis.selection import Selection, Update
from validation.diagnosis.signatures import whiten

_ERROR = 1.0  # standard errors by which rows kept aside must be foretold better


def taught(
    campaign: Campaign,
    conditions: Conditions,
    used: NDArray,
    selection: Selection,
    update: Update,
    known: tuple[Learned, ...] | None = None,
) -> tuple[Selection, tuple[Learned, ...]]:
    """Learn what the library leaves, where that is more than noise.

    Args:
        campaign: of R rows.
        conditions: conditions of all rows, as declared and registered.
        used: mask (R,) of the rows fitted.
        selection: what the library says of them.
        update: told what is done, how much of it and of how much.
        known: functions found with a smaller sigma, beside which none is looked for.

    Returns:
        The selection with the functions behind its effects, or what was given, and the
        functions.
    """
    fitting, some = campaign.take(used), conditions.take(used)
    left = selection.behind.left(selection.fit.residual)
    unknowns = selection.unknowns + round(selection.behind.unknowns)
    if lack_of_fit(fitting, left, unknowns).probability > SIGNIFICANT:
        return selection, ()
    response = responses(conditions)
    sensitivities = Sensitivities(conditions, campaign.robot, response)
    device = [device_frame(some)] if campaign.registration == "unknown" else []
    begin = np.concatenate([np.zeros(0), *(h.start for h in device)])
    alone = refit(fitting, some, device, begin)
    stories = [(alone, selection.columns[:, : len(begin)])]
    if selection.sets[0].members and selection.sets[0].rank:
        raw = selection.behind.raw(selection.fit.residual)
        stories.append((replace(selection.fit, residual=raw), selection.columns))
    best, lesson, fit = 0, None, alone
    for k, (story, columns) in enumerate(stories):
        left_over = Unexplained(selection.terms, story.residual, columns)
        new = learn(campaign, used, sensitivities, left_over, update, known)
        if lesson is None or new.cost < lesson.cost:
            best, lesson, fit = k, new, story
    assert lesson is not None
    if not lesson.learned:
        return selection, ()
    behind = background(lesson.terms, lesson.prior)
    fit = refit(
        fitting,
        with_clearance_held(some, fit),
        fit.hypotheses,
        fit.values,
        behind=behind,
    )
    told = replace(selection, fit=fit, behind=behind, terms=lesson.terms)
    if best == 0:
        nothing = selection.screen.fit(())
        told = replace(told, sets=[nothing, *selection.sets], unknowns=len(begin))
    held = with_clearance_held(conditions, selection.fit)
    before = FittedModel(held, response, selection.fit, selection.behind)
    after = FittedModel(conditions, response, fit, behind, lesson.learned)
    if not _foretells(campaign, ~used, before, after):
        return selection, ()
    return told, lesson.learned


def cost_of(selection: Selection) -> float:
    """What a fitted story costs, as :attr:`.learning.Lesson.cost`: least is best."""
    left = selection.behind.left(selection.fit.residual)
    unknowns = selection.unknowns + selection.behind.unknowns
    return cost(len(left), float(left @ left), unknowns)


def _foretells(
    campaign: Campaign, held: NDArray, before: FittedModel, after: FittedModel
) -> bool:
    """Whether rows kept aside are foretold better, by more than its own uncertainty."""
    if not held.any():
        return True
    judged = campaign.take(held)
    squares = [
        whiten(judged, model.residual(campaign)[held]) ** 2 for model in (before, after)
    ]
    rows = np.nonzero(judged.cells)[0]
    where = blocks_of(campaign)[0][held][rows]
    gain, error = gain_over_blocks(squares[0], squares[1], where)
    return gain > _ERROR * error


def functions_of(campaign: Campaign, model: FittedModel) -> list[list[Function]]:
    """The functions of a robot file that were learned, with their numbers.

    Args:
        campaign: whose robot.
        model: with what was learned.

    Returns:
        For every effect learned one function, or several of one kind.
    """
    behind = model.behind
    values = behind.values(model.fit.residual)
    terms = zip(behind.terms, values, behind.deviations(), strict=True)
    known = {term.name: (x, std) for term, x, std in terms}
    return [
        model.sensitivities.fitted(one.candidate, *known[term_name(k + 1)])
        for k, one in enumerate(model.learned)
    ]
