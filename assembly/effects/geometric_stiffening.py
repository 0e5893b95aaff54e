"""Stiffness change due to preload and finite rotations."""

from dataclasses import replace

from forcefit.assembly.effects.effect import Effect

GEOMETRIC_STIFFENING = Effect(
    name="geometric_stiffening",
    apply=lambda conditions, values: replace(conditions, exact=True),
    unit=lambda robot, name: "1",
    frames=None,
    components=(),
    unknowns=lambda robot: (),
    finite=True,
)
