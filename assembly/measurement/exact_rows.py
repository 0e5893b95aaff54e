r"""Exact equilibrium of a robot without clearances in many measurements.

The equations are those of :mod:`forcefit.assembly.exact.exact`.  They are solved by a
chord method for all measurements together, with the inverse of the linear model at the
nominal posture (:mod:`forcefit.assembly.measurement.without_clearance`).  The first
iterate is the linear solution.  Measurements that do not converge are solved by
:func:`forcefit.assembly.exact.exact.solve_exact`.

The unknowns are defined in :mod:`forcefit.assembly.measurement.row_state`.

Sources:
    Ortega, Rheinboldt, Iterative Solution of Nonlinear Equations in Several Variables,
    section 7.1 (chord methods).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.pieces import cut_beams
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.row_state import Rows, RowState
from forcefit.assembly.measurement.without_clearance import flexibility
from forcefit.assembly.model.links import own_screws
from forcefit.assembly.model.robot import Robot

_MOST_ITERATIONS = 60  # largest number of iterations
# [rad, reference lengths] largest screw change in the last iteration
_CONVERGED = 1e-12
_CLOSURE_TOLERANCE = 1e-11  # [rad, reference lengths] largest closure residual
# largest force along a free motion, relative to the largest wrench
_FREE_FORCE = 1e-5
# [rad, reference lengths] deformation below which a wrench is treated as zero
_ZERO_LOAD = 1e-9
# largest accepted ratio of the changes in two successive iterations, after the initial
# iterations
_CONTRACTION = 0.8
_TRANSIENT = 3  # number of initial iterations in which changes can increase
_BATCH = 100  # number of measurements that are solved together


def solve_rows(
    conditions: Conditions, linear_deflections: NDArray
) -> tuple[NDArray, NDArray]:
    """Compute the exact platform screw of each measurement under its loads.

    Args:
        conditions: conditions of R measurements of a robot without clearances, with
            finite motions.
        linear_deflections: (R, s) [rad or m] deflections of s contacts in the linear
            model.

    Returns:
        (R, 6) [rad, m] rotation vector of R R_nominal^T and translation of the origin,
        base axes; and (R,) bool, True where the iteration converged.
    """
    conditions = _in_pieces(conditions)
    screws, converged = (
        np.full((len(conditions), 6), np.nan),
        np.zeros(len(conditions), dtype=bool),
    )
    distinct, posture_of_row = conditions.postures.distinct
    flexible = flexibility(distinct)
    if not _of_passive_joints(flexible.free, conditions.robot):
        return screws, converged
    for begin in range(0, len(conditions), _BATCH):
        rows = slice(begin, begin + _BATCH)
        some = conditions.take(np.arange(len(conditions))[rows])
        batch = Rows(some, flexible, posture_of_row[rows], linear_deflections[rows])
        screws[rows], converged[rows] = _solve(batch)
    return screws, converged


def _of_passive_joints(free: NDArray, robot: Robot) -> bool:
    """Return whether all free motions, (6n, q), are motions of passive joints."""
    passive = np.array([frame.passive for frame in robot.frames])
    own = own_screws(robot) * passive[:, None]
    for column in free.T.reshape(-1, len(robot.frames), 6):
        row = np.abs(column).max(axis=1).argmax()
        if not np.array_equal(column[row], own[row]):
            return False
    return True


def _solve(rows: Rows) -> tuple[NDArray, NDArray]:
    """Return the platform screws (R, 6), and a mask of converged measurements."""
    flexible, count = rows.flexible, len(rows.conditions)
    n, K = len(rows.conditions.robot.frames), 6 * len(rows.conditions.robot.closures)
    q = flexible.free.shape[1]
    state = RowState(
        rows, np.zeros((2, count, n, 6)), np.zeros((count, q)), np.zeros((count, K))
    )
    size, active = np.full(count, np.inf), ~flexible.ambiguous[rows.posture_of_row]
    active &= np.isfinite(rows.contact_compliance).all(axis=1)
    for iteration in range(_MOST_ITERATIONS):
        screws, motions, multipliers = _correction(state, first=iteration == 0)
        changes = screws.sum(axis=0) * rows.scale
        changes = changes.reshape(count, -1) + motions @ flexible.free.T
        previous_size, size = size, np.abs(changes).max(axis=1, initial=0.0)
        diverging = (
            size > (_CONTRACTION if iteration > _TRANSIENT else 1e3) * previous_size
        )
        active &= np.isfinite(size) & (size < 1.0) & ~(diverging & (size > _CONVERGED))
        if np.all(~active | (size <= _CONVERGED)):
            break
        inactive = ~active
        for part in (screws.swapaxes(0, 1), motions, multipliers):
            part[inactive] = 0.0
        state = RowState(
            rows, state.screws + screws, state.motions + motions,
            state.multipliers + multipliers,
        )  # fmt: skip
    converged = active & (size <= _CONVERGED)
    converged &= np.abs(state.residual).max(axis=1, initial=0.0) <= _CLOSURE_TOLERANCE
    converged &= np.all(np.abs(state.motions) <= flexible.limit, axis=1)
    _, free_forces, _ = state.imbalance()
    # Without loads, wrenches are only round-off.
    zero_load = _ZERO_LOAD / flexible.softness
    largest = np.abs(state.total_wrenches / rows.scale).max(
        axis=(0, 2, 3), initial=zero_load
    )
    converged &= np.all(
        np.abs(free_forces) * _lever_arms(rows) <= _FREE_FORCE * largest[:, None],
        axis=1,
    )
    return state.platform_screw, converged


def _lever_arms(rows: Rows) -> NDArray:
    """Return factors that convert forces along free motions to moments, (q,)."""
    free = rows.flexible.free
    return np.abs(free).T @ np.tile(1 / rows.scale, len(free) // 6)


def _correction(state: RowState, first: bool) -> tuple[NDArray, NDArray, NDArray]:
    """Return the changes of the unknowns, computed with the linear model."""
    rows, flexible = state.rows, state.rows.flexible
    screw_residual, free, w = state.imbalance()
    count, shape = len(rows.conditions), (len(rows.conditions), -1, 6)
    if rows.conditions.laws:
        deflections = rows.tangent_deflection(w) if first else rows.deflection(w)
        screw_residual[1] += (deflections @ rows.contacts.T).reshape(shape)
    J, softness, times = flexible.rows, flexible.softness, rows.times
    residual = state.residual + times(J, screw_residual.sum(axis=0).reshape(count, -1))
    right_side = -np.concatenate([residual, free * softness], axis=1)
    x = rows.corrected(right_side)
    multipliers, motions = x[:, : J.shape[1]] / softness, x[:, J.shape[1] :]
    closing = times(np.swapaxes(J, 1, 2), multipliers)
    if rows.conditions.laws:
        contact_part = (
            (closing @ rows.contacts) * rows.contact_compliance @ rows.contacts.T
        )
        screw_residual[1] += contact_part.reshape(shape)
    screw_residual[0] += np.einsum(
        "nij,rnj->rni", flexible.body_compliances, closing.reshape(shape)
    )
    screw_residual[1] += np.einsum(
        "nij,rnj->rni", flexible.joint_compliances, closing.reshape(shape)
    )
    return screw_residual, motions, multipliers


def _in_pieces(conditions: Conditions) -> Conditions:
    """Return the conditions of a robot whose beams are divided into elements."""
    cut = cut_beams(conditions.robot)
    if cut.robot is conditions.robot:
        return conditions
    postures = cut.cut(conditions.postures)
    return replace(
        conditions, robot=cut.robot, coordinates=postures.coordinates,
        transforms=postures.transforms, errors=cut.spread(conditions.errors),
    )  # fmt: skip
