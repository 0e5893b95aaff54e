"""Whether first order decides at a posture, and what finite motions say there."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from assembly.exact.exact import ExactAssembly, solve_exact
from assembly.kinematics.posture import Posture
from assembly.kinematics.singular_posture import is_singular
from assembly.kinematics.verdict import SINGULAR_WORDS, limits_passed
from assembly.linear.energy import Assembly, CannotAssemble, failure_status
from assembly.linear.reference.reduction import FreeMotion
from assembly.model.statuses import BEYOND_LIMITS, SINGULAR
from assembly.solvers.conic import SolverFailed
from forcefit.results.display import rounded, screw_text

# of the energy: where finite motions change more of it, its first order says nothing
MOST_ENERGY = 0.5
_LARGE = (
    0.3  # [rad or lengths] motion that is not small; linear closures err by a tenth
)


def linearisation_of(
    assembly: Assembly, gravity: ArrayLike | None
) -> tuple[dict[str, Any], str]:
    """Linear minus exact solution as plain values, and the exact one in words."""
    try:
        exact = solve_exact(assembly.posture, assembly.load, assembly, gravity=gravity)
    except SolverFailed as error:
        return {"status": str(error)}, f"no answer, {error}"
    return {"status": "ok", **vars(exact.linearisation_error)}, _words(exact)


def first_order_status(
    assembly: Assembly, linearisation: dict[str, Any], finite: str
) -> dict[str, str]:
    """Status and reason of a solution that first order does not decide; else empty.

    Args:
        assembly: of first order.
        linearisation: of :func:`linearisation_of`.
        finite: its words.

    Returns:
        Keys of the public format.
    """
    change = abs(linearisation.get("relative_energy", 0.0))
    scale = np.repeat([1.0, assembly.linearisation.size], 3)
    moved = float(np.abs(assembly.clearance_screws / scale).max(initial=0.0))
    if _singular(assembly.posture):
        words = SINGULAR_WORDS
    elif change > MOST_ENERGY:
        words = off_by(change)
    elif "relative_energy" not in linearisation and moved > _LARGE:
        words = f"first order decides nothing here: it moves a joint by {moved:.3g} rad"
    else:
        return {}
    return {"status": SINGULAR, "reason": f"{words}; finite motions: {finite}"}


def posture_status(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> dict[str, str]:
    """Status and reason of a posture beyond the joints' limits, or singular.

    Args:
        posture: of the robot.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        Keys of the public format; empty at any other posture.
    """
    if passed := limits_passed(posture.robot, posture.coordinates):
        return {"status": BEYOND_LIMITS, "reason": passed}
    return singular_status(posture, load, gravity)


def singular_status(
    posture: Posture, load: ArrayLike | None = None, gravity: ArrayLike | None = None
) -> dict[str, str]:
    """Status and reason where the posture is singular, with what finite motions say.

    Args:
        posture: of the robot.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.

    Returns:
        Keys of the public format; empty at any other posture.
    """
    if not _singular(posture):
        return {}
    try:
        finite = _words(solve_exact(posture, load, gravity=gravity))
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        finite = f"{failure_status(error)}, {error}"
    return {"status": SINGULAR, "reason": f"{SINGULAR_WORDS}; finite motions: {finite}"}


def off_by(change: float) -> str:
    """That first order is off by a share of the energy."""
    return (
        f"first order decides nothing here: it is off by {100 * abs(change):.3g} % of "
        "the energy"
    )


def _singular(posture: Posture) -> bool:
    """Whether a posture is singular."""
    return is_singular(posture.robot, posture.coordinates, posture.transforms)


def _words(exact: ExactAssembly) -> str:
    """Energy and pose error with finite motions."""
    return (
        f"{rounded(exact.energy):.6g} J, platform error "
        f"{screw_text(exact.platform_screw)}"
    )
