"""Encoder offset: difference between actual and commanded coordinate of a drive."""

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.effects.places import drives, own_unit, with_screws
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.links import own_screw


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for name, offset in values.items():
        conditions = with_screws(
            conditions, name, offset * own_screw(conditions.robot.frame(name))
        )
    return conditions


ENCODER_OFFSET = Effect(
    name="encoder_offset",
    apply=_apply,
    unit=own_unit,
    frames=drives,
    components=("",),
    unknowns=lambda robot: (Unknown("", 1e-4),),
    by_row=True,
)
