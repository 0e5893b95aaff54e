"""Linearise the effects of a model at their estimates.

A linearisation at the start values neglects interactions of effects, nonlinear
parameters such as time constants, and finite motions. The nonlinear prediction is
therefore compared with the sum of the linear contributions of all effects. If the two
differ, all effects are linearised again at the estimates.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.validation.diagnosis.elements import Element, effect_element
from forcefit.validation.diagnosis.hypotheses import in_one_session, sessions_of
from forcefit.validation.diagnosis.signatures import Signature, Tangents
from forcefit.validation.diagnosis.states import Models, State

_ROUNDS = 3  # maximum number of linearisations
MOVED = 0.3  # smallest change of the log posterior that requires another linearisation
_LINEAR = 0.5  # largest accepted sum of squared whitened linearisation errors
# Largest factor by which a nonlinear parameter changes in one linearisation.
_SHIFT = 3.0


class Relinearisation:
    """Linearises models at their estimates and caches the results."""

    def __init__(self, tangents: Tangents, models: Models) -> None:
        """Create an empty cache.

        Args:
            tangents: derivatives of all readings.
            models: models to be fitted to the readings.
        """
        self.tangents, self.models = tangents, models
        self._about: dict[object, list[Element] | None] = {}

    def relinearised(self, state: State) -> State:
        """Repeat linearisation and fit of a model until its estimates converge."""
        for _ in range(_ROUNDS):
            elements = self._again(state)
            if elements is None:
                break
            before, state = state.score, self.models.state(elements, state.mode, state)
            if abs(state.score - before) < MOVED:
                break
        return state

    def _again(self, state: State) -> tuple[Element, ...] | None:
        """Return the effects linearised at the estimates, or None if unchanged."""
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
        """Return the sum of the squared whitened linearisation errors."""
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
        """Return effects that are linearised together at given values.

        The sum of the linearised effects is exact at these values. If the machine has
        no solution at these values, the effects are returned unchanged.
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
        # The offset of the first effect is the sum of all offsets.
        made[0] = replace(made[0], offset=middle)
        return [
            replace(effect_element(s, robot, e.log_prior, x), first=e.origin)
            for s, e, x in zip(made, elements, xs, strict=True)
        ]

    def _one(
        self, elements: Sequence[Element], xs: Sequence[NDArray], k: int
    ) -> Signature:
        """Return the k-th effect, linearised in the presence of all other effects."""
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
        """Return the whitened contribution (N,) of all effects together."""
        total = np.zeros_like(self.tangents.declared)
        for session in _sessions(elements):
            effects = self._public(elements, xs, session)
            moved = self.tangents.model(effects, finite=True) - self.tangents.declared
            total += moved * self.tangents.rows_of(session)[:, 0]
        return total

    def _public(
        self, elements: Sequence[Element], xs: Sequence[NDArray], session: str | None
    ) -> dict[str, dict[str, float]]:
        """Return the parameters of one session by public name."""
        robot, values = self.tangents.derivatives.conditions.robot, {}
        for e, x in zip(elements, xs, strict=True):
            there, own = in_one_session(e.hypothesis, session)
            values[e.name] = there.public(robot, x[own])
        return values


def _sessions(elements: Sequence[Element]) -> tuple[str | None, ...]:
    """Return the sessions with separate parameters, or (None,) if there are none."""
    every = [name for e in elements for name in sessions_of(e.hypothesis)]
    return tuple(dict.fromkeys(name for name in every if name is not None)) or (None,)


def _has_shapes(e: Element) -> bool:
    """Return whether all nonlinear parameters of an effect are among the unknowns."""
    return all(j in e.slots for j, slot in enumerate(e.hypothesis.slots) if slot.shape)


def _within(e: Element, x: NDArray) -> NDArray:
    """Limit the change of nonlinear parameters."""
    for j, slot in enumerate(e.hypothesis.slots):
        if slot.shape:
            x[j] = np.clip(x[j], e.begin[j] / _SHIFT, e.begin[j] * _SHIFT)
            x[j] = np.clip(x[j], slot.unknown.lower, slot.unknown.upper)
    return x
