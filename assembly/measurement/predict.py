"""Predict the deviation of the platform in each measurement.

Measurements of robots without clearances are solved together by
:mod:`forcefit.assembly.measurement.without_clearance` for small motions, or
:mod:`forcefit.assembly.measurement.exact_rows` for finite motions.  Measurements with
clearances, or with closures of ambiguous rank, are solved one by one by
:mod:`forcefit.assembly.linear.energy` and :mod:`forcefit.assembly.exact.exact`.

Sources:
    Public format, campaigns: the deviation is the rotation vector of R_actual
    R_nominal^T and the displacement of the reference point, base axes.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exact.exact import ExactAssembly, solve_exact
from forcefit.assembly.linear.closure import virtual_joints
from forcefit.assembly.linear.energy import Assembly, CannotAssemble, solve_assembly
from forcefit.assembly.linear.load import loads_with_weight
from forcefit.assembly.linear.nearest_pose import nearest_pose
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.measurement.conditions import Conditions
from forcefit.assembly.measurement.contacts import (
    CONVERGED,
    ITERATIONS,
    contact_columns,
    contact_deflections,
    secants,
    softened,
    wrenches_through,
)
from forcefit.assembly.measurement.exact_rows import solve_rows
from forcefit.assembly.measurement.settled_clearance import (
    fractions,
    with_clearances_at_rest,
    with_clearances_taken_up,
    without_joint_clearances,
)
from forcefit.assembly.measurement.without_clearance import (
    at_postures,
    flexibility,
    responses_to,
)
from forcefit.assembly.measurement.yields import Yields, settle_yields, with_springs
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.stiffness.screws import rotation_matrix, rotation_vector

# largest number of configurations for which second-order corrections are computed
_MOST_ONE_BY_ONE = 40
# largest relative change of contact deflections at convergence, for finite motions
_CONVERGED_FINITE = 1e-5


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted readings of R measurements.

    Attributes:
        deviation: (R, 6) [rad, m] rx ry rz tx ty tz, base axes; NaN without a solution.
        reason: (R,) reason why there is no solution; otherwise empty.
        undetermined: (R,) bool, True if clearances make the pose non-unique.  For
            closed chains, the deviation then belongs to the pose nearest to nominal.
            For open chains, it belongs to joints at the centre of their clearances.
    """

    deviation: NDArray
    reason: NDArray
    undetermined: NDArray


def predict(conditions: Conditions) -> Prediction:
    """Predict the deviation of the platform from its nominal pose.

    Args:
        conditions: conditions of R measurements.

    Returns:
        The predicted readings.
    """
    has_clearance = bool(virtual_joints(conditions.robot).cones.shape[1])
    undetermined = np.zeros(len(conditions), dtype=bool)
    one_by_one = None
    if has_clearance and conditions.rest is not None:
        conditions = with_clearances_at_rest(conditions)
        # If the exact model has no solution, the measurement has no prediction.
        one_by_one = 0 if conditions.exact else None
    elif has_clearance and not conditions.robot.closures and not conditions.exact:
        conditions, undetermined = with_clearances_taken_up(conditions)
    screws, reason, also_undetermined = _platform_screws(conditions, one_by_one)
    undetermined |= also_undetermined
    if not conditions.exact:
        screws = screws + conditions.second_order
    known = np.isfinite(screws).all(axis=1)
    deviation = np.full_like(screws, np.nan)
    if known.all():
        deviation = read(conditions, screws)
    elif known.any():
        deviation[known] = read(conditions.take(known), screws[known])
    return Prediction(deviation, reason, undetermined)


def _platform_screws(
    conditions: Conditions, one_by_one: int | None = None
) -> tuple[NDArray, NDArray, NDArray]:
    """Compute the platform screws of all measurements.

    Returns:
        (R, 6) screws; (R,) reasons why there is no solution; and (R,) bool, True if
        clearances make the screw non-unique.
    """
    screws, undetermined = (
        np.full((len(conditions), 6), np.nan),
        np.zeros(len(conditions), dtype=bool),
    )
    reason = np.full(len(conditions), "", dtype=object)
    unsolved = np.ones(len(conditions), dtype=bool)
    if not virtual_joints(conditions.robot).cones.shape[1]:
        screws, solved = _without_clearance(conditions)
        unsolved = ~solved
        screws[unsolved], reason[unsolved] = (
            np.nan,
            "the closures do not close when all measurements are solved together",
        )
    for row in np.flatnonzero(unsolved)[:one_by_one].tolist():
        try:
            assembly, undetermined[row] = _nearest_assembly(conditions, row)
            screws[row], reason[row] = assembly.platform_screw, ""
        except (CannotAssemble, FreeMotion, SolverFailed) as error:
            screws[row], reason[row] = np.nan, str(error)
    return screws, reason, undetermined


