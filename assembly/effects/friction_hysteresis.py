"""Coulomb friction at an elastic joint: torque = -tau x direction of approach."""

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.effects.places import own_unit, with_screws
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.links import joint_compliances
from forcefit.assembly.model.robot import Frame, Robot


def elastic_joints(robot: Robot) -> tuple[str, ...]:
    """Return the joints with a spring along their motion."""
    softened = robot.effects.get("drive_compliance", {})
    return tuple(
        f.name
        for f in robot.frames
        if f.joint != "fixed" and (_has_own_spring(f) or f.name in softened)
    )


def _has_own_spring(frame: Frame) -> bool:
    own = frame.own_stiffness
    return own is not None and 0.0 < own < float("inf")


def _apply(conditions: Conditions, values: Values) -> Conditions:
    C = joint_compliances(conditions.robot)
    for name, tau in values.items():
        row = conditions.robot.index(name)
        # A friction torque is equivalent to a stress-free motion, compliance x torque.
        deflection = C[row, :, conditions.robot.frames[row].own_axis]
        conditions = with_screws(
            conditions, name, -tau * conditions.approach[:, None] * deflection
        )
    return conditions


def _unit(robot: Robot, name: str) -> str:
    return "N m" if own_unit(robot, name) == "rad" else "N"


FRICTION_HYSTERESIS = Effect(
    name="friction_hysteresis",
    apply=_apply,
    unit=_unit,
    frames=elastic_joints,
    components=("",),
    unknowns=lambda robot: (Unknown("", 1.0),),
    needs=("approach",),
    by_row=True,
)
