"""Thermal expansion of a body: elongation = coefficient x length x temperature.

The body expands along its beam, or along the line between its joints.
"""

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.effects.places import (
    bodies,
    body_axis,
    growing,
    lengthening,
    with_screws,
)
from forcefit.assembly.measurement.conditions import Conditions


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for name, coefficient in values.items():
        frame = conditions.robot.frame(name)
        longer = coefficient * body_axis(frame)[0] * conditions.temperature
        conditions = with_screws(conditions, name, longer[:, None] * lengthening(frame))
    return conditions


THERMAL_EXPANSION = Effect(
    name="thermal_expansion",
    apply=_apply,
    unit=lambda robot, name: "1/K",
    frames=bodies,
    tried=growing,
    components=("",),
    unknowns=lambda robot: (Unknown("", 1e-5, -5e-4, 5e-4),),
    needs=("temperature",),
    by_row=True,
)
