"""Functions learned beside the library's best set, or instead of it.

What the library leaves is searched twice: after its best set, and from the declared
machine as if there were no library.  The simpler story of both is kept, if it foretells
what was kept aside better than the library alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects.effect import Values
from assembly.measurement.conditions import Conditions
from validation.campaign.campaign import Campaign
from validation.diagnosis.candidates import Answers
from validation.diagnosis.evidence import background
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.kept_aside import Model
from validation.diagnosis.lack_of_fit import SIGNIFICANT, lack_of_fit
from validation.diagnosis.learning import Learned, Lesson, learn
from validation.diagnosis.refit import refit
from validation.diagnosis.registration import device_frame
from validation.diagnosis.responses import responses
from validation.diagnosis.scoring import FINITE, Scored
from validation.diagnosis.selection import Selection, Update
from validation.diagnosis.signatures import whiten

_ERROR = 1.0  # standard errors by which rows kept aside must be foretold better


def taught(
    campaign: Campaign,
    here: Conditions,
    used: NDArray,
    found: Selection,
    update: Update,
) -> tuple[Selection, tuple[Learned, ...]]:
    """Learn what the library leaves, where that is more than noise.

    Args:
        campaign: of R rows.
        here: conditions of all rows, as declared and registered.
        used: mask (R,) of the rows fitted.
        found: what the library says of them.
        update: told what is done, how much of it and of how much.

    Returns:
        The selection with the functions behind its effects, or what was given, and the
        functions.
    """
    fitting, some = campaign.take(used), here.take(used)
    left = found.behind.left(found.fit.residual)
    unknowns = found.unknowns + round(found.behind.unknowns)
    if lack_of_fit(fitting, left, unknowns).probability > SIGNIFICANT:
        return found, ()
    answers = responses(here)
    places = Answers(here, campaign.robot, answers)
    device = [device_frame(some)] if campaign.registration == "unknown" else []
    library = [h for h in found.fit.hypotheses if h.effect != FINITE]
    stories = [library] + ([device] if len(library) > len(device) else [])
    lessons: list[tuple[float, Lesson, Selection]] = []
    for members in stories:
        start = found.fit.values if members is library else _start(device)
        fit = refit(fitting, some, members, start)
        columns = _columns(found, members, fit.values)
        lesson = learn(
            campaign, used, here, places, found.terms, fit.residual, columns, update
        )
        behind = background(lesson.terms, lesson.prior)
        fit = refit(fitting, some, members, fit.values, behind=behind)
        sets = found.sets if members is library else [_nothing(found), *found.sets]
        story = replace(found, fit=fit, behind=behind, terms=lesson.terms, sets=sets)
        if members is not library:
            story = replace(story, unknowns=6 * len(device))
        lessons.append((lesson.cost, lesson, story))
    _, lesson, story = min(lessons, key=lambda one: one[0])
    if not lesson.learned:
        return found, ()
    before = Model(here, answers, found.fit, found.behind)
    after = Model(here, answers, story.fit, story.behind, lesson.learned)
    if not _foretells(campaign, ~used, before, after):
        return found, ()
    return story, lesson.learned


def _start(members: Sequence[Hypothesis]) -> NDArray:
    """(k,) where a fit begins."""
    return np.concatenate([np.zeros(0), *(h.start for h in members)])


def _nothing(found: Selection) -> Scored:
    """The set without any effect."""
    return found.screen.fit(())


def _columns(
    found: Selection, members: Sequence[Hypothesis], values: NDArray
) -> NDArray:
    """(N, k) whitened change of the readings per unknown of fitted effects."""
    robot, blocks, at = found.tangents.here.robot, [], 0
    own: list[tuple[Hypothesis, NDArray]] = []
    for h in members:
        own.append((h, values[at : at + len(h.slots)]))
        at += len(h.slots)
    for h, x in own:
        others: Mapping[str, Values] = {
            o.effect: o.public(robot, v) for o, v in own if o.effect != h.effect
        }
        blocks.append(np.nan_to_num(found.tangents.about(h, x, others).columns))
    return np.hstack([np.zeros((len(found.tangents.residual), 0)), *blocks])


def _foretells(campaign: Campaign, held: NDArray, before: Model, after: Model) -> bool:
    """Whether rows kept aside are foretold better, by more than its own uncertainty."""
    if not held.any():
        return True
    judged = campaign.take(held)
    squares = [
        whiten(judged, model.residual(campaign)[held]) ** 2 for model in (before, after)
    ]
    rows = np.nonzero(judged.cells)[0]
    where = judged.configuration[rows]
    gains = np.array([
        float((squares[0] - squares[1])[where == name].sum()) for name in set(where)
    ])
    error = gains.std(ddof=1) * np.sqrt(len(gains)) if len(gains) > 1 else 0.0
    return bool(gains.sum() > _ERROR * error)
