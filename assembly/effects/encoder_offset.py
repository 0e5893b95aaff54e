"""The actual coordinate of a drive is the command plus a constant."""

from assembly.effects.effect import Effect, Unknown, Values
from assembly.effects.places import drives, own_unit, with_screws
from assembly.measurement.conditions import Conditions
from assembly.model.links import own_screw


def _apply(here: Conditions, values: Values) -> Conditions:
    for name, offset in values.items():
        here = with_screws(here, name, offset * own_screw(here.robot.frame(name)))
    return here


ENCODER_OFFSET = Effect(
    name="encoder_offset",
    summary="drives stand off their command by a constant",
    apply=_apply,
    unit=own_unit,
    frames=drives,
    components=("",),
    unknowns=lambda robot: (Unknown("", 1e-4),),
    by_row=True,
)
