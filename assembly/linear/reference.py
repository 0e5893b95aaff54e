"""Problems (21) and (22) once more, written in cvxpy as the paper prints them.

Slow and simple on purpose: every screw of every frame is a variable, every constraint
an equation of the paper.  :mod:`assembly.linear.energy` and
:mod:`assembly.linear.zone` are tested against it; the two share the robot, the bounds
c-bar, the compliances and eqs (13)-(15), and nothing of how the problems are solved.

Two departures from the printed problems: screws are in mrad and mm, to which the
solver's absolute tolerances fit, and a rigid direction is a screw fixed at zero.
"""

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.model.clearance import (
    CONES,
    Compliant,
    clearance_bounds,
    scales_with_margin,
)
from assembly.model.links import joint_compliances, link_compliances

OPTIMAL = {"optimal", "optimal_inaccurate"}
_UNIT = 1e-3  # screws are in mrad and mm here


def reference_energy(
    posture: Posture, load: ArrayLike | None = None
) -> tuple[float, NDArray]:
    """Minimum assembly energy as printed, (22).

    Args:
        posture: where the robot stands.
        load: (6,) [N m, N] on the platform at its origin, base axes; energy minus its
            work is then minimised.

    Returns:
        [J] the energy stored, and (6,) [rad, m] the platform's pose error.

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
    constraints += _assembly_constraints(posture, x_p, errors + c + e + b)
    energies = []
    for screws, compliances in ((e, link_compliances), (b, joint_compliances)):
        for j, C in enumerate(compliances(posture.robot)):
            soft = np.flatnonzero(np.diag(C) > 0)
            hard = np.setdiff1d(np.arange(6), soft)
            if len(hard):
                constraints.append(screws[j, hard] == 0)
            if len(soft):
                K = np.linalg.inv(C[np.ix_(soft, soft)])
                root = np.linalg.cholesky(K).T * _UNIT
                energies.append(cp.sum_squares(root @ screws[j, soft]) / 2)
    work = 0 if load is None else np.asarray(load, dtype=float) @ x_p * _UNIT
    energy = sum(energies, start=cp.Constant(0.0))
    _solve(cp.Problem(cp.Minimize(energy - work), constraints), OPTIMAL)
    return float(energy.value), np.asarray(x_p.value) * _UNIT


def reference_margin(posture: Posture, compliant: Compliant = "rigid") -> float | None:
    """Margin of problem (21): the least factor on the clearances that assembles.

    Args:
        posture: where the robot stands.
        compliant: ``"rigid"`` as printed, or ``"free"``.

    Returns:
        The factor; None if no factor helps.
    """
    import cvxpy as cp

    count = len(posture.robot.frames)
    c = cp.Variable((count, 6))
    x_p, t = cp.Variable(6), cp.Variable(nonneg=True)
    bounds = clearance_bounds(posture.robot, compliant) / _UNIT
    factor = np.where(scales_with_margin(posture.robot), t, 1.0)
    constraints = _clearance_constraints(c, bounds, factor)
    errors = posture.robot.errors / _UNIT
    constraints += _assembly_constraints(posture, x_p, errors + c)
    problem = cp.Problem(cp.Minimize(t), constraints)
    _solve(problem, OPTIMAL | {"infeasible"})
    return None if problem.status == "infeasible" else float(t.value)


def _clearance_constraints(c: Any, bounds: NDArray, factor: NDArray) -> list:
    """Eqs (2)-(5); ``factor`` (n, 4) multiplies the bounds."""
    import cvxpy as cp

    constraints = []
    for j, row in enumerate(bounds):
        for k, rows in enumerate(CONES):
            part = cp.hstack([c[j, r] for r in rows])
            if row[k] == 0:
                constraints.append(part == 0)
            elif np.isfinite(row[k]):
                constraints.append(cp.norm(part) <= float(row[k]) * factor[j, k])
    return constraints


def _assembly_constraints(posture: Posture, x_p: Any, screws: Any) -> list:
    """Eqs (16)-(20): every chain's end, and the platform's pose error x_p."""
    robot = posture.robot

    def pose_error(name: str) -> Any:
        """Eq. (8): displacement of a frame by the screws along its path."""
        path = np.flatnonzero(robot.on_path[robot.index(name)])
        return sum(posture.paths[j] @ screws[j] for j in path)

    closures = [pose_error(a) == pose_error(b) for a, b in robot.closures]
    return [x_p == pose_error(robot.platform), *closures]


def _solve(problem: Any, allowed: set[str]) -> None:
    """Solve with tight tolerances; raise if the status is not allowed."""
    import cvxpy as cp

    tight = {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-11, "tol_feas": 1e-11}
    try:
        with warnings.catch_warnings():  # of inaccuracy: the status says it, too
            warnings.simplefilter("ignore")
            problem.solve(solver=cp.CLARABEL, **tight)
    except cp.error.SolverError as error:
        raise RuntimeError(f"cvxpy: {error}") from None
    if problem.status not in allowed:
        raise RuntimeError(f"cvxpy: the problem is {problem.status}")
