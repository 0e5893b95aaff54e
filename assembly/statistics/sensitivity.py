"""How energy and margin grow with every geometric error, from their multipliers.

The least energy (22) is the largest over all balanced wrenches w of what they prove,
``-w.dl - ..``: its slope with delta l is minus the wrench through the body.  The margin
(21) is the largest of ``q.K dl``: its slope is ``K^T q`` of the best multipliers.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.energy import Assembly
from assembly.posture import Posture
from assembly.solvers.posture_margins import prepare_margins


@dataclass(frozen=True, eq=False)
class MarginSlopes:
    """A margin and how it grows with each error.

    Attributes:
        margin: factor on all clearances at which the robot just assembles.
        slopes: (n, 6) [1/rad, 1/m]; one of several where the margin has a kink.
    """

    margin: float
    slopes: NDArray


def energy_slopes(answer: Assembly) -> NDArray:
    """How the least energy grows with every geometric error.

    Args:
        answer: the assembly at least energy; under a load these are the slopes of
            energy minus the load's work.

    Returns:
        (n, 6) [J/rad, J/m], delta l of every frame in its axes.  Where rigid parts are
        overconstrained the wrenches, and with them slopes of errors there, are those
        of least size among many.
    """
    return -answer.wrenches


def margin_slopes(posture: Posture, compliant: str = "free") -> MarginSlopes:
    """How the zone's margin grows with every geometric error.

    Args:
        posture: where the robot stands, with its errors.
        compliant: ``"rigid"`` or ``"free"``, see :mod:`assembly.zone`.

    Returns:
        The margin and its slopes.

    Raises:
        ValueError: ``compliant`` is something else, or the margin has no slopes: no
            clearance helps, or the range of a passive joint's motion decides.
    """
    found = prepare_margins(posture, compliant).solve(posture.robot.errors[None])
    margin, slopes = float(found.margin[0]), found.slopes[0]
    if not (np.isfinite(margin) and np.isfinite(slopes).all()):
        raise ValueError("the margin has no slopes: no play within its bounds decides")
    return MarginSlopes(margin, slopes)
