"""Length error of a body along its beam or the line between its joints."""

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.effects.places import bodies, growing, lengthening, with_screws
from forcefit.assembly.measurement.conditions import Conditions


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for name, longer in values.items():
        conditions = with_screws(
            conditions, name, longer * lengthening(conditions.robot.frame(name))
        )
    return conditions


LINK_LENGTH = Effect(
    name="link_length",
    apply=_apply,
    unit=lambda robot, name: "m",
    frames=bodies,
    tried=growing,
    components=("",),
    unknowns=lambda robot: (Unknown("", 1e-4),),
    by_row=True,
)
