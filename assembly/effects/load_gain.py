"""Gain and offset of the load: applied load = gain x recorded load + offset."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Robot
from forcefit.stiffness.screws import WRENCH

_OFFSET = tuple(f"offset.{axis.lower()}" for axis in WRENCH)


def _apply(conditions: Conditions, values: Values) -> Conditions:
    offset = np.array([values.get(name, 0.0) for name in _OFFSET])
    return replace(
        conditions, load=values.get("factor", 1.0) * conditions.load + offset
    )


def _unit(robot: Robot, name: str) -> str:
    if name == "factor":
        return "1"
    return "N m" if name.startswith("offset.m") else "N"


LOAD_GAIN = Effect(
    name="load_gain",
    apply=_apply,
    unit=_unit,
    frames=None,
    components=("factor", *_OFFSET),
    unknowns=lambda robot: (
        Unknown("factor", 0.1, 0.0, 10.0, 1.0), *(Unknown(n, 1.0) for n in _OFFSET),
    ),
    by_row=True,
    follows_load=True,
)  # fmt: skip
