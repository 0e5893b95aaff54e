"""How K_C answers to any number of a robot file: central differences."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import Posture, place_robot
from assembly.platform_stiffness.linear_tangent import without_clearance
from assembly.platform_stiffness.matrices import PlatformStiffness
from assembly.sweeps.parameters import Design
from forcefit.inputs.table import BadInput

_STEP = 1e-4  # of the number, or of a unit where it is zero: an error of 1e-8


def stiffness_slopes(
    design: Design,
    paths: list[str],
    pose: Mapping[str, float] | None = None,
    joints: Mapping[str, float] | None = None,
    at: NDArray | None = None,
) -> dict[str, NDArray]:
    """Derivatives of the platform's compliance by design numbers, clearances at zero.

    Args:
        design: the robot as its file says it.
        paths: of numbers; a frame's name without its leg moves all legs at once.
        pose: nominal platform pose, which is kept.
        joints: actuated coordinates, which are kept, instead.
        at: (3,) [m] of the platform, in its axes.

    Returns:
        By path, (6, 6) dC [rad/(N m) .. m/N per unit of the number], base axes; NaN
        where a motion of the platform is free.

    Raises:
        BadInput: no such number, or the robot or its posture does not exist a step
            beside it: a length in a closed loop cannot change alone.
    """
    slopes = {}
    for path in paths:
        values = [design.values[full] for full in design.find(path)]
        if len(set(values)) > 1:
            raise BadInput(
                f"--by {path}: the legs' numbers differ; expected full paths"
            )
        step = _STEP * (abs(values[0]) or 1.0)
        ahead, back = (
            _at(place_robot(design.robot({path: value}), pose, joints), at).compliance
            for value in (values[0] + step, values[0] - step)
        )
        slopes[path] = (ahead - back) / (2 * step)
    return slopes


def _at(posture: Posture, point: NDArray | None) -> PlatformStiffness:
    """The classical stiffness at a point of the platform."""
    stiffness, T = without_clearance(posture), posture.platform
    offset = np.zeros(3) if point is None else np.asarray(point)
    return stiffness.at(T[:3, 3] + T[:3, :3] @ offset)
