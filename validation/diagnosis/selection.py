"""Which set of effects a campaign shows: scored to first order, refitted in full.

All small sets are scored from their signatures; the best and their near rivals are
fitted in the full model, signatures retaken there, and scored again until the best set
stays.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY
from assembly.effects.effect import Values
from assembly.linear.closure import virtual_joints
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import with_rest_positions
from validation.campaign.campaign import Campaign
from validation.diagnosis.background import Background, background
from validation.diagnosis.hypotheses import Hypothesis, hypotheses
from validation.diagnosis.refit import Fit, adds_clearance, in_full, refit, rest_under
from validation.diagnosis.refitting import Refits, names_of
from validation.diagnosis.registration import device_frame
from validation.diagnosis.responses import responses
from validation.diagnosis.scoring import FINITE, Scored, Screen
from validation.diagnosis.screens import (
    BETTER,
    Projector,
    Screens,
    score_beside_squares,
)
from validation.diagnosis.signatures import Signature, Tangents, loaded_components
from validation.diagnosis.small_terms import SmallTerm, small_terms

Update = Callable[[str, int, int], None]

_ROUNDS = 4  # of refitting and scoring again
_VISIBLE = 4.0  # squared whitened change of the readings


@dataclass(frozen=True, eq=False)
class Selection:
    """Sets of hypotheses with their scores, the best fitted in the full model.

    Attributes:
        screen: the scored hypotheses of the last round.
        sets: best first.
        fit: of the best.
        rivals: fits of other effects than the best set's, likeliest first.
        unknowns: how many the readings can tell apart in the best set.
        tangents: about the declared model.
        behind: small terms and the sizes of their priors.
        terms: small terms with all their unknowns.
        columns: (N, k) whitened change of the readings per unknown of the best set, the
            device's frame first.
        ended: unknowns of all sets fitted, by :func:`.refitting.names_of`.
    """

    screen: Screen
    sets: list[Scored]
    fit: Fit
    rivals: tuple[Fit, ...]
    unknowns: int
    tangents: Tangents
    behind: Background
    terms: tuple[SmallTerm, ...]
    columns: NDArray
    ended: Mapping[object, NDArray]


def select(
    campaign: Campaign, conditions: Conditions, update: Update, *,
    finite: bool = False, earlier: Selection | None = None,
) -> Selection:  # fmt: skip
    """Score all small sets, refit the best, and again about it until it stays.

    Declared clearances in closed chains are held where they rest: as declared, then as
    found.

    Args:
        campaign: rows to be fitted.
        conditions: of them as declared, with the registration if that was fitted.
        update: told what is done, how much of it and of how much.
        finite: whether the best set is fitted once more with finite motions.
        earlier: of nearly the same rows: fits go on from its own where that is better.

    Returns:
        The selection.
    """
    ended = {} if earlier is None else earlier.ended
    selected = _select_settled(campaign, conditions, update, ended)
    if not finite:
        return selected
    members = (*selected.fit.hypotheses, Hypothesis(FINITE, (), ()))
    exact = refit(
        campaign, conditions, members, selected.fit.values, behind=selected.behind
    )
    return replace(selected, fit=exact)


def _select_settled(
    campaign: Campaign, conditions: Conditions, update: Update,
    ended: Mapping[object, NDArray],
) -> Selection:  # fmt: skip
    """The selection with motions to first order beside what ``conditions`` carries."""
    # where clearances rest in closed chains is found row by row, too slowly to repeat
    clearance = (
        conditions.robot.closures and virtual_joints(conditions.robot).cones.shape[1]
    )
    if not clearance:
        return _select(campaign, conditions, update, ended)
    selected = _select(campaign, with_rest_positions(conditions), update, ended)
    rest = rest_under(conditions, selected.fit.effects)
    held = replace(conditions, rest=rest)
    return _select(campaign, held, update, selected.ended)


def _select(
    campaign: Campaign, conditions: Conditions, update: Update,
    ended: Mapping[object, NDArray],
) -> Selection:  # fmt: skip
    """Score all small sets; refit the best; score again about it until it stays."""
    tangents = Tangents(campaign, conditions)
    nuisance = [device_frame(conditions)] if campaign.registration == "unknown" else []
    signatures = _signatures(tangents, conditions, update, free=bool(nuisance))
    held = [tangents.at_start(h) for h in nuisance]
    project = Projector(held)
    finite = next((s.offset for s in signatures if s.hypothesis.effect == FINITE), 0.0)
    screens = Screens(
        small_terms(campaign, conditions, responses(conditions)),
        project,
        tangents.residual,
    )
    prior = screens.first(signatures)
    refits = Refits(campaign, conditions, nuisance, finite, ended)
    best: tuple[Hypothesis, ...] = ()
    for turn in range(_ROUNDS):
        behind = background(screens.terms, prior)
        screen = screens.screen(signatures, prior)
        update_fits = partial(update, f"fits, round {turn + 1}")
        sets, fits = refits.round(screen, behind, update_fits)
        chosen = fits[sets[0].members]
        again = screens.evidence.best(project(behind.raw(chosen.residual)))
        now = sets[0].score + prior.cost
        settled = again.evidence + score_beside_squares(sets[0]) < now + BETTER
        if turn and settled and names_of(chosen.hypotheses) == names_of(best):
            break
        best = chosen.hypotheses
        if not settled:
            prior = again
            refits.forget()
        if adds_clearance(conditions, best):
            refits.settle(best, chosen.values)
        signatures = _about(tangents, signatures, chosen, len(nuisance))
    if adds_clearance(conditions, chosen.hypotheses):
        chosen = in_full(campaign, conditions, chosen, behind)
    tangent = [*held, *(signatures[i] for i in sets[0].members)]
    nothing = np.zeros((len(tangents.residual), 0))
    return Selection(
        screen=screen,
        sets=sets,
        fit=chosen,
        rivals=_rivals(screen, sets, fits),
        unknowns=sets[0].rank + 6 * len(nuisance),
        tangents=tangents,
        behind=behind,
        terms=screens.terms,
        columns=np.hstack([nothing, *(s.columns for s in tangent)]),
        ended=refits.ended,
    )


def _signatures(
    tangents: Tangents, conditions: Conditions, update: Update, *, free: bool
) -> list[Signature]:
    """Those that show, of all hypotheses but the base's where it is free."""
    candidates = hypotheses(conditions, loaded_components(tangents.campaign))
    if free:
        candidates = [h for h in candidates if not _moves_base(h)]
    signatures = []
    for k, h in enumerate(candidates):
        signature = tangents.at_start(h)
        if _finite(signature) and _shows(signature):
            signatures.append(signature)
        update("signatures", k + 1, len(candidates))
    return signatures


