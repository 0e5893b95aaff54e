"""Stiffness change by preload and finite rotations: the exact model is used."""

from dataclasses import replace

from assembly.effects.effect import Effect

GEOMETRIC_STIFFENING = Effect(
    name="geometric_stiffening",
    apply=lambda conditions, values: replace(conditions, exact=True),
    unit=lambda robot, name: "1",
    frames=None,
    components=(),
    unknowns=lambda robot: (),
    finite=True,
)
