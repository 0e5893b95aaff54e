"""Problems (21) and (22) written in cvxpy as the paper prints them.

Every screw of every frame is a variable, and every constraint is an equation of the
paper.  Tests compare the results of :mod:`forcefit.assembly.linear.energy` and
:mod:`forcefit.assembly.linear.zone` with those of this module.  All three use the same
robot, bounds c-bar, compliances and eqs (13)-(15), but no common code for solving the
problems.

The implementation deviates from the paper in two details.  Screws are expressed in mrad
and mm, which suits the absolute tolerances of the solver.  Deformations in rigid
directions are fixed at zero.
"""

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.clearance import (
    CONES,
    clearance_bounds,
    scales_with_margin,
)
from forcefit.assembly.model.links import link_compliances, spring_compliances

OPTIMAL = {"optimal", "optimal_inaccurate"}
_UNIT = 1e-3  # screws in this module are in mrad and mm


def energy_as_printed(
    posture: Posture, load: ArrayLike | None = None
) -> tuple[float, NDArray]:
    """Return the minimum assembly energy as printed in (22).

    Args:
        posture: the robot's configuration.
        load: (6,) [N m, N] wrench on the platform at its origin, base axes; the energy
            minus the work of the load is then minimised.

    Returns:
        [J] the elastic energy, and (6,) [rad, m] the platform's pose error.

    Raises:
        RuntimeError: cvxpy found no optimum.
    """
    import cvxpy as cp

    count = len(posture.robot.frames)
    c, e, b = (cp.Variable((count, 6)) for _ in range(3))
    x_p = cp.Variable(6)
    bounds = clearance_bounds(posture.robot) / _UNIT
    constraints = _clearance_constraints(c, bounds, np.ones_like(bounds))
    errors = posture.robot.errors / _UNIT
    constraints += _assembly_constraints(posture, x_p, errors + e, c + b)
    energy: Any = cp.Constant(0.0)
    for screws, compliances in ((e, link_compliances), (b, spring_compliances)):
        C = np.array(compliances(posture.robot))
        hard = np.diagonal(C, axis1=1, axis2=2) <= 0
        constraints.append(screws[hard] == 0)
        roots = [_root_of_stiffness(one) for one in C]
        energy += cp.sum_squares(block_diag(*roots) @ cp.vec(screws, "C")) / 2
    work = 0 if load is None else np.asarray(load, dtype=float) @ x_p * _UNIT
    _solve(cp.Problem(cp.Minimize(energy - work), constraints), OPTIMAL)
    return float(energy.value), np.asarray(x_p.value) * _UNIT


def margin_as_printed(posture: Posture, own_axes_free: bool = False) -> float | None:
    """Return the smallest factor on the clearances for which (21) is feasible.

    Args:
        posture: the robot's configuration.
        own_axes_free: whether compliant joints rotate freely about their own axis.  In
            the printed problem, they are rigid.

    Returns:
        The factor; None if the problem is infeasible for every factor.
    """
    import cvxpy as cp

    count = len(posture.robot.frames)
    c = cp.Variable((count, 6))
    x_p, t = cp.Variable(6), cp.Variable(nonneg=True)
    bounds = clearance_bounds(posture.robot, own_axes_free) / _UNIT
    factor = np.where(scales_with_margin(posture.robot), t, 1.0)
    constraints = _clearance_constraints(c, bounds, factor)
    errors = posture.robot.errors / _UNIT
    constraints += _assembly_constraints(posture, x_p, errors, c)
    problem = cp.Problem(cp.Minimize(t), constraints)
    _solve(problem, OPTIMAL | {"infeasible"})
    return None if problem.status == "infeasible" else float(t.value)


def _root_of_stiffness(C: NDArray) -> NDArray:
    """Return a matrix R with stiffness = R^T R; rigid directions are omitted."""
    soft = np.flatnonzero(np.diag(C) > 0)
    root = np.zeros_like(C)
    root[np.ix_(soft, soft)] = np.linalg.cholesky(
        np.linalg.inv(C[np.ix_(soft, soft)])
    ).T
    return root * _UNIT


def _clearance_constraints(c: Any, bounds: NDArray, factor: NDArray) -> list:
    """Return the constraints (2)-(5), with all bounds multiplied by ``factor``."""
    import cvxpy as cp

    constraints = []
    for k, rows in enumerate(CONES):
        tight = np.flatnonzero(bounds[:, k] == 0)
        constraints += [c[tight, r] == 0 for r in rows if len(tight)]
        some = np.flatnonzero((bounds[:, k] > 0) & np.isfinite(bounds[:, k]))
        if len(some):
            most = cp.hstack([bounds[j, k] * factor[j, k] for j in some])
            parts = [c[some, r] for r in rows]
            if len(parts) == 1:
                constraints.append(cp.abs(parts[0]) <= most)
            else:
                constraints.append(cp.SOC(most, cp.vstack(parts), axis=0))
    return constraints


def _assembly_constraints(
    posture: Posture, x_p: Any, bodies: Any, joints: Any
) -> list:  # fmt: skip
    """Return eqs (16)-(20) for the ends of all chains and the platform's pose error.

    The arguments ``bodies`` and ``joints`` are screws (n, 6).
    """
    import cvxpy as cp

    robot = posture.robot
    leads = np.array([[frame.lead] for frame in robot.frames])
    along_threads = cp.multiply(leads, joints[:, 2:3]) @ np.eye(6)[5:]
    stacked = cp.vec(bodies + joints + along_threads, "C")

    def pose_error(name: str) -> Any:
        """Return the displacement of a frame due to the screws on its path, eq. (8)."""
        on_path = robot.on_path[robot.index(name)]
        return np.hstack(posture.paths * on_path[:, None, None]) @ stacked

    closures = [pose_error(a) == pose_error(b) for a, b in robot.closures]
    return [x_p == pose_error(robot.platform), *closures]


def _solve(problem: Any, allowed: set[str]) -> None:
    """Solve a problem with small tolerances; raise RuntimeError without an optimum."""
    import cvxpy as cp

    tight = {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}
    try:
        # The status reports inaccurate solutions, so the warning is redundant.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            problem.solve(solver=cp.CLARABEL, **tight)
    except cp.error.SolverError as error:
        raise RuntimeError(f"cvxpy: {error}") from None
    if problem.status not in allowed:
        raise RuntimeError(f"cvxpy: the problem is {problem.status}")
