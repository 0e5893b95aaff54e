"""Validity of the first-order analysis in comparison with the exact solution."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.singular_posture import is_singular
from forcefit.assembly.kinematics.verdict import SINGULAR_WORDS, limits_passed
from forcefit.assembly.linear.energy import Assembly, CannotAssemble, failure_status
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.statuses import BEYOND_LIMITS, SINGULAR
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.results.display import rounded, screw_text

# relative energy error above which the first-order analysis is invalid
MOST_ENERGY = 0.5
# [rad or reference lengths] joint motion above which the first-order analysis is
# invalid
_LARGE = 0.3


def linearisation_of(
    assembly: Assembly, gravity: ArrayLike | None
) -> tuple[dict[str, Any], str]:
    """Return the linearisation error, and a text on the exact solution."""
    try:
        exact = solve_exact(assembly.posture, assembly.load, assembly, gravity=gravity)
    except SolverFailed as error:
        return {"status": str(error)}, f"no answer, {error}"
    return {"status": "ok", **vars(exact.linearisation_error)}, _words(exact)


def first_order_status(
    assembly: Assembly, linearisation: dict[str, Any], finite: str
) -> dict[str, str]:
    """Return status and reason if the first-order analysis is invalid.

    Args:
        assembly: result of the first-order analysis.
        linearisation: linearisation error from :func:`linearisation_of`.
        finite: text on the exact solution.

    Returns:
        ``status`` and ``reason`` of the JSON output; empty if the analysis is valid.
    """
    change = abs(linearisation.get("relative_energy", 0.0))
    scale = np.repeat([1.0, assembly.linearisation.size], 3)
    moved = float(np.abs(assembly.clearance_screws / scale).max(initial=0.0))
    if _singular(assembly.posture):
        words = SINGULAR_WORDS
    elif change > MOST_ENERGY:
        words = off_by(change)
    elif "relative_energy" not in linearisation and moved > _LARGE:
        words = (
            "the first-order analysis is not valid here: a joint moves by "
            f"{moved:.3g} rad"
        )
    else:
        return {}
    return {"status": SINGULAR, "reason": f"{words}; finite motions: {finite}"}


def posture_status(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> dict[str, str]:
    """Return status and reason if a posture is singular or outside joint limits.

    Args:
        posture: posture of the robot.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        ``status`` and ``reason`` of the JSON output; empty for any other posture.
    """
    if passed := limits_passed(posture.robot, posture.coordinates):
        return {"status": BEYOND_LIMITS, "reason": passed}
    return singular_status(posture, load, gravity)


def singular_status(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> dict[str, str]:
    """Return status and reason if a posture is singular.

    Args:
        posture: posture of the robot.
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.

    Returns:
        ``status`` and ``reason`` of the JSON output; empty for any other posture.
    """
    if not _singular(posture):
        return {}
    try:
        finite = _words(solve_exact(posture, load, gravity=gravity))
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        finite = f"{failure_status(error)}, {error}"
    return {"status": SINGULAR, "reason": f"{SINGULAR_WORDS}; finite motions: {finite}"}


def off_by(change: float) -> str:
    """Return a text on the energy error of the first-order analysis."""
    return (
        "the first-order analysis is not valid here: its energy is wrong by "
        f"{100 * abs(change):.3g} %"
    )


def _singular(posture: Posture) -> bool:
    """Return whether a posture is singular."""
    return is_singular(posture.robot, posture.coordinates, posture.transforms)


def _words(exact: ExactAssembly) -> str:
    """Format energy and pose error of the exact solution as text."""
    return (
        f"{rounded(exact.energy):.6g} J, platform error "
        f"{screw_text(exact.platform_screw)}"
    )
