"""Functions learned beside the library's best set, or instead of it.

What the library leaves is searched after its best set, and from the declared machine as
if there were no library; where rows follow one another, after the best set without
effects of time alone, too.  The simplest story is kept, if it foretells what was kept
aside better than the library alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY
from assembly.measurement.conditions import Conditions
from validation.campaign.campaign import Campaign
from validation.diagnosis.background import background
from validation.diagnosis.candidates import Sensitivities
from validation.diagnosis.holdout import SPANS, blocks_of
from validation.diagnosis.lack_of_fit import SIGNIFICANT, lack_of_fit
from validation.diagnosis.learning import Learned, Lesson, cost, learn
from validation.diagnosis.refit import Fit, refit, with_clearance_held
from validation.diagnosis.registration import device_frame
from validation.diagnosis.remainder import Unexplained
from validation.diagnosis.responses import responses
from validation.diagnosis.selection import Selection, Update


def taught(
    campaign: Campaign,
    conditions: Conditions,
    used: NDArray,
    selection: Selection,
    update: Update,
    known: "Taught | None" = None,
) -> "tuple[Selection, Taught]":
    """Learn what the library leaves, where that is more than noise.

    Args:
        campaign: of R rows.
        conditions: conditions of all rows, as declared and registered.
        used: mask (R,) of the rows fitted.
        selection: what the library says of them.
        update: told what is done, how much of it and of how much.
        known: what was learned with a smaller sigma: no other functions are looked
            for, and no other story.

    Returns:
        The selection with the functions behind its effects, or what was given, and what
        was learned.
    """
    fitting, some = campaign.take(used), conditions.take(used)
    left = selection.behind.left(selection.fit.residual)
    unknowns = selection.unknowns + round(selection.behind.unknowns)
    enough = lack_of_fit(fitting, left, unknowns).probability > SIGNIFICANT
    if enough and not _timed(campaign, selection):
        return selection, NOTHING
    response = responses(conditions)
    sensitivities = Sensitivities(conditions, campaign.robot, response)
    best: tuple[_Story, Lesson] | None = None
    functions = None if known is None else known.functions
    for story in _stories(fitting, some, selection):
        if known is not None and known.kind != story.kind:
            continue
        left_over = Unexplained(selection.terms, story.fit.residual, story.columns)
        lesson = learn(campaign, used, sensitivities, left_over, update, functions)
        if best is None or lesson.cost < best[1].cost:
            best = story, lesson
    if best is None or not best[1].learned:
        return selection, NOTHING
    story, lesson = best
    behind = background(lesson.terms, lesson.prior)
    fit = refit(
        fitting,
        with_clearance_held(some, story.fit),
        story.fit.hypotheses,
        story.fit.values,
        behind=behind,
    )
    told = replace(selection, fit=fit, behind=behind, terms=lesson.terms)
    if story.members != selection.sets[0].members:
        own = selection.screen.fit(story.members)
        device = selection.unknowns - selection.sets[0].rank
        told = replace(told, sets=[own, *selection.sets], unknowns=own.rank + device)
    return told, Taught(lesson.learned, story.kind)


@dataclass(frozen=True, eq=False)
class Taught:
    """What was learned, and beside what.

    Attributes:
        functions: in the order found.
        kind: of the story that they belong to.
    """

    functions: tuple[Learned, ...]
    kind: str


NOTHING = Taught((), "")


@dataclass(frozen=True, eq=False)
class _Story:
    """Effects of the library beside which functions are looked for.

    Attributes:
        kind: in a word.
        members: their hypotheses among those scored.
        fit: of them.
        columns: (N, k) whitened change of the readings per unknown.
    """

    kind: str
    members: tuple[int, ...]
    fit: Fit
    columns: NDArray


def _stories(fitting: Campaign, some: Conditions, selection: Selection) -> list[_Story]:
    """No effect at all; the best set; that set without effects of time alone."""
    device = [device_frame(some)] if fitting.registration == "unknown" else []
    members, fit, columns = selection.sets[0].members, selection.fit, selection.columns
    begin = np.concatenate([np.zeros(0), *(h.start for h in device)])
    alone = refit(fitting, some, device, begin)
    stories = [_Story("alone", (), alone, columns[:, : len(begin)])]
    if not (members and selection.sets[0].rank):
        return stories
    raw = replace(fit, residual=selection.behind.raw(fit.residual))
    stories.append(_Story("beside", members, raw, columns))
    # what changes in time by itself stands for whatever changed meanwhile
    effects = selection.screen.effects
    timeless = tuple(i for i in members if not _of_time(effects[i]))
    if blocks_of(fitting)[1] == SPANS and 0 < len(timeless) < len(members):
        hypotheses = [h for h in fit.hypotheses if not _of_time(h.effect)]
        kept = np.repeat(
            [not _of_time(h.effect) for h in fit.hypotheses],
            [len(h.slots) for h in fit.hypotheses],
        )
        again = refit(fitting, some, hypotheses, fit.values[kept])
        stories.append(_Story("timeless", timeless, again, columns[:, kept]))
    return stories


def _timed(campaign: Campaign, selection: Selection) -> bool:
    """Whether effects of time alone were fitted to rows that follow one another.

    They fit whatever changes slowly, and foretell little of it.

    Returns:
        Whether there is such an effect in the best set.
    """
    effects = (selection.screen.effects[i] for i in selection.sets[0].members)
    return blocks_of(campaign)[1] == SPANS and any(map(_of_time, effects))


def _of_time(effect: str) -> bool:
    """Whether nothing but time drives an effect of the library."""
    return effect in LIBRARY and LIBRARY[effect].needs == ("time",)


def cost_of(selection: Selection) -> float:
    """What a fitted story costs, as :attr:`.learning.Lesson.cost`: least is best."""
    left = selection.behind.left(selection.fit.residual)
    unknowns = selection.unknowns + selection.behind.unknowns
    return cost(len(left), float(left @ left), unknowns)
