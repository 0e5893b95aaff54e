"""How K_C answers to any number of a robot file."""

from collections.abc import Mapping

from numpy.typing import NDArray

from assembly.kinematics.posture import Posture, place_robot
from assembly.platform_stiffness.tangent_slopes import TangentState, compliance_slope
from assembly.sweeps.parameters import Design
from forcefit.inputs.table import BadInput

_STEP = 1e-4  # of the number, or of a unit where it is zero: an error of 1e-8
_SMALL_STEP = 1e-8  # [rad, m] of errors: contacts change within some um of them


def stiffness_slopes(
    design: Design,
    paths: list[str],
    pose: Mapping[str, float] | None = None,
    joints: Mapping[str, float] | None = None,
    asked: TangentState | None = None,
) -> dict[str, NDArray]:
    """Derivatives of the platform's compliance by design numbers.

    Args:
        design: the robot as its file says it.
        paths: of numbers; a frame's name without its leg moves all legs at once.
        pose: nominal platform pose, which is kept.
        joints: actuated coordinates, which are kept, instead.
        asked: of which tangent; the classical one if absent.

    Returns:
        By path, (6, 6) dC [rad/(N m) .. m/N per unit of the number], base axes; NaN
        where a motion of the platform is free, or at a change of contact.

    Raises:
        BadInput: no such number, or the robot or its posture does not exist a step
            beside it: a length in a closed loop cannot change alone.
        CannotAssemble: the errors cannot be closed.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: no equilibrium was found.
    """
    asked = asked or TangentState()

    def at(values: Mapping[str, float]) -> Posture:
        return place_robot(design.robot(values), pose, joints)

    slopes = {}
    for path in paths:
        values = [design.values[full] for full in design.find(path)]
        if len(set(values)) > 1:
            raise BadInput(
                f"--by {path}: the legs' numbers differ; expected full paths"
            )
        step = _STEP * (abs(values[0]) or 1.0)
        if ".geometric_error." in path:
            step = _SMALL_STEP
        ahead, back = (at({path: values[0] + sign * step}) for sign in (1, -1))
        slopes[path] = compliance_slope(at({}), ahead, back, step, asked)
    return slopes
