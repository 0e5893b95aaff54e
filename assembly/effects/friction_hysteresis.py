"""Friction holds an elastic joint back: torque -tau x direction of approach."""

from assembly.effects.effect import Effect, Unknown, Values
from assembly.effects.places import own_unit, with_screws
from assembly.measurement.conditions import Conditions
from assembly.model.links import joint_compliances, own_screw
from assembly.model.robot import Frame, Robot


def elastic_joints(robot: Robot) -> tuple[str, ...]:
    """Joints that move with a spring along their own z: elastic drives, compliant."""
    softened = robot.effects.get("drive_compliance", {})
    return tuple(
        f.name
        for f in robot.frames
        if f.joint != "fixed" and (_springy(f) or f.name in softened)
    )


def _springy(frame: Frame) -> bool:
    own = frame.own_stiffness
    return own is not None and 0.0 < own < float("inf")


def _apply(here: Conditions, values: Values) -> Conditions:
    C = joint_compliances(here.robot)
    for name, tau in values.items():
        row = here.robot.index(name)
        # a torque inside the joint moves it by what its spring gives, free of stress
        give = C[row] @ own_screw(here.robot.frames[row])
        here = with_screws(here, name, -tau * here.approach[:, None] * give)
    return here


def _unit(robot: Robot, name: str) -> str:
    return "N m" if own_unit(robot, name) == "rad" else "N"


FRICTION_HYSTERESIS = Effect(
    name="friction_hysteresis",
    summary="elastic joints stop short of where they were going",
    apply=_apply,
    unit=_unit,
    frames=elastic_joints,
    components=("",),
    unknowns=lambda robot: (Unknown("", 1.0),),
    needs=("approach",),
    by_row=True,
)