def _nearest_assembly(
    conditions: Conditions, row: int
) -> tuple[Assembly | ExactAssembly, bool]:
    """Return the assembly with the pose closest to nominal, for one measurement.

    With finite motions, the solution starts from that pose of the linear model.

    Returns:
        The assembly, and whether clearances make its pose non-unique.
    """
    assembly = assemble_row(conditions, row)
    offset = conditions.posture(row).platform[:3, :3] @ conditions.point
    if isinstance(assembly, Assembly):
        return nearest_pose(assembly, offset)
    start, undetermined = nearest_pose(assembly.linear, offset)
    if undetermined:
        gravity = conditions.gravity[row] if conditions.gravity[row].any() else None
        assembly = solve_exact(
            start.posture,
            conditions.load[row],
            start,
            gravity=gravity,
            point=conditions.point,
        )
    return assembly, undetermined


def with_second_order(conditions: Conditions) -> Conditions:
    """Add the second-order effect of the geometric errors to the conditions.

    Near a singularity, geometric errors cause large motions, and the error of the
    linear model exceeds the noise of a device.  The difference between the exact and
    the linear platform screw without load is therefore computed for each configuration.
    The effects of loads remain linear.

    Args:
        conditions: conditions of R measurements without additional effects.

    Returns:
        The conditions with ``second_order``.
    """
    if virtual_joints(conditions.robot).cones.shape[1]:
        # Without a load, the rest position of clearances is undetermined.
        return conditions
    zero = np.zeros_like(conditions.load)
    _, which = conditions.postures.distinct
    _, first = np.unique(which, return_index=True)
    unloaded = replace(
        conditions, load=zero, gravity=np.zeros_like(conditions.gravity), laws=()
    )
    second_order = _finite_part(unloaded.take(first), _MOST_ONE_BY_ONE)
    return replace(conditions, second_order=second_order[which])


def with_finite_motions(conditions: Conditions) -> Conditions:
    """Add the effect of finite motions to the conditions.

    The correction is computed as in :func:`with_second_order`, but under the loads of
    each measurement.

    Args:
        conditions: conditions of R measurements without additional effects.

    Returns:
        The conditions, with ``second_order`` and without ``exact``.
    """
    return replace(conditions, exact=False, second_order=_finite_part(conditions))


def _finite_part(conditions: Conditions, one_by_one: int | None = None) -> NDArray:
    """Return the exact minus the linear platform screws, (R, 6).

    The difference is zero without a solution.
    """
    conditions = replace(conditions, yields=())
    exact, linear = (
        _platform_screws(replace(conditions, exact=finite), one_by_one)[0]
        for finite in (True, False)
    )
    return np.nan_to_num(exact - linear)


def with_rest_positions(conditions: Conditions) -> Conditions:
    """Fix the joints at their minimum-energy positions within the clearances.

    The result is correct to first order if effects do not change the contact points.

    Args:
        conditions: conditions of R measurements.

    Returns:
        The conditions with ``rest``.  Without a solution, joints are centred in their
        clearances.
    """
    rest = np.zeros_like(conditions.errors)
    for row in range(len(conditions)):
        try:
            assembly, _ = _nearest_assembly(conditions, row)
        except (CannotAssemble, FreeMotion, SolverFailed):
            continue
        rest[row] = fractions(conditions.robot, assembly.clearance_screws)
    return replace(conditions, rest=rest)


def read(conditions: Conditions, screws: NDArray) -> NDArray:
    """Convert platform screws to readings of the device.

    Args:
        conditions: conditions of R measurements.
        screws: (R, 6) [rad, m] rotation vector of R R_nominal^T and translation of the
            platform's origin, base axes.

    Returns:
        (R, 6) [rad, m] deviations measured by the device.
    """
    platform = conditions.postures.platform
    R, p = platform[:, :3, :3], platform[:, :3, 3]
    turn = rotation_matrix(screws[:, :3])
    arm = conditions.measured_arms
    tool = _turned(R, conditions.tool) if conditions.tool.any() else 0.0
    lever = _turned(turn - np.eye(3), arm + tool)
    shift = screws[:, 3:] + lever + tool
    base = rotation_matrix(conditions.base[..., :3])
    # A rotation of the measuring frame moves the measured position.
    translation = _turned(base - np.eye(3), p + arm) + _turned(base, shift)
    translation += conditions.base[..., 3:]
    turns = conditions.base[..., :3].any()
    rotation = rotation_vector(base @ turn) if turns else screws[:, :3]
    return np.concatenate([rotation, translation], axis=1) + conditions.reading


def _turned(R: NDArray, vectors: NDArray) -> NDArray:
    """Rotate vectors (R, 3) by a common matrix, or each vector by its own matrix."""
    if R.ndim == 2:
        return vectors @ R.T
    return np.einsum("rij,...j->ri" if vectors.ndim == 1 else "rij,rj->ri", R, vectors)


