"""Weight of links and bodies."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.measurement.conditions import Conditions

_AXES = ("g.x", "g.y", "g.z")


def _apply(conditions: Conditions, values: Values) -> Conditions:
    g = np.array([values.get(axis, 0.0) for axis in _AXES])
    return replace(conditions, gravity=conditions.gravity + g)


SELF_WEIGHT = Effect(
    name="self_weight",
    apply=_apply,
    unit=lambda robot, name: "m/s^2",
    frames=None,
    components=_AXES,
    unknowns=lambda robot: tuple(Unknown(a, 9.81, -20.0, 20.0) for a in _AXES),
    by_row=True,
    splits=True,
)
