"""Find implausible machine parameters and impossible sensor readings.

The plausible ranges are wide. They depend on the size of the robot and on the largest
load. A fitted parameter outside its range shows that the fitted model is probably
wrong.

Sources:
    Ashby, Materials Selection in Mechanical Design, 4th ed., figure 4.11 (expansion of
    engineering materials: below 3e-4 /K).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects import LIBRARY
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.diagnosis.fit import MachineFit
from forcefit.validation.diagnosis.nuisance import (
    GEOMETRY,
    KINDS,
    LARGEST_SHIFT,
    LARGEST_TURN,
)

# Largest plausible deformation under the largest load.  Rotations are in rad, and
# translations are relative to the size of the robot.
_GIVES = 0.2
# Largest plausible geometric error of a manufactured frame.  The rotation is in rad,
# and the translation is relative to the size of the robot.
_MADE = (0.1, 0.02)
_HOT = 150.0  # [K] largest plausible difference from the median temperature
_G = 9.81  # [m/s^2] acceleration of gravity
_FACTORS = {"load_gain": (0.3, 3.0), "modulus_scale": (0.2, 5.0)}
_LIKELY = "check the declared stiffness, the units and the registration"


def impossible_rows(campaign: Campaign) -> NDArray:
    """Return a mask (R,) of rows with an impossible temperature."""
    wrong = np.zeros(len(campaign), dtype=bool)
    for name, values in campaign.covariates.items():
        if "temperature" in name:
            wrong |= np.abs(values - np.median(values)) > _HOT
    return wrong


def implausible(campaign: Campaign, fit: MachineFit) -> tuple[str, ...]:
    """Return a sentence for each implausible parameter of a fitted machine."""
    return tuple(f"{one}: {_LIKELY}" for one in _implausible(campaign, fit))


def _implausible(campaign: Campaign, fit: MachineFit) -> Iterator[str]:
    """Yield a message for each implausible parameter."""
    robot, size = campaign.robot, size_of(campaign.robot)
    force = float(np.abs(campaign.loads[:, 3:]).max())
    force += _G * sum(frame.mass for frame in robot.frames)
    moment = float(np.abs(campaign.loads[:, :3]).max()) + force * size
    reach = ", so compliant that the loads move the platform out of its workspace"
    shift = LARGEST_SHIFT * size
    # Smallest and largest plausible value for each unit, and the message about a value
    # outside this range.
    ranges = {
        "rad": (-LARGEST_TURN, LARGEST_TURN, f", larger than {LARGEST_TURN:.2g}"),
        "m": (-shift, shift, f", larger than {shift:.2g}"),
        "N/m": (force / (_GIVES * size), np.inf, reach),
        "N m/rad": (moment / _GIVES, np.inf, reach),
        "1/K": (-5e-4, 5e-4, ": engineering materials stay below 3e-4 1/K"),
        "m/s^2": (-12.0, 12.0, ": gravity is 9.8 m/s^2"),
    }
    for effect, name, value in _parameters(campaign, fit):
        unit = LIBRARY[effect].unit(robot, name)
        low, high, why = ranges.get(unit, (-np.inf, np.inf, ""))
        if unit == "1" and effect in _FACTORS:
            low, high = _FACTORS[effect]
            why = f", expected {low:g} to {high:g}"
        if not name.endswith(".phase") and not low <= value <= high:
            yield f"{effect} {name} = {value:.3g} {unit}{why}"
    for part in fit.unknowns.small:
        kinds = zip(KINDS, ("rad", "m"), (_MADE[0], _MADE[1] * size), strict=True)
        for k, (kind, unit, most) in enumerate(kinds):
            scale = float(part.std[part.axis // 3 == k].max(initial=0.0))
            if part.name == GEOMETRY and scale > most:
                sizes = f"geometric errors of {scale:.2g} {unit} in {kind}"
                yield f"{sizes}, larger than {most:.2g}"


def _parameters(
    campaign: Campaign, fit: MachineFit
) -> Iterator[tuple[str, str, float]]:
    """Yield the effect, name and value of each parameter.

    For a drift, the value is the deviation at the end of the campaign.
    """
    bare = campaign.robot.without_effects()
    for one in fit.effects:
        values = one.hypothesis.public(bare, fit.own(one)[0])
        # Values of a session are differences from the robot file.
        if one.session is None:
            machine = fit.robot.effects.get(one.hypothesis.effect, {})
            values = {k: machine.get(k, v) for k, v in values.items()}
        went = 1.0
        if "time_constant" in values:
            span = float(np.ptp(campaign.covariates["time"]))
            went = 1.0 - float(np.exp(-span / values["time_constant"]))
        for name, value in values.items():
            yield one.hypothesis.effect, name, value * (went if "." in name else 1.0)
