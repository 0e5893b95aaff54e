"""Linearise the effects of a model again at their estimates, all together.

Derivatives at the start values miss three things: products of two effects, nonlinear
parameters (a time constant, an exponent), and finite motions.  The prediction with all
effects of a model is therefore compared with the sum of their linear contributions;
where they differ, all derivatives are computed again at the estimates.
"""

import numpy as np
from numpy.typing import NDArray

from validation.diagnosis.columns import Columns
from validation.diagnosis.elements import Element
from validation.diagnosis.states import Models, State

_ROUNDS = 3  # of linearisation
_MOVED = 0.3  # log posterior: change that ends the iteration
_LINEAR = 0.5  # squared whitened error of a linearisation that is accepted
_SHIFT = 3.0  # largest factor by which a nonlinear parameter changes in a round


class Relinearisation:
    """Linearisations of models at their estimates, with a cache."""

    def __init__(self, columns: Columns, models: Models) -> None:
        """Start with an empty cache.

        Args:
            columns: of all N cells.
            models: of the fitted cells.
        """
        self.columns, self.models = columns, models
        self._about: dict[object, list[Element] | None] = {}

    def relinearised(self, state: State) -> State:
        """Return a model whose linearisation holds at its estimates."""
        for _ in range(_ROUNDS):
            elements = self._again(state)
            if elements is None:
                break
            before, state = state.score, self.models.state(elements, state.mode, state)
            if abs(state.score - before) < _MOVED:
                break
        return state

    def _again(self, state: State) -> tuple[Element, ...] | None:
        """Return elements linearised at the estimates; None if that changes nothing."""
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
            again = None if settled else self.columns.again(effects, xs)
            self._about[key] = again
        made = self._about[key]
        if made is None:
            return None
        elements = list(state.elements)
        for (k, _), new in zip(own, made, strict=True):
            elements[k] = new
        return tuple(elements)

    def _misses(self, effects: list[Element], xs: list[NDArray]) -> float:
        """Return the squared whitened error of the linearisation."""
        linear = np.zeros(len(self.models.readings.cells))
        for e, x in zip(effects, xs, strict=True):
            linear += e.columns @ ((x - e.begin)[e.slots] / e.scale)
            if e.offset is not None:
                linear += e.offset
        miss = (self.columns.combined(effects, xs) - linear)[self.models.readings.cells]
        return float(miss @ miss)


def _has_shapes(e: Element) -> bool:
    """Return whether the nonlinear parameters are among the unknowns."""
    return all(j in e.slots for j, slot in enumerate(e.hypothesis.slots) if slot.shape)


def _within(e: Element, x: NDArray) -> NDArray:
    """Return values with nonlinear parameters limited to one round's change."""
    for j, slot in enumerate(e.hypothesis.slots):
        if slot.shape:
            x[j] = np.clip(x[j], e.begin[j] / _SHIFT, e.begin[j] * _SHIFT)
            x[j] = np.clip(x[j], slot.unknown.lower, slot.unknown.upper)
    return x
