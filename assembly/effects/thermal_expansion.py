"""A body lengthens along its beam's axis by coefficient x length x temperature."""

from assembly.effects.effect import Effect, Unknown, Values
from assembly.effects.places import beams, lengthening, with_screws
from assembly.measurement.conditions import Conditions
from assembly.model.robot import beam_axis


def _apply(here: Conditions, values: Values) -> Conditions:
    for name, coefficient in values.items():
        frame = here.robot.frame(name)
        longer = coefficient * beam_axis(frame)[0] * here.temperature
        here = with_screws(here, name, longer[:, None] * lengthening(frame))
    return here


THERMAL_EXPANSION = Effect(
    name="thermal_expansion",
    summary="bodies lengthen with temperature",
    apply=_apply,
    unit=lambda robot, name: "1/K",
    frames=beams,
    components=("",),
    unknowns=lambda robot: (Unknown("", 1e-5, -5e-4, 5e-4),),
    needs=("temperature",),
    by_row=True,
)