def assemble_row(
    conditions: Conditions, row: int, bodies: NDArray | None = None,
    carried: NDArray | None = None,
) -> Assembly | ExactAssembly:  # fmt: skip
    """Solve one measurement and return all screws and wrenches of the robot.

    Args:
        conditions: conditions of all measurements.
        row: index of the measurement.
        bodies: (n, 6) [N m, N] additional loads on the bodies, as for
            :func:`forcefit.assembly.linear.energy.solve_assembly`; only for the linear
            model.
        carried: (n, 6) [N m, N] additional loads on the bodies that the joints carry.

    Returns:
        The linear or exact assembly, depending on the conditions.

    Raises:
        CannotAssemble: a loop cannot be closed.
        FreeMotion: a load acts along a motion without stiffness.
        SolverFailed: the solver failed, or contacts did not converge.
    """
    if conditions.yields:
        return _assemble_yielding(with_springs(conditions, row), bodies, carried)
    posture = conditions.posture(row)
    load = conditions.load_at_origin()[row]
    gravity = conditions.gravity[row] if conditions.gravity[row].any() else None
    compliances = np.zeros(len(conditions.laws))
    # Start from the contact deflections of the linear model.
    if conditions.exact and conditions.laws:
        linear = assemble_row(replace(conditions, exact=False), row)
        compliances = secants(linear, conditions.laws)
    assembly: Assembly | ExactAssembly
    for _ in range(ITERATIONS):
        softer = softened(posture, conditions.laws, compliances)
        if conditions.exact:
            assembly = solve_exact(
                softer, conditions.load[row], gravity=gravity, point=conditions.point
            )
        else:
            assembly = solve_assembly(softer, load, bodies, gravity, carried=carried)
        before, compliances = compliances, secants(assembly, conditions.laws)
        tolerance = _CONVERGED_FINITE if conditions.exact else CONVERGED
        if np.all(np.abs(compliances - before) <= tolerance * compliances):
            return assembly
    raise SolverFailed("contact", f"no convergence in {ITERATIONS} iterations")


def _assemble_yielding(
    row: Conditions, bodies: NDArray | None, carried: NDArray | None
) -> Assembly | ExactAssembly:
    """Solve one measurement of a robot with deflection laws."""

    def solve(held: Conditions) -> tuple[Assembly | ExactAssembly, NDArray]:
        assembly = assemble_row(held, 0, bodies, carried)
        return assembly, wrenches_through(assembly).reshape(1, -1)

    def stress(yields: Yields) -> NDArray:
        tight = replace(row.postures, robot=without_joint_clearances(row.robot))
        return flexibility(tight).self_stress(yields.places, yields.read)

    if row.yields:
        return settle_yields(row, solve, stress)
    return assemble_row(row, 0, bodies, carried)


def _without_clearance(conditions: Conditions) -> tuple[NDArray, NDArray]:
    """Return the platform screws without clearances, and a mask of solved rows."""
    if not conditions.yields:
        screws, _, solved = _linear(conditions)
        return screws, solved
    unsolved = (
        np.full((len(conditions), 6), np.nan),
        np.zeros(len(conditions), dtype=bool),
    )
    if conditions.exact:
        # The caller then solves all measurements one by one.
        return unsolved
    distinct, which = conditions.postures.distinct

    def solve(held: Conditions) -> tuple[tuple[NDArray, NDArray], NDArray]:
        screws, wrenches, solved = _linear(held)
        return (screws, solved), wrenches

    def stress(yields: Yields) -> NDArray:
        A = flexibility(distinct).self_stress(yields.places, yields.read)
        return A[which]

    try:
        return settle_yields(conditions, solve, stress)
    except SolverFailed:
        return unsolved


def _linear(conditions: Conditions) -> tuple[NDArray, NDArray, NDArray]:
    """Solve measurements of robots without clearances by the linear model.

    Returns:
        (R, 6) platform screws, (R, 6n) joint wrenches of the linear model, and (R,)
        bool, True where a solution was found.
    """
    distinct, which = conditions.postures.distinct
    flexible = flexibility(distinct)
    forces = loads_with_weight(
        conditions.postures, conditions.load_at_origin(), conditions.gravity
    )
    errors = conditions.errors.reshape(len(conditions), -1)
    solution = flexible.solve(which, errors, forces)
    screws, solved = solution.platform_screw, solution.solved
    wrenches = solution.joint_wrenches
    deflections = np.zeros((len(conditions), 0))
    if conditions.laws:
        columns = contact_columns(conditions)
        w, times = wrenches @ columns, at_postures(which)
        platform, own, everywhere = responses_to(
            flexible, columns.tobytes(), columns.shape
        )
        deflections, settled = contact_deflections(conditions.laws, w, own[which])
        screws = screws + times(platform, deflections)
        # The wrenches of open chains depend only on the loads.
        if flexible.system.size:
            wrenches = wrenches + times(everywhere, deflections)
        solved = solved & settled
    if conditions.exact:
        screws, converged = solve_rows(conditions, deflections)
        solved = solved & converged
    return screws, wrenches, solved
