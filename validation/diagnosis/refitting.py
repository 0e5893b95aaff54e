"""Sets of effects fitted in the full model: which of them, round after round.

The best set by its signatures is fitted with its parts, its near rivals and the best
sets of other effects, since a tangent may flatter a set that is larger than needed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.measurement.conditions import Conditions
from validation.campaign.campaign import Campaign
from validation.diagnosis.background import Background
from validation.diagnosis.hypotheses import Hypothesis
from validation.diagnosis.refit import Fit, adds_clearance, refit, resting
from validation.diagnosis.scoring import FINITE, Scored, Screen

_FEW = 3  # of the best sets are refitted
_KINDS = 4  # sets of different effects that are refitted
_SLOW = 2  # of them, best first, with finite motions, which take long
_NEAR = 6.0  # in score: sets this near the best are refitted too


class Refits:
    """Fits of sets in the full model; those of earlier rounds are kept."""

    def __init__(
        self, campaign: Campaign, conditions: Conditions,
        nuisance: Sequence[Hypothesis], finite: NDArray | float,
        ended: Mapping[object, NDArray],
    ) -> None:  # fmt: skip
        """Nothing is fitted yet.

        Args:
            campaign: rows to be fitted.
            conditions: of them.
            nuisance: hypotheses that are fitted beside every set.
            finite: (N,) whitened change by finite motions; 0 if they do not show.
            ended: where fits of nearly the same rows ended, by :func:`names_of`.
        """
        self.campaign, self.conditions = campaign, conditions
        self.nuisance, self.finite = list(nuisance), finite
        # where clearances would rest in closed chains; slow to find
        self._rest: NDArray | None = None
        self._known: dict[object, Fit] = {}
        self.ended = dict(ended)

    def fit(self, one: Scored, screen: Screen, behind: Background) -> Fit:
        """A set fitted in the full model.

        Args:
            one: the set.
            screen: in which it was scored.
            behind: small terms beside it.

        Returns:
            The fit, an earlier one if it was of the same set behind the same terms.
        """
        members = [screen.signatures[i].hypothesis for i in one.members]
        start = [*(h.start for h in self.nuisance), _start(one, members)]
        begin, every = np.concatenate(start), [*self.nuisance, *members]
        if adds_clearance(self.conditions, every):
            if self._rest is None:
                self.settle(every, begin)
            held = replace(self.conditions, rest=self._rest)
            return refit(self.campaign, held, every, begin, behind=behind)
        name = names_of(every)
        if name not in self._known:
            self._known[name] = refit(
                self.campaign, self.conditions, every, begin, self.finite, behind,
                self.ended.get(name),
            )  # fmt: skip
            self.ended[name] = self._known[name].values
        return self._known[name]

    def settle(self, members: Sequence[Hypothesis], values: NDArray) -> None:
        """Clearances rest where they do with these effects, from now on."""
        self._rest = resting(self.conditions, members, values)

    def forget(self) -> None:
        """Fits behind other small terms are of no more use."""
        self._known = {}

    def round(
        self, screen: Screen, behind: Background, update: Callable[[int, int], None]
    ) -> tuple[list[Scored], dict[tuple[int, ...], Fit]]:
        """The sets worth it fitted, until the best one needs each of its members.

        Args:
            screen: of all hypotheses.
            behind: small terms beside them.
            update: told how many sets are fitted, and of how many.

        Returns:
            All sets, the best refit first, and the fits by their members.
        """
        sets = screen.search()
        fits: dict[tuple[int, ...], Fit] = {}
        waiting = _worth_refitting(screen, sets)
        while waiting:
            update(len(fits), len(fits) + len(waiting))
            one = waiting.pop(0)
            fits[one.members] = self.fit(one, screen, behind)
            if not waiting:  # the best set needs each of its members
                refitted = _with_fits(screen, sets, fits)
                parts = _parts(screen, refitted[0])
                waiting = [part for part in parts if part.members not in fits]
                scored = {s.members for s in sets}
                sets += [part for part in waiting if part.members not in scored]
        update(len(fits), len(fits))
        return refitted, fits


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


def names_of(members: Sequence[Hypothesis]) -> tuple[object, ...]:
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
