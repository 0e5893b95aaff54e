"""Clearance of loaded joints that have no clearance in the robot file."""

from dataclasses import replace
from functools import partial

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.effects.places import with_frame
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Clearance, Frame, Robot

_KINDS = ("radial", "axial", "tilt")
_NONE_BELOW = 1e-9  # [m, rad] clearance below which a joint has no clearance


def moving_joints(robot: Robot) -> tuple[str, ...]:
    """Return the joints that move and have no clearance in the robot file."""
    return tuple(
        f.name for f in robot.frames if f.joint != "fixed" and _is_tight(f.clearance)
    )


def _is_tight(clearance: Clearance | None) -> bool:
    if clearance is None:
        return True
    return clearance.ball is None and not any(getattr(clearance, k) for k in _KINDS)


def _with_clearance(frame: Frame, bound: dict[str, float]) -> Frame:
    clearance = frame.clearance or Clearance()
    more = {
        kind: (getattr(clearance, kind) or 0.0) + size for kind, size in bound.items()
    }
    return replace(frame, clearance=replace(clearance, **more))


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for key, size in values.items():
        name, _, kind = key.rpartition(".")
        if size > 0:
            conditions = with_frame(
                conditions, name, partial(_with_clearance, bound={kind: size})
            )
    return conditions


def _public(robot: Robot, values: Values) -> dict[str, float]:
    """Return the nonzero fitted clearances."""
    return {key: size for key, size in values.items() if size > _NONE_BELOW}


def _unit(robot: Robot, name: str) -> str:
    return "rad" if name.endswith(".tilt") else "m"


JOINT_CLEARANCE = Effect(
    name="joint_clearance",
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
