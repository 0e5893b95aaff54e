"""Drift of the device reading: amplitude x (1 - exp(-time / time constant))."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import Robot
from forcefit.stiffness.screws import SCREW

_AMPLITUDE = tuple(f"amplitude.{axis.lower()}" for axis in SCREW)

# initial guesses of the time constant, relative to the duration of all measurements
_SCAN = (0.03, 0.1, 0.3, 1.0, 3.0)


def _apply(conditions: Conditions, values: Values) -> Conditions:
    amplitude = np.array([values.get(name, 0.0) for name in _AMPLITUDE])
    with np.errstate(over="ignore"):  # the ratio time / time constant can overflow
        settled = 1.0 - np.exp(-conditions.time / values["time_constant"])
    drift = settled[:, None] * amplitude
    return replace(conditions, reading=conditions.reading + drift)


def _unit(robot: Robot, name: str) -> str:
    if name == "time_constant":
        return "s"
    return "rad" if name.startswith("amplitude.r") else "m"


DRIFT = Effect(
    name="drift",
    apply=_apply,
    unit=_unit,
    frames=None,
    components=(*_AMPLITUDE, "time_constant"),
    unknowns=lambda robot: (
        *(Unknown(name, 1e-5) for name in _AMPLITUDE),
        Unknown("time_constant", 1000.0, 1.0, 1e9, scan=_SCAN, scan_by="time"),
    ),
    needs=("time",),
    linear=False,
    by_row=True,
)
