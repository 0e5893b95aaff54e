r"""One step towards the exact equilibrium: expand, solve, restore, accept or damp.

Near a placement x, the closures are linearised.  The Lagrangian

    L = |y|^2 / 2 - W(x) - lambda . r(x)

is expanded to second order with its exact Hessian.  The Hessian contains the curvature
of the closures, multiplied by their wrenches.  This term can exceed the stiffness of
compliant springs, in which case Gauss-Newton steps, which omit it, make no progress.
Springs and free motions are eliminated, and :mod:`forcefit.assembly.exact.contact_qp`
solves the problem in the clearances.  A restoration (retraction) moves the result back
onto the closures.  The step is accepted if it reduces the energy plus a penalty on the
residual.  Otherwise the next attempt is damped by a proximal term, as in the
Levenberg-Marquardt method, which measures every screw in radians and reference lengths.

======  =============  =============  ===============================================
symbol  code           shape          meaning
======  =============  =============  ===============================================
A r     ``rows`` ..    (6 K, N)       closures' derivative and residual, scaled
lambda  multipliers    (6 K,)         wrenches of the closures, scaled
H g     ``hessian`` .. (N, N), (N,)   second derivative of L, gradient of the energy
B       ``basis``      (N, nu + nv)   clearances with the motions required by closures,
                                      and motions that change no closure
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

CLOSED = 1e-12  # [rad, reference lengths] largest residual of a solution
LONGEST_STEP = 1.0  # [rad, reference lengths] largest change in a step
# [rad, reference lengths] residual that defines a small wrench
_SMALL_RESIDUAL = 1e-9
_LEAST_DAMPING = 1e-9  # smallest damping, relative to the largest closure wrench
# damping after the first rejected step, relative to the largest closure wrench
_FIRST_DAMPING = 1e-8
_ATTEMPTS = 40  # largest number of attempts; each multiplies the damping by eight
_RESTORATIONS = 4  # number of corrections that move a step back onto the closures


class NotConverged(SolverFailed):
    """Raised if no finite-motion equilibrium is found near the linear solution.

    Attributes:
        problem: name of the problem.
        status: description of the remaining residual and imbalance.
    """

    def __init__(self, problem: str, status: str) -> None:
        RuntimeError.__init__(self, f"{problem}: {status}")
        self.problem, self.status = problem, status


@dataclass(frozen=True, eq=False)
class Expansion:
    """Problem expanded at a placement.

    Attributes:
        placement: placement at which the problem is expanded.
        loads: loads on the robot.
        gradient: (N,) [J] gradient of energy minus work.
        hessian: (N, N) [J] second derivative of the Lagrangian.
        multipliers: (6 K,) multipliers of the closures.
        unbounded: (N,) bool, True for unknowns without cones.
        inverse: (nw, 6 K) pseudoinverse of the closure columns of these unknowns.
        basis: (N, nu + nv) matrix B, see the module docstring.
        rigid_rows: (p, nu) closure rows without springs and free motions.
        rigid_right: (p,) right side of these rows.
        rigid_basis: (6 K, p) combinations of the closure rows that form these rows.
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
        """[N m] scaled wrench in the stiffest spring due to a residual of 1e-9."""
        model = self.placement.model
        softness = np.diag(model.metric)[model.springs]  # [rad^2/J]
        return _SMALL_RESIDUAL / float(softness.min(initial=1.0))

    @property
    def small_energy(self) -> float:
        """[J] energy caused by a residual of 1e-9."""
        return _SMALL_RESIDUAL * self.small_wrench / 2


@dataclass(frozen=True, eq=False)
class Step:
    """An accepted step.

    Attributes:
        placement: placement after the step.
        gain: [J] predicted decrease of the potential, including the cost of restoring
            the closures.
        decrement: [J] predicted decrease of the potential without that cost.
        length: [rad, reference lengths] size of the change.
        rigid: (6 K,) multipliers of the closure rows that only clearances can close.
        damping: [J/rad^2] damping of the next step; 0 if this step was not damped.
    """

    placement: Placement
    gain: float
    decrement: float
    length: float
    rigid: NDArray
    damping: float


