"""Derivatives of the platform compliance with respect to numbers in a robot file."""

from collections.abc import Mapping
from dataclasses import replace

from numpy.typing import NDArray

from forcefit.assembly.effects.robot_effects import AppliedEffects, apply_robot_effects
from forcefit.assembly.kinematics.posture import place_robot
from forcefit.assembly.platform_stiffness.tangent_slopes import (
    TangentState,
    compliance_slope,
)
from forcefit.assembly.sweeps.parameters import Design
from forcefit.inputs.table import BadInput

# finite-difference step relative to the number, or to 1 if the number is zero
_STEP = 1e-4
_SMALL_STEP = 1e-8  # [rad, m] finite-difference step for geometric errors
_AS_ERROR = {"translation": "t", "rotation": "r"}


class CannotChange(BadInput):
    """Error for a number in a robot file that cannot be changed on its own."""


def stiffness_slopes(
    design: Design,
    paths: list[str],
    pose: Mapping[str, float] | None = None,
    joints: Mapping[str, float] | None = None,
    asked: TangentState | None = None,
    under: Mapping[str, float | str] | None = None,
) -> dict[str, NDArray]:
    """Differentiate the platform compliance with respect to numbers in a robot file.

    Args:
        design: content of the robot file.
        paths: paths of numbers. A path without the leg name refers to the numbers in
            all legs.
        pose: nominal platform pose, which is constant.
        joints: actuated coordinates, which are constant instead of the pose.
        asked: state in which the stiffness is computed; None for the nominal state.
        under: covariates of the effects.

    Returns:
        For each path, the derivative of the compliance in base axes, (6, 6) [rad/(N m)
        .. m/N per unit of the number]. It is NaN for free motions and at a contact
        change.

    Raises:
        BadInput: no number has a given path.
        CannotChange: a changed number gives no valid robot or posture, for example
            because it is a length in an overconstrained loop.
        CannotAssemble: the loops cannot be closed with the geometric errors.
        FreeMotion: a load acts along a motion without stiffness.
        SolverFailed: no equilibrium was found.
    """
    state = asked or TangentState()

    def at(values: Mapping[str, float]) -> AppliedEffects:
        posture = place_robot(design.robot(values), pose, joints)
        finite = state.state == "exact"
        return apply_robot_effects(
            posture, state.load, state.gravity, under, finite=finite
        )

    there = at({})
    loaded = replace(state, load=there.load, gravity=there.gravity)
    slopes = {}
    for path in paths:
        values = [design.values[full] for full in design.find(path)]
        if len(set(values)) > 1:
            raise BadInput(
                f"--by {path}: found different values in the legs; expected the "
                f"full path of one of them, such as {design.find(path)[0]}"
            )
        step = _STEP * (abs(values[0]) or 1.0)
        if ".geometric_error." in path:
            step = _SMALL_STEP
        try:
            ahead, back = (at({path: values[0] + sign * step}) for sign in (1, -1))
        except BadInput as error:
            raise CannotChange(_cannot_change(path, str(error))) from None
        slopes[path] = compliance_slope(
            there.posture, ahead.posture, back.posture, step, loaded
        )
    return slopes


def _cannot_change(path: str, reason: str) -> str:
    """Return the error message for a number that cannot be varied."""
    frame, *keys = path.rsplit(".", 2)
    instead = ""
    if len(keys) == 2 and keys[0] in _AS_ERROR and keys[1] in {"x", "y", "z"}:
        error = f"{frame}.geometric_error.{_AS_ERROR[keys[0]]}{keys[1]}"
        instead = f"; to change it as a geometric error, use --by {error}"
    return f"{path} cannot change alone: {reason}{instead}"
