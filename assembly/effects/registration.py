"""Pose of the measuring frame, and position of the measured point (registration)."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Robot
from forcefit.stiffness.screws import SCREW, rotation_matrix, rotation_vector

BASE = tuple(f"base.{axis.lower()}" for axis in SCREW)
TOOL = ("tool.tx", "tool.ty", "tool.tz")


def _apply(conditions: Conditions, values: Values) -> Conditions:
    b = np.array([values.get(name, 0.0) for name in BASE])
    R = rotation_matrix(b[:3])
    turn = rotation_vector(R @ rotation_matrix(conditions.base[..., :3]))
    shift = conditions.base[..., 3:] @ R.T + b[3:]
    tool = conditions.tool + [values.get(name, 0.0) for name in TOOL]
    base = np.concatenate([turn, shift], axis=-1)
    return replace(conditions, base=base, tool=tool)


def _unit(robot: Robot, name: str) -> str:
    return "rad" if name.startswith("base.r") else "m"


REGISTRATION = Effect(
    name="registration",
    apply=_apply,
    unit=_unit,
    frames=None,
    components=BASE + TOOL,
    unknowns=lambda robot: tuple(
        Unknown(name, 1e-4, -most, most)
        for name in BASE + TOOL
        for most in [np.pi if _unit(robot, name) == "rad" else np.inf]
    ),
    by_row=True,
    device=BASE,
)
