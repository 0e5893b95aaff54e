"""Linearise the effects of a model repeatedly at their estimates.

Derivatives at the start values neglect products of two effects, nonlinear parameters (a
time constant, an exponent) and finite motions.  The prediction with all effects of a
model is therefore compared with the sum of their linear contributions, and if they
differ, all derivatives are recomputed at the estimates.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.diagnosis.elements import Element, effect_element
from forcefit.validation.diagnosis.hypotheses import in_one_session, sessions_of
from forcefit.validation.diagnosis.signatures import Signature, Tangents
from forcefit.validation.diagnosis.states import Models, State

_ROUNDS = 3  # largest number of linearisations; they may oscillate
MOVED = 0.3  # smaller changes of the log posterior affect no decision
_LINEAR = 0.5  # largest squared whitened linearisation error
# Largest factor on a nonlinear parameter per linearisation.
_SHIFT = 3.0


class Relinearisation:
    """Linearises models at their estimates, caching the results."""

    def __init__(self, tangents: Tangents, models: Models) -> None:
        """Start with an empty cache; ``tangents`` are the derivatives of all cells."""
        self.tangents, self.models = tangents, models
        self._about: dict[object, list[Element] | None] = {}

    def relinearised(self, state: State) -> State:
        """Relinearise a model until the linearisation is valid at its estimates."""
        for _ in range(_ROUNDS):
            elements = self._again(state)
            if elements is None:
                break
            before, state = state.score, self.models.state(elements, state.mode, state)
            if abs(state.score - before) < MOVED:
                break
        return state

    def _again(self, state: State) -> tuple[Element, ...] | None:
        """Return the elements linearised at the estimates; None if nothing changes."""
        own = [
            (k, e)
            for k, e in enumerate(state.elements)
            if e.name and e.columns.shape[1]
        ]
        if not own:
            return None
        means = [state.sizes.mean[state.own(k)] for k, _ in own]
        xs = [_within(e, e.values(d)) for (_, e), d in zip(own, means, strict=True)]
        effects = [e for _, e in own]
        key = (
            tuple(e.origin for e in effects),
            tuple(float(f"{v:.3g}") for x in xs for v in x),
        )
        if key not in self._about:
            settled = all(_has_shapes(e) for e in effects)
            settled = settled and not self._misses(effects, xs) > _LINEAR
            again = None if settled else self.again(effects, xs)
            self._about[key] = again
        made = self._about[key]
        if made is None:
            return None
        elements = list(state.elements)
        for (k, _), new in zip(own, made, strict=True):
            elements[k] = new
        return tuple(elements)

    def _misses(self, effects: list[Element], xs: list[NDArray]) -> float:
        """Return the sum of squared whitened errors of the linearisation."""
        linear = np.zeros(len(self.models.readings.cells))
        for e, x in zip(effects, xs, strict=True):
            linear += e.columns @ ((x - e.begin)[e.slots] / e.scale)
            if e.offset is not None:
                linear += e.offset
        miss = (self.combined(effects, xs) - linear)[self.models.readings.cells]
        return float(miss @ miss)

    def again(
        self, elements: Sequence[Element], xs: Sequence[NDArray]
    ) -> list[Element]:
        """Return jointly acting effects, linearised at given values of their slots.

        The sum of the returned elements is exact at these values.  If the model has no
        solution there, the given elements are returned unchanged.
        """
        robot = self.tangents.campaign.robot
        middle = self.combined(elements, xs)
        made = []
        for k, x in enumerate(xs):
            signature = self._one(elements, xs, k)
            if not signature.finite or not np.isfinite(middle).all():
                return list(elements)
            middle = middle - signature.columns @ x
            made.append(replace(signature, offset=np.zeros_like(middle)))
        # The first element stores the offset of all elements together.
        made[0] = replace(made[0], offset=middle)
        return [
            replace(effect_element(s, robot, e.log_prior, x), first=e.origin)
            for s, e, x in zip(made, elements, xs, strict=True)
        ]

    def _one(
        self, elements: Sequence[Element], xs: Sequence[NDArray], k: int
    ) -> Signature:
        """Return the k-th effect, linearised at given values while all others act."""
        h, offset = elements[k].hypothesis, np.zeros_like(self.tangents.declared)
        columns = np.zeros((len(offset), len(h.slots)))
        for session in _sessions(elements):
            others = self._public(elements, xs, session)
            del others[elements[k].name]
            there, own = in_one_session(h, session)
            one = self.tangents.about(there, xs[k][own], others)
            rows = self.tangents.rows_of(session)
            columns[:, own] += one.columns * rows
            offset += one.offset * rows[:, 0]
        return Signature(h, offset, columns)

    def combined(self, elements: Sequence[Element], xs: Sequence[NDArray]) -> NDArray:
        """Return the whitened contribution (N,) of effects that act together."""
        total = np.zeros_like(self.tangents.declared)
        for session in _sessions(elements):
            effects = self._public(elements, xs, session)
            moved = self.tangents.model(effects, finite=True) - self.tangents.declared
            total += moved * self.tangents.rows_of(session)[:, 0]
        return total

    def _public(
        self, elements: Sequence[Element], xs: Sequence[NDArray], session: str | None
    ) -> dict[str, dict[str, float]]:
        """Return the parameters by public name for one session."""
        robot, values = self.tangents.derivatives.conditions.robot, {}
        for e, x in zip(elements, xs, strict=True):
            there, own = in_one_session(e.hypothesis, session)
            values[e.name] = there.public(robot, x[own])
        return values


def _sessions(elements: Sequence[Element]) -> tuple[str | None, ...]:
    """Return the sessions in which the effects differ, or (None,)."""
    every = [name for e in elements for name in sessions_of(e.hypothesis)]
    return tuple(dict.fromkeys(name for name in every if name is not None)) or (None,)


def _has_shapes(e: Element) -> bool:
    """Return whether any unknown of an element is a nonlinear parameter."""
    return all(j in e.slots for j, slot in enumerate(e.hypothesis.slots) if slot.shape)


def _within(e: Element, x: NDArray) -> NDArray:
    """Limit the change of nonlinear parameters to the allowed factor."""
    for j, slot in enumerate(e.hypothesis.slots):
        if slot.shape:
            x[j] = np.clip(x[j], e.begin[j] / _SHIFT, e.begin[j] * _SHIFT)
            x[j] = np.clip(x[j], slot.unknown.lower, slot.unknown.upper)
    return x
