"""Deviation of the mass and the centre of mass of a body from the robot file.

Let m and c be the mass and centre in the file, and M and C the true values.  The
parameter ``mass`` is M - m, and ``moment`` is M C - m c.  The weight is linear in both
parameters.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.effect import Effect, Unknown, Values, at
from forcefit.assembly.effects.places import with_frame
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.model.robot import BeamLink, Frame, Robot

_MOMENT = ("moment.x", "moment.y", "moment.z")
_LEAST = 1e-9  # [kg] smallest mass with a defined centre


def heavy_bodies(robot: Robot) -> tuple[str, ...]:
    """Return the frames whose bodies have a mass, including beams."""
    return tuple(
        f.name
        for f in robot.frames
        if f.mass or (isinstance(f.link, BeamLink) and f.link.density)
    )


def _heavier(frame: Frame, mass: float, moment: NDArray) -> Frame:
    heavy = frame.mass + mass
    heavy = heavy if abs(heavy) > _LEAST else _LEAST
    centre = (frame.mass * frame.centre_of_mass + moment) / heavy
    return replace(frame, mass=heavy, centre_of_mass=centre)


def _apply(conditions: Conditions, values: Values) -> Conditions:
    for name in heavy_bodies(conditions.robot):
        mass, *moment = (values.get(at(name, k), 0.0) for k in ("mass", *_MOMENT))
        if mass or any(moment):
            change = partial(_heavier, mass=mass, moment=np.array(moment))
            conditions = with_frame(conditions, name, change)
    return conditions


BODY_MASS = Effect(
    name="body_mass",
    apply=_apply,
    unit=lambda robot, name: "kg" if name.endswith(".mass") else "kg m",
    frames=heavy_bodies,
    components=("mass", *_MOMENT),
    unknowns=lambda robot: (
        Unknown("mass", 0.1), *(Unknown(name, 0.01) for name in _MOMENT),
    ),
    weighs=True,
)  # fmt: skip
