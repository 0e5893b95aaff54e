"""Natural frequencies as a dictionary and as text."""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import CannotAssemble, failure_status
from forcefit.assembly.linear.load import driven
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.statuses import FREE_MOTION, UNSTABLE
from forcefit.assembly.platform_stiffness.vibration import (
    discretisation_errors,
    natural_modes,
)
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.results.display import listing, numbers
from forcefit.results.text import lines_of

_NOMINAL = (
    "these are the frequencies of the nominal robot without load and gravity; "
    "--state exact includes load, gravity and their effect on the stiffness"
)
_COARSE = 0.01  # [-] estimated error of a frequency above which a remark is printed
_NAMED = 3  # number of links and joints that are named for each mode


def vibration_of(
    posture: Posture,
    count: int = 6,
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    state: Literal["nominal", "exact"] = "nominal",
) -> dict[str, Any]:
    """Compute the results of ``assembly frequencies`` as a dictionary.

    Args:
        posture: posture of the robot.
        count: largest number of modes.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.
        state: ``"nominal"``, or ``"exact"`` for the equilibrium with errors, clearances
            and loads.

    Returns:
        Frequencies and modes. ``status`` is ``"ok"``, ``"free motion"``, ``"unstable"``
        or the type of failure.

    Raises:
        BadInput: no body that can move has a mass.
    """
    results: dict[str, Any] = {
        "robot": posture.robot.name, "status": "ok", "pose": posture.pose(),
        "state": state, "remarks": [],
    }  # fmt: skip
    loaded = np.any(load) or np.any(gravity) or driven(posture.robot)
    if state == "nominal" and loaded:
        results["remarks"] = [_NOMINAL]
    try:
        modes = natural_modes(posture, count, load, gravity, state)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return results | {"status": failure_status(error), "reason": str(error)}
    try:
        errors = discretisation_errors(modes, load, gravity, state)
    except (CannotAssemble, FreeMotion, SolverFailed):
        errors = np.full(len(modes.frequencies), np.nan)
    if np.isnan(modes.frequencies).any():
        results["status"] = UNSTABLE
    elif (modes.frequencies == 0.0).any():
        results["status"] = FREE_MOTION
    results["remarks"] = [*results["remarks"], *_coarse(modes.frequencies, errors)]
    return results | {
        "frequencies": modes.frequencies,
        "discretisation_errors": errors,
        "idle_motions": modes.idle,
        "modes": [
            {
                "frequency": float(frequency),
                "platform_screw": screw,
                "shares": {f"{p.frame} {p.kind}": share for p, share in shares.items()},
            }
            for frequency, screw, shares in zip(
                modes.frequencies, modes.platform_screws.T, modes.shares, strict=True
            )
        ],
    }


def vibration_text(results: dict[str, Any]) -> str:
    """Format the frequencies and the largest deformations as text."""
    about = lines_of(results, "pose status reason state idle_motions")
    lines = [listing(results["robot"], about, results["remarks"])]
    for mode in results.get("modes", ()):
        most = list(mode["shares"].items())[:_NAMED]
        shares = ", ".join(f"{name} {100 * share:.3g} %" for name, share in most)
        lines.append(f"{mode['frequency']:12.6g} Hz  {shares or _free(mode)}")
    return "\n".join(lines)


def _coarse(frequencies: NDArray, errors: NDArray) -> list[str]:
    """Return the remarks on frequencies with large or unknown errors."""
    remarks = []
    large = np.abs(errors[np.abs(errors) > _COARSE])
    if large.size:
        least, most = (f"{100 * e:.2g}" for e in (large.min(), large.max()))
        span = most if least == most else f"{least} to {most}"
        low = np.nanmin(errors) < -_COARSE
        remarks.append(
            f"{len(large)} of {len(errors)} frequencies are about {span} % "
            f"{'too high or too low' if low else 'too high'}, "
            'because each beam vibrates in one cubic shape; a larger "pieces" of its '
            "link in the robot file reduces this error"
        )
    unknown = int(np.sum((frequencies > 0.0) & np.isnan(errors)))
    if unknown:
        remarks.append(
            f"the errors of {unknown} of {len(errors)} frequencies are unknown, "
            'because no stable equilibrium was found with twice the number of "pieces" '
            "of each beam, or because the mass of a mesh link is condensed to its ends"
        )
    return remarks


def _free(mode: dict[str, Any]) -> str:
    """Format a free motion of the platform as text."""
    screw = np.asarray(mode["platform_screw"])
    turn, shift = np.linalg.norm(screw[:3]), np.linalg.norm(screw[3:])
    unit = screw / (turn if turn > 1e-6 * shift else shift or 1.0)
    return f"free motion of the platform along {numbers(unit)} [rad, m]"
