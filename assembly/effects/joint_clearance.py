"""Play at joints declared tight, taken up by the load."""

from dataclasses import replace
from functools import partial

from assembly.effects.effect import Effect, Unknown, Values
from assembly.effects.places import with_frame
from assembly.measurement.conditions import Conditions
from assembly.model.robot import Clearance, Frame, Robot

_KINDS = ("radial", "axial", "tilt")
_TIGHT = 1e-9  # [m, rad] play below it is none


def moving_joints(robot: Robot) -> tuple[str, ...]:
    """Joints that move and are declared tight."""
    return tuple(
        f.name for f in robot.frames if f.joint != "fixed" and _tight(f.clearance)
    )


def _tight(play: Clearance | None) -> bool:
    return play is None or not any(getattr(play, kind) for kind in _KINDS)


def _with_play(frame: Frame, bound: dict[str, float]) -> Frame:
    play = frame.clearance or Clearance()
    more = {kind: (getattr(play, kind) or 0.0) + size for kind, size in bound.items()}
    return replace(frame, clearance=replace(play, **more))


def _apply(here: Conditions, values: Values) -> Conditions:
    for key, size in values.items():
        name, _, kind = key.rpartition(".")
        if size > 0:
            here = with_frame(here, name, partial(_with_play, bound={kind: size}))
    return here


def _public(robot: Robot, values: Values) -> dict[str, float]:
    """The play; a joint found tight has none."""
    return {key: size for key, size in values.items() if size > _TIGHT}


def _unit(robot: Robot, name: str) -> str:
    return "rad" if name.endswith(".tilt") else "m"


JOINT_CLEARANCE = Effect(
    name="joint_clearance",
    summary="joints declared tight have play",
    apply=_apply,
    unit=_unit,
    frames=moving_joints,
    components=_KINDS,
    unknowns=lambda robot: (
        Unknown("radial", 2e-5, 0.0, 1e-2),
        Unknown("axial", 2e-5, 0.0, 1e-2),
        Unknown("tilt", 2e-4, 0.0, 0.2),
    ),
    public=_public,
    linear=False,
    clearance=True,
)  # fmt: skip
