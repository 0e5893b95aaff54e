"""How results grow with every geometric error, from multipliers and active clearances.

The least energy (22) is the largest over all balanced wrenches w of what they prove,
``-w.dl - ..``: its slope with delta l is minus the wrench through the body.  The margin
(21) is the largest of ``q.K dl``: its slope is ``K^T q`` of the best multipliers.

Wrenches and the platform's screw are the solution itself.  Where the clearances that
are used up stay the same, it follows from its conditions differentiated once:

    G^T (G u + h) + H^T eta + nu u = 0,   H u = k,   |u_c| = 1 where nu_c > 0,

so du lies across u_c in every cone that is used up, and

    P (G^T G + nu) P du + P H^T deta = -P G^T dh,   H P du = dk

with P the projector on these directions.  One solve with the transposed equations
serves any number of errors.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.batch.draws import Draws
from assembly.batch.many_draws import OnePosture
from assembly.batch.many_margins import prepare_margins
from assembly.kinematics.posture import Posture
from assembly.linear.energy import Assembly
from assembly.model.clearance import Compliant
from assembly.solvers.conic import GAP_WITHOUT_PLAY

_USED_UP = 1e-7  # of the largest pull on any cone: less is none
_RANK = 1e-10  # of the equations: directions that nothing decides stay


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


def margin_slopes(posture: Posture, compliant: Compliant = "free") -> MarginSlopes:
    """How the zone's margin grows with every geometric error.

    Args:
        posture: where the robot stands, with its errors.
        compliant: ``"rigid"`` or ``"free"``, see :mod:`assembly.linear.zone`.

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


def solution_slopes(
    ready: OnePosture, found: Draws, by_wrench: NDArray, by_screw: NDArray,
    by_play: NDArray | None = None,
) -> NDArray:  # fmt: skip
    """How a function of wrenches and platform screw grows with every geometric error.

    Args:
        ready: the posture.
        found: what :meth:`OnePosture.solve` answered to k draws, none under a load.
        by_wrench: (k, n, 6) slopes of the function with the wrench through every body.
        by_screw: (k, 6) and with the platform's screw.
        by_play: (k, nu) and with the clearances themselves, in units of their cones.

    Returns:
        (k, n, 6) slopes with delta l of every frame in its axes; one of several where
        a clearance is just used up.  Play that nothing decides is taken to stay, and a
        passive joint at the end of its motion to give way as if it had none.
    """
    A, nu, k = ready.closures, len(ready.cones), len(found.energy)
    grip = A @ ready.joints.cones
    H = ready.redundant.T @ grip
    pulls = found.multipliers @ grip
    P, N = _used_up(ready, found, pulls)
    size = nu + len(H)
    K = np.zeros((k, size, size))
    K[:, :nu, :nu] = P @ (ready.G.T @ ready.G + N) @ P
    K[:, nu:, :nu] = H @ P
    K[:, :nu, nu:] = P @ H.T
    by_multiplier = np.tensordot(by_wrench, ready.wrench, axes=((1, 2), (0, 1)))
    by_spring = by_multiplier @ ready.closing
    right = np.zeros((k, size))
    across = by_spring @ ready.G + by_screw @ ready.screws[:, :nu]
    if by_play is not None:
        across += by_play
    right[:, :nu] = np.einsum("kij,kj->ki", P, across)
    right[:, nu:] = by_multiplier @ ready.redundant
    x = np.einsum("kij,kj->ki", np.linalg.pinv(K, _RANK, hermitian=True), right)
    moved = np.einsum("kij,kj->ki", P, x[:, :nu])
    slopes = (by_spring - moved @ ready.G.T) @ ready.misfit
    slopes += by_screw @ ready.screws[:, nu:] - x[:, nu:] @ ready.infeasible
    return slopes.reshape(by_wrench.shape)


def _used_up(
    ready: OnePosture, found: Draws, pulls: NDArray
) -> tuple[NDArray, NDArray]:
    """(k, nu, nu) projectors across clearances used up, and their multipliers nu."""
    k, nu = pulls.shape
    P, N = np.tile(np.eye(nu), (k, 1, 1)), np.zeros((k, nu, nu))
    # inside a zone multipliers y are rounding: energies y^2 / 2 beside pulls G y
    some = np.flatnonzero(
        found.energy > GAP_WITHOUT_PLAY * np.abs(pulls).sum(axis=1, initial=0.0)
    )
    largest = np.abs(pulls).max(axis=1, initial=0.0)
    for first, end in zip(ready.starts[:-1], ready.starts[1:], strict=True):
        own = pulls[some, first:end]
        size = np.linalg.norm(own, axis=1)
        kept = size > _USED_UP * largest[some]
        rows, unit = some[kept], own[kept] / size[kept, None]
        P[rows, first:end, first:end] -= unit[:, :, None] * unit[:, None, :]
        N[rows, first:end, first:end] = size[kept, None, None] * np.eye(end - first)
    return P, N
