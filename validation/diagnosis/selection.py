"""Which set of effects a campaign shows: scored to first order, refitted in full.

All small sets are scored from their signatures; the best and their near rivals are
fitted in the full model, signatures retaken there, and scored again until the best set
stays.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY, apply_effects
from assembly.effects.effect import Values
from assembly.linear.closure import virtual_joints
from assembly.measurement.conditions import Conditions
from assembly.measurement.predict import with_rest_positions
from validation.campaign.campaign import Campaign
from validation.diagnosis.evidence import Background, Evidence, Prior, background
from validation.diagnosis.hypotheses import Hypothesis, hypotheses
from validation.diagnosis.refit import Fit, adds_clearance, in_full, refit, resting
from validation.diagnosis.registration import device_frame
from validation.diagnosis.responses import responses
from validation.diagnosis.scoring import FINITE, Scored, Screen
from validation.diagnosis.signatures import Signature, Tangents, loaded_components
from validation.diagnosis.small_terms import SmallTerm, small_terms

Update = Callable[[str, int, int], None]

_ROUNDS = 4  # of refitting and scoring again
_VISIBLE = 4.0  # squared whitened change of the readings
_FEW = 3  # of the best sets are refitted
_KINDS = 4  # sets of different effects that are refitted
_SLOW = 2  # of them, best first, with finite motions, which take long
_BETTER = 1.0  # in score: sizes of small terms that are looked at again
_PRIORS = 4  # such sizes tried, at most
_NEAR = 6.0  # in score: sets this near the best are refitted too


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


def select(
    campaign: Campaign, conditions: Conditions, update: Update, *, finite: bool = False
) -> Selection:
    """Score all small sets, refit the best, and again about it until it stays.

    Declared clearances in closed chains are held where they rest: as declared, then as
    found.

    Args:
        campaign: rows to be fitted.
        conditions: of them as declared, with the registration if that was fitted.
        update: told what is done, how much of it and of how much.
        finite: whether the best set is fitted once more with finite motions.

    Returns:
        The selection.
    """
    selected = _select_settled(campaign, conditions, update)
    if not finite:
        return selected
    members = (*selected.fit.hypotheses, Hypothesis(FINITE, (), ()))
    exact = refit(
        campaign, conditions, members, selected.fit.values, behind=selected.behind
    )
    return replace(selected, fit=exact)


def _select_settled(
    campaign: Campaign, conditions: Conditions, update: Update
) -> Selection:
    """The selection with motions to first order beside what ``conditions`` carries."""
    # where clearances rest in closed chains is found row by row, too slowly to repeat
    clearance = (
        conditions.robot.closures and virtual_joints(conditions.robot).cones.shape[1]
    )
    if not clearance:
        return _select(campaign, conditions, update)
    selected = _select(campaign, with_rest_positions(conditions), update)
    loose = with_rest_positions(apply_effects(conditions, selected.fit.effects))
    assert loose.rest is not None
    # effects may add frames, as the foundation's
    own = [loose.robot.index(frame.name) for frame in conditions.robot.frames]
    rest = loose.rest[:, own]
    return _select(campaign, replace(conditions, rest=rest), update)


def _select(campaign: Campaign, conditions: Conditions, update: Update) -> Selection:
    """Score all small sets; refit the best; score again about it until it stays."""
    tangents = Tangents(campaign, conditions)
    nuisance = [device_frame(conditions)] if campaign.registration == "unknown" else []
    candidates = hypotheses(conditions, loaded_components(campaign))
    if nuisance:
        candidates = [h for h in candidates if not _moves_base(h)]
    signatures = []
    for k, h in enumerate(candidates):
        signature = tangents.at_start(h)
        if _finite(signature) and _shows(signature):
            signatures.append(signature)
        update("signatures", k + 1, len(candidates))
    project = _Projector([tangents.at_start(h) for h in nuisance])
    finite = next((s.offset for s in signatures if s.hypothesis.effect == FINITE), 0.0)
    screens = _Screens(
        small_terms(campaign, conditions, responses(conditions)),
        project,
        tangents.residual,
    )
    prior = screens.first(signatures)
    best: tuple[Hypothesis, ...] = ()
    rest: NDArray | None = (
        None  # where clearances would rest in closed chains; slow to find
    )
    known: dict[object, Fit] = {}
    for turn in range(_ROUNDS):
        behind = background(screens.terms, prior)
        screen = screens.screen(signatures, prior)
        sets = screen.search()
        # near rivals and their parts too: a tangent may flatter a set that is larger
        fits: dict[tuple[int, ...], Fit] = {}
        waiting = _worth_refitting(screen, sets)
        while waiting:
            update(f"fits, round {turn + 1}", len(fits), len(fits) + len(waiting))
            one = waiting.pop(0)
            members = [screen.signatures[i].hypothesis for i in one.members]
            start = np.concatenate([*(h.start for h in nuisance), _start(one, members)])
            every = [*nuisance, *members]
            if adds_clearance(conditions, every):
                rest = resting(conditions, every, start) if rest is None else rest
                held = replace(conditions, rest=rest)
                fits[one.members] = refit(campaign, held, every, start, behind=behind)
            elif _names(every) in known:
                fits[one.members] = known[_names(every)]
            else:
                fits[one.members] = refit(
                    campaign, conditions, every, start, finite, behind
                )
                known[_names(every)] = fits[one.members]
            if not waiting:  # the best set needs each of its members
                refitted = _with_fits(screen, sets, fits)
                waiting = [
                    p for p in _parts(screen, refitted[0]) if p.members not in fits
                ]
                there = {s.members for s in sets}
                sets += [p for p in waiting if p.members not in there]
        update(f"fits, round {turn + 1}", len(fits), len(fits))
        sets = refitted
        chosen = fits[sets[0].members]
        again = screens.evidence.best(project(behind.raw(chosen.residual)))
        now = sets[0].score + prior.cost
        settled = again.evidence + _rule(sets[0]) < now + _BETTER
        if turn and settled and _names(chosen.hypotheses) == _names(best):
            break
        best = chosen.hypotheses
        if not settled:
            prior = again
            known = {}
        if adds_clearance(conditions, best):
            rest = resting(conditions, best, chosen.values)
        signatures = _about(tangents, signatures, chosen, len(nuisance))
    if adds_clearance(conditions, chosen.hypotheses):
        chosen = in_full(campaign, conditions, chosen, behind)
    unknowns = sets[0].rank + 6 * len(nuisance)
    rivals = _rivals(screen, sets, fits)
    tangent = [tangents.at_start(h) for h in nuisance]
    tangent += [signatures[i] for i in sets[0].members]
    columns = np.hstack([np.zeros((len(tangents.residual), 0)),
                         *(s.columns for s in tangent)])  # fmt: skip
    return Selection(
        screen=screen,
        sets=sets,
        fit=chosen,
        rivals=rivals,
        unknowns=unknowns,
        tangents=tangents,
        behind=behind,
        terms=screens.terms,
        columns=columns,
    )


class _Screens:
    """Screens of the same hypotheses behind which small terms stand or do not."""

    def __init__(
        self, terms: Sequence[SmallTerm], project: "_Projector", residual: NDArray
    ) -> None:
        self.terms = tuple(terms)
        self._project, self._residual = project, project(residual)
        self._projected = [replace(t, columns=project(t.columns)) for t in terms]
        self.evidence = Evidence(self._projected, len(residual))

    def screen(self, signatures: Sequence[Signature], prior: Prior) -> Screen:
        """The screen of signatures with small terms of a prior behind them."""
        behind = background(self._projected, prior)

        def seen(columns: NDArray) -> NDArray:
            return behind.whitened(self._project(columns))

        return Screen(
            behind.whitened(self._residual),
            [
                Signature(s.hypothesis, seen(s.offset), seen(s.columns))
                for s in signatures
            ],
        )

    def first(self, signatures: Sequence[Signature]) -> Prior:
        """The prior with which the best set scores best, all to first order.

        Small terms may be all there is, or come beside the best set: both are tried,
        each with the sizes asked for anew once its best set is known.

        Args:
            signatures: of all hypotheses.

        Returns:
            The prior, of nothing where nothing small is asked for.
        """
        nothing = self.evidence.none()
        waiting = [self.evidence.best(self._residual)]
        if not self.evidence.always:
            waiting.append(nothing)
        tried: list[tuple[float, Prior]] = []
        while waiting:
            prior = waiting.pop(0)
            screen = self.screen(signatures, prior)
            best = screen.search()[0]
            tried.append((best.score + prior.cost, prior))
            shown = background(self._projected, prior).raw(screen.shown(best))
            again = self.evidence.best(self._residual - shown)
            better = again.evidence + _rule(best) > max(s for s, _ in tried) + _BETTER
            if better and len(tried) < _PRIORS:
                waiting.append(again)
        return max(tried, key=lambda one: one[0])[1]


def _rule(one: Scored) -> float:
    """What a set's score takes off for being one, beside its squared residual."""
    return one.score + one.rss / 2


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


