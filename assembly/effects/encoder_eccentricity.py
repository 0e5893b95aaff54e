"""Encoder eccentricity: actual angle = command + amplitude sin(command + phase)."""

import math

import numpy as np

from forcefit.assembly.effects.effect import Effect, Unknown, Values
from forcefit.assembly.effects.places import turning_drives, with_screws
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.links import own_screw
from forcefit.assembly.model.robot import Robot


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for key, amplitude in values.items():
        name, _, kind = key.rpartition(".")
        if kind != "amplitude":
            continue
        row = conditions.robot.index(name)
        q = conditions.coordinates[:, row] + values.get(f"{name}.phase", 0.0)
        offset = amplitude * np.sin(q)
        conditions = with_screws(
            conditions, name, offset[:, None] * own_screw(conditions.robot.frames[row])
        )
    return conditions


def _public(robot: Robot, values: Values) -> dict[str, float]:
    """Convert the coefficients of sine and cosine to amplitude and phase."""
    parameters: dict[str, float] = {}
    for name in {key.rpartition(".")[0]: None for key in values}:
        sine = values.get(f"{name}.sine", 0.0)
        cosine = values.get(f"{name}.cosine", 0.0)
        parameters[f"{name}.amplitude"] = math.hypot(sine, cosine)
        parameters[f"{name}.phase"] = math.atan2(cosine, sine)
    return parameters


ENCODER_ECCENTRICITY = Effect(
    name="encoder_eccentricity",
    apply=_apply,
    unit=lambda robot, name: "rad",
    frames=turning_drives,
    components=("amplitude", "phase"),
    unknowns=lambda robot: (Unknown("sine", 1e-4), Unknown("cosine", 1e-4)),
    public=_public,
    by_row=True,
)
