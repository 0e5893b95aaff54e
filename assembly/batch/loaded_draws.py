r"""Problem (22) under loads for many draws of the errors at one posture.

What is eliminated once, and every map of :mod:`assembly.batch.many_draws`, is that
of the robot without loads; a load adds constants to springs, free motions and pose, and
the work d.u that clearances may gain.  Each answer's certificate is evaluated on the
whole problem, as :attr:`assembly.linear.energy.Assembly.bound` does.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.load import Forces, forces_on, weights
from assembly.linear.reduction import FreeMotion, Reduction
from assembly.solvers.conic import SolverFailed, minimise_energy

if TYPE_CHECKING:
    from assembly.batch.draws import Draws
    from assembly.batch.many_draws import OnePosture
    from assembly.kinematics.posture import Posture

_LEFT_OPEN = 1e-11  # [rad, lengths] most that a closure may stay open
_GAP, _GAP_WITHOUT_PLAY = 1e-8, 1e-12  # accepted, as without loads


@dataclass(frozen=True, eq=False)
class Loads:
    """What pushes on a robot at one posture, and what follows from it for any errors.

    Attributes:
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        forces: of both, on every small screw.
        h: (r,) [sqrt(2 J)] what it adds to the springs' answer to the errors.
        d: (nu,) [J] its work along the clearances.
        preload: (6 closures,) multipliers by which it passes free motions.
        sag: (ny,) [sqrt(2 J)] what it does to the springs by itself.
        spread: (ny, r) from the small problem's springs to all of them.
        screws: (6n,) [rad, m] what it moves in every frame, free motions included.
        motions: (nq,) [rad, m] free motions among these.
    """

    load: NDArray
    gravity: NDArray
    forces: Forces
    h: NDArray
    d: NDArray
    preload: NDArray
    sag: NDArray
    spread: NDArray
    screws: NDArray
    motions: NDArray


def forces_of(posture: "Posture", load: NDArray, gravity: NDArray) -> Forces:
    """Forces of a load (6,) and of weight under gravity (3,) on all small screws."""
    own, carried = weights(posture, gravity)
    return forces_on(posture, load, own, carried)


def loads_of(
    small: Reduction, misfit: NDArray, load: ArrayLike, gravity: ArrayLike
) -> Loads:
    """What follows from loads for any errors.

    Args:
        small: reduced with the loads, whatever its errors.
        misfit: (r, 6n) springs' answer to the errors.
        load: (6,) [N m, N] on the platform.
        gravity: (3,) [m/s^2].

    Returns:
        The constants.
    """
    lin, joints = small.linearisation, small.joints
    h = small.h - misfit @ lin.posture.robot.errors.ravel()
    sag = small.load_springs
    moved = joints.elastic @ (small.spread @ h + sag)
    back = np.linalg.pinv(lin.rows @ joints.free, rcond=1e-10)
    motions = -back @ (lin.rows @ moved)
    return Loads(
        np.array(load, dtype=float), np.array(gravity, dtype=float), small.forces, h,
        small.d, small.preload, sag, small.spread, moved + joints.free @ motions,
        motions,
    )  # fmt: skip


def solve_loaded(one: "OnePosture", loads: Loads, errors: NDArray) -> "Draws":
    """Least energies of k draws under loads.

    Args:
        one: the posture.
        loads: on it.
        errors: (k, n, 6) [rad, m] delta l.

    Returns:
        As without loads; ``energy`` is what is stored, and ``bound`` is it less the
        certified gap of energy minus work.
    """
    from assembly.batch.draws import Draws

    count, nu = len(errors), one.G.shape[1]
    e = errors.reshape(count, -1)
    h = e @ one.misfit.T + loads.h
    u, y = np.full((count, nu), np.nan), np.full(h.shape, np.nan)
    if not len(one.H):
        none = np.zeros((0, nu)), np.zeros(0)
        for i in range(count):
            try:
                least = minimise_energy(one.G, h[i], loads.d, *none, one.joints.group)
            except SolverFailed:
                continue
            u[i], y[i] = least.clearances, least.springs
    own = (u @ one.G.T + h) @ loads.spread.T + loads.sag
    parts = np.hstack([u, e])
    motions = parts @ one.motions.T + loads.motions
    multipliers = loads.preload + y @ one.closing.T
    energy = (own**2).sum(axis=1) / 2
    gap = _gaps(one, loads, e, u, own, motions, multipliers)
    left = parts @ one.left.T + one.closures @ loads.screws
    open_ = np.abs(left).max(axis=1, initial=0.0)
    missed = np.abs(e @ one.unanswered.T).max(axis=1, initial=0.0)
    allowed = _GAP * energy + _GAP_WITHOUT_PLAY * (h**2).sum(axis=1) / 2
    # written so that a value that is not a number fails
    fine = (gap <= allowed) & (open_ <= _LEFT_OPEN) & (missed <= 1e-13)
    fine &= (np.abs(motions) <= one.ranges).all(axis=1)
    screws = parts @ one.screws.T + one.platform @ loads.screws
    answer = Draws(energy, energy - np.abs(gap), u, multipliers, screws, ~fine)
    for i in np.flatnonzero(~fine).tolist():
        _solve_slowly(one, loads, errors[i], answer, i)
    return answer


def _gaps(
    one: "OnePosture", loads: Loads, e: NDArray, u: NDArray, springs: NDArray,
    motions: NDArray, multipliers: NDArray,
) -> NDArray:  # fmt: skip
    """(k,) [J] energy minus work, less what the wrenches prove of it."""
    joints, forces = one.joints, loads.forces
    closing = multipliers @ one.closures
    body, joint = closing + forces.body, closing + forces.joint
    pull = np.where(joints.links, body @ joints.elastic, joint @ joints.elastic)
    play = (joint @ joints.cones) ** 2
    reach = np.sqrt(np.add.reduceat(play, one.starts[:-1], axis=1)) if u.size else play
    slip = np.abs(joint @ joints.free) * np.abs(motions)
    bound = -(body * e).sum(axis=1) - (pull**2).sum(axis=1) / 2
    bound = bound - reach.sum(axis=1) - slip.sum(axis=1)
    of_links = (springs * joints.links) @ joints.elastic.T
    of_joints = (springs * ~joints.links) @ joints.elastic.T
    of_joints = of_joints + u @ joints.cones.T + motions @ joints.free.T
    work = (e + of_links) @ forces.body + of_joints @ forces.joint
    return (springs**2).sum(axis=1) / 2 - work - bound


def _solve_slowly(
    one: "OnePosture", loads: Loads, errors: NDArray, answer: "Draws", i: int
) -> None:
    """Row i by :func:`assembly.linear.energy.solve_assembly`."""
    for values in (answer.energy, answer.bound, answer.clearances, answer.multipliers,
                   answer.platform_screw):  # fmt: skip
        values[i] = np.nan
    posture = replace(one.posture, robot=one.posture.robot.with_errors(errors))
    try:
        found = solve_assembly(posture, loads.load, gravity=loads.gravity)
    except (CannotAssemble, SolverFailed, FreeMotion):
        return
    answer.energy[i] = found.energy
    answer.bound[i] = found.energy - found.duality_gap()
    answer.platform_screw[i] = found.platform_screw
    answer.multipliers[i] = found.multipliers
    if found.clearances.shape == answer.clearances[i].shape:
        answer.clearances[i] = found.clearances
