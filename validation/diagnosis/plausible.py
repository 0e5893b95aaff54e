"""Numbers that no machine has, and readings that no sensor gives.

A fit may explain readings by a base that stands 29 m away on a foundation as soft as
rubber.  Ranges are wide, in terms of the robot's size and of the largest load: beyond
them something else is wrong, and nothing is claimed.

Sources:
    Ashby, Materials Selection in Mechanical Design, 4th ed., figure 4.11 (expansion of
    engineering materials: below 3e-4 /K).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from assembly.effects import LIBRARY
from assembly.kinematics.nominal import size_of
from validation.campaign.campaign import Campaign
from validation.diagnosis.background import Background
from validation.diagnosis.refit import Fit
from validation.diagnosis.small_terms import (
    GEOMETRY,
    KINDS,
    LARGEST_SHIFT,
    LARGEST_TURN,
)

_GIVES = 0.2  # [rad, sizes] that nothing gives under the largest load
_MADE = {"rotation": 0.1, "translation": 0.02}  # [rad, sizes] nobody makes worse
_HOT = 150.0  # [K] away from calibration: no machine is measured there
_G = 9.81  # [m/s^2]
_RANGES = {
    "1/K": (-5e-4, 5e-4, "engineering materials stay below 3e-4"),
    "m/s^2": (-12.0, 12.0, "weight is 9.8"),
}
_FACTORS = {"load_gain": (0.3, 3.0), "modulus_scale": (0.2, 5.0)}
_LIKELY = "check the declared stiffness, the units and the registration"


def impossible_rows(campaign: Campaign) -> NDArray:
    """Rows with a temperature that no sensor reads beside a machine at work.

    Args:
        campaign: of R rows.

    Returns:
        (R,) bool.
    """
    wrong = np.zeros(len(campaign), dtype=bool)
    for name, values in campaign.covariates.items():
        if "temperature" in name:
            wrong |= np.abs(values - np.median(values)) > _HOT
    return wrong


def implausible(campaign: Campaign, fit: Fit, behind: Background) -> tuple[str, ...]:
    """What of a fit no machine has.

    Args:
        campaign: that was fitted.
        fit: effects of the library.
        behind: geometric errors and springs.

    Returns:
        One sentence each; none where everything may be.
    """
    robot = campaign.robot
    size = size_of(robot)
    force = float(np.abs(campaign.loads[:, 3:]).max())
    force += _G * sum(frame.mass for frame in robot.frames)
    moment = float(np.abs(campaign.loads[:, :3]).max()) + force * size
    softest = {"N/m": force / (_GIVES * size), "N m/rad": moment / _GIVES}
    largest = {"rad": LARGEST_TURN, "m": LARGEST_SHIFT * size}
    known = campaign.registration == "known"

    def wrong() -> Iterator[str]:
        for effect, values in fit.effects.items():
            if effect == "registration" and not known:
                continue
            for name, value in values.items():
                unit = LIBRARY[effect].unit(robot, name)
                statement = f"{effect} {name} = {value:.3g} {unit}"
                if name.endswith(".phase"):
                    continue
                if abs(value) > largest.get(unit, np.inf):
                    yield f"{statement}, larger than {largest[unit]:.2g}"
                if value < softest.get(unit, -np.inf):
                    yield f"{statement}, which the loads would bend out of reach"
                low, high, why = _RANGES.get(unit, (-np.inf, np.inf, ""))
                if not low <= value <= high:
                    yield f"{statement}: {why}"
                if unit == "1" and effect in _FACTORS:
                    low, high = _FACTORS[effect]
                    if not low <= value <= high:
                        yield f"{statement}, expected {low:g} to {high:g}"
        scales = behind.scales.get(GEOMETRY, (0.0, 0.0))
        for kind, size_found, unit in zip(KINDS, scales, ("rad", "m"), strict=True):
            most = _MADE[kind] * (size if unit == "m" else 1.0)
            if size_found > most:
                yield (
                    f"geometric errors of {size_found:.2g} {unit} in {kind}, "
                    f"larger than {most:.2g}"
                )

    return tuple(f"{one}: {_LIKELY}" for one in wrong())
