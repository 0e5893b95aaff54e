r"""One step of the iteration to the exact equilibrium.

The step consists of these operations:

- Near a placement x, the loop-closure equations r(x) = 0 are linearised.  The
  Lagrangian L = |y|^2 / 2 - W(x) - lambda . r(x) is expanded to second order.  Its
  Hessian is exact, including the second derivatives of r.
- Springs and free motions are eliminated, and
  :mod:`forcefit.assembly.exact.contact_qp` solves the problem in the clearances.
- A correction of the springs and free motions closes the loops again.
- The step is accepted if it reduces the potential plus a penalty on the residual.
  Otherwise, it is repeated with more damping, as in the Levenberg-Marquardt method.

======  =============  =============  ===============================================
symbol  code           shape          meaning
======  =============  =============  ===============================================
A r     ``rows`` ..    (6 K, N)       scaled loop-closure residual and its derivative
lambda  multipliers    (6 K,)         scaled wrenches in the closures
H g     ``hessian`` .. (N, N), (N,)   second derivative of L, gradient of the energy
B       ``basis``      (N, nu + nv)   motions that keep all loops closed; nu of them
                                      change clearances, and nv do not
======  =============  =============  ===============================================

Sources:
    Nocedal, Wright (2006), Numerical Optimization, chapter 18 (sequential quadratic
    programming, exact penalties, second-order corrections).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, svd

from forcefit.assembly.exact.contact_qp import ClearanceProblem, clearance_step
from forcefit.assembly.exact.dead_load import (
    DeadLoads,
    curvature_of,
    largest_wrench,
    work_gradient,
    work_of,
)
from forcefit.assembly.exact.placement import Placement, place
from forcefit.assembly.kinematics.ranks import ROWS_RANK, rank_tolerance
from forcefit.assembly.solvers.cones import into_cones
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.solvers.method import Method
from forcefit.results.display import numbers

CLOSED = 1e-12  # [rad, reference lengths] largest loop-closure residual of a solution
LONGEST_STEP = 1.0  # [rad, reference lengths] maximum length of a step
_SMALL_RESIDUAL = 1e-9  # [rad, reference lengths] small loop-closure residual
_LEAST_DAMPING = 1e-9  # minimum damping, relative to the largest wrench
_FIRST_DAMPING = 1e-8  # damping after the first rejected step, relative to the wrench
_ATTEMPTS = 40  # maximum number of attempts
_RESTORATIONS = 4  # maximum number of corrections that close the loops after a step


class NotConverged(SolverFailed):
    """Raised if no exact equilibrium is found near the linear solution.

    Attributes:
        problem: name of the problem.
        status: description of the residuals.
    """

    def __init__(self, problem: str, status: str) -> None:
        RuntimeError.__init__(self, f"{problem}: {status}")
        self.problem, self.status = problem, status


@dataclass(frozen=True, eq=False)
class Expansion:
    """Second-order expansion of the problem at a placement.

    Attributes:
        placement: placement at which the problem is expanded.
        loads: loads on the robot.
        gradient: (N,) [J] gradient of energy minus work.
        hessian: (N, N) [J] second derivative of the Lagrangian.
        multipliers: (6 K,) multipliers of the loop-closure equations.
        unbounded: (N,) bool, True for springs and free motions.
        inverse: (nw, 6 K) pseudoinverse of the columns of A for springs and free
            motions.
        basis: (N, nu + nv) matrix B, see the module docstring.
        rigid_rows: (p, nu) loop-closure equations that contain only clearances.
        rigid_right: (p,) right-hand side of these equations.
        rigid_basis: (6 K, p) coefficients that form these equations from the rows of A.
    """

    placement: Placement
    loads: DeadLoads
    gradient: NDArray
    hessian: NDArray
    multipliers: NDArray
    unbounded: NDArray
    inverse: NDArray
    basis: NDArray
    rigid_rows: NDArray
    rigid_right: NDArray
    rigid_basis: NDArray

    @property
    def small_wrench(self) -> float:
        """Scaled wrench [N m] that a residual of 1e-9 causes in the stiffest spring."""
        model = self.placement.model
        softness = np.diag(model.metric)[model.springs]  # [rad^2/J]
        return _SMALL_RESIDUAL / float(softness.min(initial=1.0))

    @property
    def small_energy(self) -> float:
        """Energy [J] that a residual of 1e-9 causes in the stiffest spring."""
        return _SMALL_RESIDUAL * self.small_wrench / 2


@dataclass(frozen=True, eq=False)
class Step:
    """An accepted step.

    Attributes:
        placement: placement after the step.
        gain: [J] predicted decrease of the potential.
        decrement: [J] predicted decrease of the potential without the part that closes
            the loops.
        length: [rad, reference lengths] length of the step.
        rigid: (6 K,) multipliers of the equations that contain only clearances.
        damping: [J/rad^2] damping of the next step.
    """

    placement: Placement
    gain: float
    decrement: float
    length: float
    rigid: NDArray
    damping: float


def expand(at: Placement, loads: DeadLoads, rigid: NDArray) -> Expansion:
    """Return the second-order expansion of the problem at a placement.

    Args:
        at: placement at which the problem is expanded.
        loads: loads on the robot.
        rigid: (6 K,) estimated multipliers of the equations that contain only
            clearances.  All other multipliers are computed by least squares.

    Returns:
        The expansion.
    """
    model, A = at.model, at.rows
    unbounded = np.ones(len(at.x), dtype=bool)
    unbounded[model.bounded] = False
    gradient = -work_gradient(at, loads)
    gradient[model.springs] += at.x[model.springs]
    unit = model.units[unbounded]
    U, S, Vt = svd(A[:, unbounded] * unit, full_matrices=True)
    tolerance = rank_tolerance(model.posture.mismatch)
    rank = int(np.sum(S > tolerance * S.max(initial=0.0)))
    # V contains the right singular vectors, scaled by the units of the unknowns
    range_, rigid_space, V = U[:, :rank] / S[:rank], U[:, rank:], unit[:, None] * Vt.T
    inverse = V[:, :rank] @ range_.T
    multipliers = inverse.T @ gradient[unbounded]
    multipliers = multipliers + rigid_space @ (rigid_space.T @ rigid)
    rows, combination = _independent(rigid_space.T @ A[:, ~unbounded])
    hessian = -curvature_of(at, multipliers, loads)
    hessian[model.springs, model.springs] += np.eye(model.springs.stop)
    return Expansion(
        placement=at,
        loads=loads,
        gradient=gradient,
        hessian=hessian,
        multipliers=multipliers,
        unbounded=unbounded,
        inverse=inverse,
        basis=_basis(unbounded, inverse @ A[:, ~unbounded], V[:, rank:]),
        rigid_rows=rows,
        rigid_right=rows @ at.x[~unbounded]
        - combination.T @ (rigid_space.T @ at.residual),
        rigid_basis=rigid_space @ combination,
    )


def _basis(unbounded: NDArray, closing: NDArray, null_space: NDArray) -> NDArray:
    """Return the basis B of the module docstring, (N, nu + nv)."""
    nu = closing.shape[1]
    basis = np.zeros((len(unbounded), nu + null_space.shape[1]))
    basis[~unbounded, :nu] = np.eye(nu)
    basis[unbounded, :nu], basis[unbounded, nu:] = -closing, null_space
    return basis


def _independent(rows: NDArray) -> tuple[NDArray, NDArray]:
    """Return an orthogonal basis (p, nu) of the rows of a matrix, and coefficients.

    The coefficients (m, p) form the basis from the m rows.
    """
    if not rows.size:
        return np.zeros((0, rows.shape[1])), np.zeros((rows.shape[0], 0))
    U, S, _ = svd(rows, full_matrices=False)
    rank = int(np.sum(S > ROWS_RANK * S[0])) if S[0] > 1e-15 else 0
    return U[:, :rank].T @ rows, U[:, :rank]


def energy_of(at: Placement) -> float:
    """Return the elastic energy [J]."""
    y = at.x[at.model.springs]
    return float(y @ y) / 2


def potential(at: Placement, loads: DeadLoads) -> float:
    """Return the elastic energy minus the work of the loads [J]."""
    return energy_of(at) - work_of(at, loads)


def advance(
    local: Expansion, penalty: float, damping: float, near: bool,
    method: Method = "compiled",
) -> Step:  # fmt: skip
    """Return a step that reduces the potential plus the penalty.

    Args:
        local: expansion of the problem.
        penalty: [N m] factor on the norm of the scaled residual.
        damping: [J/rad^2] damping of the previous step.
        near: whether to try Newton's method for the clearances.
        method: method of :func:`forcefit.assembly.exact.contact_qp.clearance_step`.

    Returns:
        The step.

    Raises:
        NotConverged: no step reduces the potential plus the penalty.
    """
    start = local.placement
    penalised = penalty * float(np.linalg.norm(start.residual))
    least = float(np.abs(local.multipliers).max(initial=local.small_wrench))
    pull = largest_wrench(start, local.loads)
    least = max(least, pull)
    before = potential(start, local.loads) + penalised
    noise = 1e-13 * (abs(before) + abs(energy_of(start)))
    # add the round-off of rotations and positions, multiplied by the forces
    noise += 1e-14 * (penalty + pull)
    for attempt in range(_ATTEMPTS):
        # after a rejected Newton step, the conic solver is used once without damping
        newton = near and attempt != 1
        step = _solve(local, damping + _LEAST_DAMPING * least, newton, method)
        if step is not None and step.length <= LONGEST_STEP:
            after = potential(step.placement, local.loads)
            after += penalty * float(np.linalg.norm(step.placement.residual))
            expected = step.gain + penalised
            if before - after >= 1e-4 * expected - noise:
                good = before - after >= 0.5 * expected - noise
                damping = damping / 10 if good else damping
                damping = damping if damping > _LEAST_DAMPING * least else 0.0
                return Step(**vars(step) | {"damping": damping})
        if attempt or not near or step is None:
            damping = max(8.0 * damping, _FIRST_DAMPING * least)
    raise NotConverged(
        problem_name(start, local.loads),
        "no step decreases the energy, and the loop-closure residual is "
        f"{start.largest_gap:.2g} rad or m",
    )


def problem_name(at: Placement, loads: DeadLoads) -> str:
    """Return the name of the problem, for error messages."""
    under = f" under {numbers(loads.load)} N m, N" if loads.load.any() else ""
    return f"exact equilibrium of {at.model.posture.robot.name}{under}"


def _solve(local: Expansion, damping: float, near: bool, method: Method) -> Step | None:
    """Return the step to the minimum of the expansion, or None without a minimum."""
    at, model = local.placement, local.placement.model
    normal = np.zeros(len(at.x))
    normal[local.unbounded] = -local.inverse @ at.residual
    B, nu = local.basis, len(model.joints.group)
    H = local.hessian + damping * model.metric
    K, g = B.T @ H @ B, B.T @ (local.gradient + local.hessian @ normal)
    try:
        factor = cho_factor(K[nu:, nu:])
    except np.linalg.LinAlgError:
        return None
    relaxed = cho_solve(factor, np.column_stack([K[nu:, :nu], g[nu:]]))
    S = K[:nu, :nu] - K[:nu, nu:] @ relaxed[:, :nu]
    s = g[:nu] - K[:nu, nu:] @ relaxed[:, nu]
    problem = ClearanceProblem(
        S=(S + S.T) / 2,
        s=s,
        start=at.x[model.bounded],
        group=model.joints.group,
        rows=local.rigid_rows,
        right=local.rigid_right,
    )
    step = clearance_step(problem, near, method)
    if step is None:
        status = (
            "the loops cannot be closed by deformations of springs and by motions "
            "within the clearances"
        )
        raise NotConverged(problem_name(at, local.loads), status)
    u, rigid = step
    z = np.concatenate([u, -relaxed[:, nu] - relaxed[:, :nu] @ u])
    change = normal + B @ z
    return Step(
        placement=_restored(local, change),
        gain=-float(local.gradient @ change + change @ H @ change / 2),
        decrement=-float(g @ z + z @ K @ z / 2),
        length=float(np.sqrt(change @ model.metric @ change)),
        rigid=local.rigid_basis @ rigid,
        damping=damping,
    )


def _restored(local: Expansion, change: NDArray) -> Placement:
    """Return the placement after a step and a correction that closes the loops."""
    model = local.placement.model
    x = local.placement.x + change
    x[model.bounded] = into_cones(x[model.bounded], model.joints.group)
    after = place(model, x)
    for _ in range(_RESTORATIONS):
        if after.largest_gap <= 0.1 * CLOSED:
            break
        x = after.x.copy()
        x[local.unbounded] -= local.inverse @ after.residual
        better = place(model, x)
        if not better.largest_gap < after.largest_gap:
            break
        after = better
    return after