def _rivals(
    screen: Screen, sets: Sequence[Scored], fits: dict[tuple[int, ...], Fit]
) -> tuple[Fit, ...]:
    """The best fits of sets of effects that do not contain the best's, nor it them."""
    own = frozenset(screen.effects[i] for i in sets[0].members)
    selected: dict[frozenset[str], Fit] = {}
    for one in sets:
        other = frozenset(screen.effects[i] for i in one.members)
        if one.members in fits and not (own <= other or other <= own):
            selected.setdefault(other, fits[one.members])
    return tuple(selected.values())


def _about(
    tangents: Tangents, signatures: list[Signature], fit: Fit, skipped: int
) -> list[Signature]:
    """Signatures with those of a fitted set retaken where the fit ended."""
    retaken: dict[Hypothesis, Signature] = {}
    at = sum(len(h.slots) for h in fit.hypotheses[:skipped])
    for h in fit.hypotheses[skipped:]:
        x = fit.values[at : at + len(h.slots)]
        at += len(h.slots)
        if LIBRARY[h.effect].linear or not h.slots:
            continue
        others: dict[str, Values] = {
            name: values
            for name, values in fit.effects.items()
            if name not in {h.effect, FINITE}  # to first order finite motions add up
        }
        moved = replace(
            h,
            slots=tuple(
                replace(s, start=float(v)) if s.shape else s
                for s, v in zip(h.slots, x, strict=True)
            ),
        )
        again = tangents.about(moved, x, others)
        if _finite(again):
            retaken[h] = _frozen_shapes(again, x)
    return [retaken.get(s.hypothesis, s) for s in signatures]


def _frozen_shapes(signature: Signature, x: NDArray) -> Signature:
    """A tangent whose shapes stay at their fitted values."""
    shape = np.array([s.shape for s in signature.hypothesis.slots])
    columns = np.where(shape, 0.0, signature.columns)
    offset = signature.offset + signature.columns @ np.where(shape, x, 0.0)
    return Signature(signature.hypothesis, offset, columns)


def _finite(signature: Signature) -> bool:
    """Whether the model had answers for a hypothesis."""
    return bool(
        np.isfinite(signature.columns).all() and np.isfinite(signature.offset).all()
    )


def _shows(signature: Signature) -> bool:
    """Whether a hypothesis changes the readings at all; enough, without unknowns."""
    squares = float(signature.offset @ signature.offset)
    return bool(signature.columns.any()) or squares > _VISIBLE


def _moves_base(h: Hypothesis) -> bool:
    """Whether a hypothesis moves the measuring frame, which is fitted anyway."""
    device = LIBRARY[h.effect].device
    return any(name in device for slot in h.slots for name in slot.names)
