"""Actual coordinate = command + amplitude sin(command + phase), once a turn."""

import math

import numpy as np

from assembly.effects.effect import Effect, Unknown, Values
from assembly.effects.places import turning_drives, with_screws
from assembly.measurement.conditions import Conditions
from assembly.model.links import own_screw
from assembly.model.robot import Robot


def _apply(here: Conditions, values: Values) -> Conditions:
    for key, amplitude in values.items():
        name, _, kind = key.rpartition(".")
        if kind != "amplitude":
            continue
        row = here.robot.index(name)
        q = here.coordinates[:, row] + values.get(f"{name}.phase", 0.0)
        off = amplitude * np.sin(q)
        here = with_screws(here, name, off[:, None] * own_screw(here.robot.frames[row]))
    return here


def _public(robot: Robot, values: Values) -> dict[str, float]:
    """Amplitude and phase from the parts in sin and cos of the command."""
    found: dict[str, float] = {}
    for name in {key.rpartition(".")[0]: None for key in values}:
        sine = values.get(f"{name}.sine", 0.0)
        cosine = values.get(f"{name}.cosine", 0.0)
        found[f"{name}.amplitude"] = math.hypot(sine, cosine)
        found[f"{name}.phase"] = math.atan2(cosine, sine)
    return found


ENCODER_ECCENTRICITY = Effect(
    name="encoder_eccentricity",
    summary="drives stand off their command once a turn",
    apply=_apply,
    unit=lambda robot, name: "rad",
    frames=turning_drives,
    components=("amplitude", "phase"),
    unknowns=lambda robot: (Unknown("sine", 1e-4), Unknown("cosine", 1e-4)),
    public=_public,
    by_row=True,
)