def _worth_refitting(screen: Screen, sets: Sequence[Scored]) -> list[Scored]:
    """The best sets, all their parts, and the best sets of other effects."""
    parts = {s.members for s in sets[:_FEW] if s.score > sets[0].score - _NEAR}
    parts |= {s.members for s in _parts(screen, sets[0])}
    kinds: dict[frozenset[str], Scored] = {}
    for s in sets:
        kinds.setdefault(frozenset(screen.effects[i] for i in s.members), s)
    others = list(kinds.values())[:_KINDS]
    parts |= {s.members for s in others if s.score > sets[0].score - _NEAR}
    selected = [s for s in sets if s.members in parts]
    slow = [s for s in selected if len(s.members) > 1 and _has_finite(screen, s)]
    return [s for s in selected if s not in slow[_SLOW:]]


def _parts(screen: Screen, one: Scored) -> list[Scored]:
    """A set without one of its members, for each."""
    return [screen.fit([i for i in one.members if i != left]) for left in one.members]


def _has_finite(screen: Screen, one: Scored) -> bool:
    """Whether a set has finite motions."""
    return any(screen.effects[i] == FINITE for i in one.members)


def _names(members: Sequence[Hypothesis]) -> tuple[object, ...]:
    """What a set fits, wherever it begins."""
    return tuple((h.effect, tuple(slot.names for slot in h.slots)) for h in members)


