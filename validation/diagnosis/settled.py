"""Effects of a model taken again about what was found, all of them together.

A tangent taken where effects begin misses what they do to one another, what bends in
their shapes (a time constant, an exponent), and finite motions.  So the model is asked
what the effects of a state do together; where that differs from the sum of tangents,
these are taken again there.
"""

import numpy as np
from numpy.typing import NDArray

from validation.diagnosis.columns import Columns
from validation.diagnosis.elements import Element
from validation.diagnosis.states import Fitting, State

_ROUNDS = 3
_MOVED = 0.3  # log posterior: a model has settled
_LINEAR = 0.5  # squared whitened difference of what is linear enough
_SHIFT = 3.0  # times that a shape may change in a round


class Settling:
    """Models about their own values, each found once."""

    def __init__(self, columns: Columns, fit: Fitting) -> None:
        """Begin with none.

        Args:
            columns: of all N cells.
            fit: readings of those fitted.
        """
        self.columns, self.fit = columns, fit
        self._about: dict[object, list[Element] | None] = {}

    def settled(self, state: State) -> State:
        """A model about its own values, where that differs from what was assumed."""
        for _ in range(_ROUNDS):
            elements = self._again(state)
            if elements is None:
                break
            before, state = state.score, self.fit.state(elements, state.mode, state)
            if abs(state.score - before) < _MOVED:
                break
        return state

    def _again(self, state: State) -> tuple[Element, ...] | None:
        """Elements about a model's values; None where they add up to them already."""
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
        """Squared whitened difference of what effects do and the sum of tangents."""
        linear = np.zeros(len(self.fit.cells))
        for e, x in zip(effects, xs, strict=True):
            linear += e.columns @ ((x - e.begin)[e.slots] / e.scale)
            if e.offset is not None:
                linear += e.offset
        miss = (self.columns.together(effects, xs) - linear)[self.fit.cells]
        return float(miss @ miss)


def _has_shapes(e: Element) -> bool:
    """Whether an effect's shapes are among its unknowns."""
    return all(j in e.slots for j, slot in enumerate(e.hypothesis.slots) if slot.shape)


def _within(e: Element, x: NDArray) -> NDArray:
    """Values of an effect, its shapes no farther than a round may take them."""
    for j, slot in enumerate(e.hypothesis.slots):
        if slot.shape:
            x[j] = np.clip(x[j], e.begin[j] / _SHIFT, e.begin[j] * _SHIFT)
            x[j] = np.clip(x[j], slot.unknown.lower, slot.unknown.upper)
    return x
