"""Compliance of actuated joints, in series with their stiffness in the robot file."""

from dataclasses import replace
from functools import partial

from forcefit.assembly.effects.effect import RIGID, Effect, Unknown, Values
from forcefit.assembly.effects.places import drives, own_unit, with_frame
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.links import in_series
from forcefit.assembly.model.robot import Frame, Robot


def _softer(frame: Frame, stiffness: float) -> Frame:
    K = in_series(frame.joint_stiffness, frame.own_axis, 1 / stiffness)
    return replace(frame, joint_stiffness=K)


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for name, stiffness in values.items():
        conditions = with_frame(conditions, name, partial(_softer, stiffness=stiffness))
    return conditions


def _unit(robot: Robot, name: str) -> str:
    return "N m/rad" if own_unit(robot, name) == "rad" else "N/m"


def _public(robot: Robot, values: Values) -> dict[str, float]:
    """Convert fitted compliances to stiffnesses; negative compliances are allowed."""
    ends = len(".compliance")
    return {name[:-ends]: 1 / c for name, c in values.items() if abs(c) > RIGID}


DRIVE_COMPLIANCE = Effect(
    name="drive_compliance",
    apply=_apply,
    unit=_unit,
    frames=drives,
    components=("",),
    unknowns=lambda robot: (Unknown("compliance", 1e-6, 0.0, 1.0),),
    public=_public,
    linear=False,
)