def expand(at: Placement, loads: DeadLoads, rigid: NDArray) -> Expansion:
    """Expand the closures to first order and the Lagrangian to second order.

    Args:
        at: placement at which the problem is expanded.
        loads: loads on the robot.
        rigid: (6 K,) estimate of the multipliers of closures that depend only on
            clearances.  The remaining multipliers follow from the equilibrium of
            springs and free motions by least squares.

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
    # from the singular value decomposition: left vectors of the range, divided by their
    # singular values; left vectors of the complement; right vectors in the units of the
    # unknowns
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
    """Return the (N, nu + nv) basis B of an expansion, see the module's docstring."""
    nu = closing.shape[1]
    basis = np.zeros((len(unbounded), nu + null_space.shape[1]))
    basis[~unbounded, :nu] = np.eye(nu)
    basis[unbounded, :nu], basis[unbounded, nu:] = -closing, null_space
    return basis


def _independent(rows: NDArray) -> tuple[NDArray, NDArray]:
    """Return p independent rows with the span of (m, nu) rows, and the map (m, p)."""
    if not rows.size:
        return np.zeros((0, rows.shape[1])), np.zeros((rows.shape[0], 0))
    U, S, _ = svd(rows, full_matrices=False)
    rank = int(np.sum(S > ROWS_RANK * S[0])) if S[0] > 1e-15 else 0
    return U[:, :rank].T @ rows, U[:, :rank]


def energy_of(at: Placement) -> float:
    """Return the [J] elastic energy."""
    y = at.x[at.model.springs]
    return float(y @ y) / 2


def potential(at: Placement, loads: DeadLoads) -> float:
    """Return the [J] elastic energy minus the work of the loads."""
    return energy_of(at) - work_of(at, loads)


def advance(
    local: Expansion, penalty: float, damping: float, near: bool,
    method: Method = "compiled",
) -> Step:  # fmt: skip
    """Return a step that reduces the potential plus the penalty.

    Args:
        local: the expanded problem.
        penalty: [N m] factor on the norm of the scaled residual, above the multipliers.
        damping: [J/rad^2] damping of the last step.
        near: whether to try Newton's method for the clearances.
        method: method of :func:`forcefit.assembly.exact.contact_qp.clearance_step`.

    Returns:
        The step.

    Raises:
        NotConverged: no step, however short, reduces potential plus penalty.
    """
    start = local.placement
    penalised = penalty * float(np.linalg.norm(start.residual))
    least = float(np.abs(local.multipliers).max(initial=local.small_wrench))
    pull = largest_wrench(start, local.loads)
    least = max(least, pull)
    before = potential(start, local.loads) + penalised
    noise = 1e-13 * (abs(before) + abs(energy_of(start)))
    # round-off in angles and positions, multiplied by the forces that act on them
    noise += 1e-14 * (penalty + pull)
    for attempt in range(_ATTEMPTS):
        # a rejected Newton step is repeated by the conic solver before it is damped
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
        "no step decreases the energy; the closures are open by "
        f"{start.largest_gap:.2g} rad or m",
    )


def problem_name(at: Placement, loads: DeadLoads) -> str:
    """Return the name of the problem, for error messages."""
    under = f" under {numbers(loads.load)} N m, N" if loads.load.any() else ""
    return f"exact equilibrium of {at.model.posture.robot.name}{under}"


def _solve(local: Expansion, damping: float, near: bool, method: Method) -> Step | None:
    """Return the step to the minimum of the expansion; None if no minimum exists."""
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
            "the closures stay open: neither a spring nor a clearance within "
            "its bounds can close them"
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
    """Return the placement after a step, moved back onto the closures."""
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
