"""Elastic foundation with springs at the base origin along and about the base axes."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.effects.effect import RIGID, Effect, Unknown, Values
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import BASE, Frame, Robot
from forcefit.stiffness.screws import SCREW

FOUNDATION = "foundation"
_AXES = tuple(axis.lower() for axis in SCREW)


def _apply(conditions: Conditions, values: Values) -> Conditions:
    return _standing(conditions, with_foundation(conditions.robot, values))


def on_foundation(conditions: Conditions) -> Conditions:
    """Insert a frame between the base and all other frames.

    Args:
        conditions: conditions of R measurements.

    Returns:
        The conditions with the new frame.  They are unchanged if the robot has such a
        frame.
    """
    feet = [f for f in conditions.robot.frames if f.parent == BASE]
    foot = feet[0]
    placed = foot.translation.any() or foot.rotation.any()
    if len(feet) > 1 or placed or foot.joint != "fixed" or foot.link is not None:
        conditions = _standing(conditions, with_foundation(conditions.robot, {}))
    return conditions


def _standing(conditions: Conditions, robot: Robot) -> Conditions:
    """Return the conditions with a fixed frame inserted after the base."""
    still = np.broadcast_to(np.eye(4), (len(conditions), 1, 4, 4))
    zero = np.zeros((len(conditions), 1, 6))
    rest = (
        None
        if conditions.rest is None
        else np.concatenate([zero, conditions.rest], axis=1)
    )
    return replace(
        conditions, robot=robot, rest=rest,
        coordinates=np.concatenate([zero[:, :, 0], conditions.coordinates], axis=1),
        transforms=np.concatenate([still, conditions.transforms], axis=1),
        errors=np.concatenate([zero, conditions.errors], axis=1),
    )  # fmt: skip


def with_foundation(robot: Robot, values: Values) -> Robot:
    """Place a robot on an elastic foundation, a frame between base and ground.

    Args:
        robot: robot on a rigid base.
        values: ``stiffness.rx`` .. ``stiffness.tz`` [N m/rad, N/m]; the foundation is
            rigid in unspecified directions.

    Returns:
        The robot on its foundation.
    """
    K = np.diag([values.get(f"stiffness.{axis}", np.inf) for axis in _AXES])
    taken = {f.name for f in robot.frames}
    name = FOUNDATION
    while name in taken:
        name += "_"
    stand = Frame(name, joint_stiffness=K)
    moved = (replace(f, parent=name) if f.parent == BASE else f for f in robot.frames)
    return replace(robot, frames=(stand, *moved))


def _public(robot: Robot, values: Values) -> dict[str, float]:
    """Convert fitted compliances to stiffnesses; negative compliances are allowed."""
    return {
        f"stiffness.{name.removeprefix('compliance.')}": 1 / c
        for name, c in values.items()
        if abs(c) > RIGID
    }


def _unit(robot: Robot, name: str) -> str:
    return "N m/rad" if name.startswith("stiffness.r") else "N/m"


BASE_COMPLIANCE = Effect(
    name="base_compliance",
    apply=_apply,
    unit=_unit,
    frames=None,
    components=tuple(f"stiffness.{axis}" for axis in _AXES),
    unknowns=lambda robot: tuple(
        Unknown(f"compliance.{axis}", 1e-6, 0.0, 1.0) for axis in _AXES
    ),
    public=_public,
    splits=True,
)
