"""Factor on Young's modulus of a link."""

from dataclasses import replace
from functools import partial

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.effects.places import with_frame
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import BeamLink, Frame, MatrixLink, MeshLink, Robot


def links(robot: Robot) -> tuple[str, ...]:
    """Return the frames whose link has a Young's modulus."""
    own = BeamLink | MeshLink | MatrixLink
    return tuple(f.name for f in robot.frames if isinstance(f.link, own))


def _scaled(frame: Frame, factor: float) -> Frame:
    link = frame.link
    if isinstance(link, MeshLink):
        from forcefit.stiffness.fem.part_text import scaled_part

        parts = tuple(scaled_part(text, factor) for text in link.parts)
        link = replace(link, young=link.young * factor, parts=parts)
        return replace(frame, link=link)
    if isinstance(link, BeamLink):
        return replace(frame, link=replace(link, young=link.young * factor))
    assert isinstance(link, MatrixLink)
    return replace(frame, link=MatrixLink(link.stiffness * factor))


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for name, factor in values.items():
        conditions = with_frame(conditions, name, partial(_scaled, factor=factor))
    return conditions


def _public(robot: Robot, values: Values) -> dict[str, float]:
    """Convert fitted values 1 / factor - 1 to factors on the modulus."""
    ends = len(".softer")
    return {name[:-ends]: 1 / (1 + s) for name, s in values.items()}


MODULUS_SCALE = Effect(
    name="modulus_scale",
    apply=_apply,
    unit=lambda robot, name: "1",
    frames=links,
    components=("",),
    unknowns=lambda robot: (Unknown("softer", 0.1, -0.9, 20.0),),
    public=_public,
    linear=False,
)