def _start(one: Scored, members: Sequence[Hypothesis]) -> NDArray:
    """Where to begin a refit: the screening's values, shapes where they were held."""
    held = np.concatenate([np.zeros(0), *(h.start for h in members)])
    shape = [slot.shape for h in members for slot in h.slots]
    return np.where(np.array(shape, dtype=bool), held, one.values)


def _with_fits(
    screen: Screen, sets: list[Scored], fits: dict[tuple[int, ...], Fit]
) -> list[Scored]:
    """Sets with the scores of their refits; the best refit comes first."""
    scored = []
    for one in sets:
        fit = fits.get(one.members)
        scored.append(one if fit is None else screen.rescored(one, fit.rss, one.values))
    scored.sort(key=screen.order)
    best = next(s for s in scored if s.members in fits)
    return [best, *(s for s in scored if s is not best)]


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


class _Projector:
    """Takes nuisances out of columns."""

    def __init__(self, nuisances: list[Signature]) -> None:
        self._q = None
        if nuisances:
            A = np.hstack([s.columns for s in nuisances])
            norm = np.linalg.norm(A, axis=0)
            u, size, _ = np.linalg.svd(A / np.where(norm > 0, norm, 1.0), False)
            self._q = u[:, size > 1e-10 * size[0]]

    def __call__(self, columns: NDArray) -> NDArray:
        if self._q is None:
            return columns
        return columns - self._q @ (self._q.T @ columns)
