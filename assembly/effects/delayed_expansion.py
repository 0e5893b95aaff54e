"""Thermal expansion of a body whose temperature lags behind the recorded temperature.

The body expands by coefficient x length x body temperature, along its beam or along the
line between its joints.  The body temperature is the sensor temperature with a
first-order lag.  Both temperatures are equal at the first reading of a session.
"""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.effect import Effect, Unknown, Values, at
from forcefit.assembly.effects.places import (
    bodies,
    body_axis,
    growing,
    lengthening,
    with_screws,
)
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.variables import past
from forcefit.assembly.model.robot import Robot

_SENSOR, _LATE = "cov.temperature", "time_constant"
# initial guesses of the time constant, relative to the duration of all measurements
_SCAN = (0.03, 0.1, 0.3)


def _warmth(conditions: Conditions, time_constant: float) -> NDArray:
    """Return the body temperatures, which lag behind the sensor, (R,) [K]."""
    history, row = past(conditions, [_SENSOR])
    first = np.where(history.first, np.arange(len(history.first)), 0)
    began = history.values[_SENSOR][np.maximum.accumulate(first)]
    behind = history.lagged(_SENSOR, time_constant)
    return np.asarray(behind + began * history.fading(time_constant))[row]


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for name in bodies(conditions.robot):
        late = values.get(at(name, _LATE))
        if name not in values or late is None:
            continue
        frame = conditions.robot.frame(name)
        longer = values[name] * body_axis(frame)[0] * _warmth(conditions, late)
        conditions = with_screws(conditions, name, longer[:, None] * lengthening(frame))
    return conditions


def _unit(robot: Robot, name: str) -> str:
    return "s" if name.endswith(f".{_LATE}") else "1/K"


DELAYED_EXPANSION = Effect(
    name="delayed_expansion",
    apply=_apply,
    unit=_unit,
    frames=bodies,
    tried=growing,
    components=("", _LATE),
    unknowns=lambda robot: (
        Unknown("", 1e-5, -5e-4, 5e-4),
        Unknown(_LATE, 1000.0, 1.0, 1e9, scan=_SCAN, scan_by="time"),
    ),
    needs=("temperature", "time"),
    linear=False,
    by_row=True,
    refines="thermal_expansion",
)
