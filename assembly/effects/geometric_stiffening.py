"""Preload and finite rotation change the stiffness: the exact model, not the linear."""

from dataclasses import replace

from assembly.effects.effect import Effect

GEOMETRIC_STIFFENING = Effect(
    name="geometric_stiffening",
    summary="motions are finite: the exact model instead of the linear one",
    apply=lambda here, values: replace(here, exact=True),
    unit=lambda robot, name: "1",
    frames=None,
    components=(),
    unknowns=lambda robot: (),
    finite=True,
)
