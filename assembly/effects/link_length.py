"""A body is longer than declared, along its beam's axis."""

from assembly.effects.effect import Effect, Unknown, Values
from assembly.effects.places import beams, lengthening, with_screws
from assembly.measurement.conditions import Conditions


def _apply(here: Conditions, values: Values) -> Conditions:
    for name, longer in values.items():
        here = with_screws(here, name, longer * lengthening(here.robot.frame(name)))
    return here


LINK_LENGTH = Effect(
    name="link_length",
    summary="bodies are longer than declared",
    apply=_apply,
    unit=lambda robot, name: "m",
    frames=beams,
    components=("",),
    unknowns=lambda robot: (Unknown("", 1e-4),),
    by_row=True,
)
