"""Compute the readings of a machine and their derivatives with respect to effects.

The derivatives depend on the design of a campaign but not on its readings. The same
derivatives are therefore used in all folds of a diagnosis.
"""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY, apply_effects
from forcefit.assembly.effects.effect import Values
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.predict import predict, with_second_order
from forcefit.assembly.measurement.settled_clearance import with_clearances_taken_up
from forcefit.validation.diagnosis.hypotheses import Slot
from forcefit.validation.diagnosis.responses import Responses, responses
from forcefit.validation.diagnosis.sensitivities import Sensitivities

# Step of numerical derivatives, relative to a plausible value of the unknown.
STEP = 1e-3


class Derivatives:
    """Predicted readings for R rows of the declared model, and their derivatives.

    Attributes:
        conditions: measuring conditions, including a fitted pose of the measuring
            device.
    """

    def __init__(self, conditions: Conditions) -> None:
        """Store the conditions. Derivatives are computed when they are first used."""
        self.conditions = conditions
        self._begun: dict[object, NDArray] = {}

    @cached_property
    def declared(self) -> NDArray:
        """Readings (R, 6) [rad, m] without effects."""
        return predict(self.conditions).deviation

    @cached_property
    def response(self) -> Responses:
        """Responses of the readings to small displacements at frames."""
        return responses(self.conditions)

    @cached_property
    def sensitivities(self) -> Sensitivities:
        """Responses of the readings to functions at all possible locations."""
        return Sensitivities(self.conditions, self.response)

    def model(self, effects: Mapping[str, Values], *, finite: bool = False) -> NDArray:
        """Return the readings (R, 6) [rad, m] of a machine with given effects.

        Args:
            effects: parameters of each effect, as nested mappings from effect and
                parameter names.
            finite: whether to compute finite motions with these effects.

        Returns:
            The readings, NaN in rows without a solution.
        """
        changed = apply_effects(self.conditions, effects)
        if any(LIBRARY[name].clearance for name in effects):
            if changed.rest is None and not changed.exact:
                changed, _ = with_clearances_taken_up(changed)
        elif finite and np.ndim(changed.second_order) == 2:
            changed = with_second_order(changed)
        return predict(changed).deviation

    def begun(self, effect: str, slot: Slot, shapes: Mapping[str, float]) -> NDArray:
        """Return the readings (R, 6) [rad, m] after a small change of one unknown.

        Args:
            effect: name of the effect.
            slot: the unknown to change.
            shapes: values of the shape parameters of the effect.
        """
        key = (effect, slot.names, tuple(sorted(set(shapes.values()))))
        if key not in self._begun:
            start = slot.unknown.start + STEP * slot.unknown.scale
            values = {**shapes, **dict.fromkeys(slot.names, start)}
            public = LIBRARY[effect].public(self.conditions.robot, values)
            self._begun[key] = self.model({effect: public})
        return self._begun[key]
