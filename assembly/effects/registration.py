"""The measuring frame is turned and shifted, or the measured point is off."""

from dataclasses import replace

import numpy as np

from assembly.effects.effect import Effect, Unknown, Values
from assembly.measurement.conditions import Conditions
from assembly.model.robot import Robot
from stiffness.screws import SCREW, rotation_matrix, rotation_vector

BASE = tuple(f"base.{axis.lower()}" for axis in SCREW)
TOOL = ("tool.tx", "tool.ty", "tool.tz")


def _apply(here: Conditions, values: Values) -> Conditions:
    b = np.array([values.get(name, 0.0) for name in BASE])
    R = rotation_matrix(b[:3])
    turn = rotation_vector(R @ rotation_matrix(here.base[..., :3]))
    shift = here.base[..., 3:] @ R.T + b[3:]
    tool = here.tool + [values.get(name, 0.0) for name in TOOL]
    return replace(here, base=np.concatenate([turn, shift], axis=-1), tool=tool)


def _unit(robot: Robot, name: str) -> str:
    return "rad" if name.startswith("base.r") else "m"


REGISTRATION = Effect(
    name="registration",
    summary="the measuring frame, or the measured point, is not where it was thought",
    apply=_apply,
    unit=_unit,
    frames=None,
    components=BASE + TOOL,
    unknowns=lambda robot: tuple(Unknown(name, 1e-4) for name in BASE + TOOL),
    by_row=True,
    device=BASE,
)
