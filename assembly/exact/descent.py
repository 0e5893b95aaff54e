r"""One step towards the exact equilibrium: expand, solve, draw back, accept or damp.

Near a placement x the closures are linearised and the Lagrangian

    L = |y|^2 / 2 - W(x) - lambda . r(x)

is expanded to second order, with its true Hessian: the closures' curvature times the
wrenches they carry outweighs soft springs, which is where Gauss-Newton stalls.  Springs
and free motions are eliminated, the clearances' problem goes to
:mod:`assembly.exact.contact_qp`, the step is drawn back onto the closures, and it is
accepted if it lowers energy plus a penalty on what is still open.  Otherwise a proximal
term damps it, as Levenberg and Marquardt do, measured in radians and reference lengths
of every screw.

======  =============  =============  ===============================================
symbol  code           shape          meaning
======  =============  =============  ===============================================
A r     ``rows`` ..    (6 K, N)       closures' derivative and misfit, scaled
lambda  multipliers    (6 K,)         wrenches of the closures, scaled
H g     ``hessian`` .. (N, N), (N,)   second derivative of L, gradient of the energy
B       ``basis``      (N, nu + nv)   clearances and what makes room for them, and
                                      motions that leave every closure alone
======  =============  =============  ===============================================

Sources:
    Nocedal, Wright (2006), Numerical Optimization, chapter 18 (sequential quadratic
    programming, exact penalties, second-order corrections).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, eigh, svd

from assembly.exact.contact_qp import (
    AT_RIM,
    PlayProblem,
    across_rims,
    move_play,
    rim_forces,
)
from assembly.exact.dead_load import (
    DeadLoads,
    curvature_of,
    largest_wrench,
    size_of_pull,
    slopes_of,
    work_of,
)
from assembly.exact.placement import Placement
from assembly.solvers.conic import SolverFailed, cone_sizes, into_cones

CLOSED = 1e-12  # [rad, reference lengths] what an answer may leave open
LONGEST = 1.0  # [rad, reference lengths] of a step
_MISFIT = 1e-9  # [rad, reference lengths] whose forces count as none
_ROUNDED = 1e-5  # of that misfit, which is rounding of an angle
_RANK = 1e-10  # relative size below which a singular value counts as zero
_LEAST_DAMPING = 1e-9  # of the largest closure wrench: holds what nothing else holds
_DAMPING = 1e-8  # the same, where damping starts once it is needed
_ATTEMPTS = 40  # at a step, each damped eight times as much
_DRAWN_BACK = 4  # corrections of a step onto the closures


class NotConverged(SolverFailed):
    """No equilibrium with finite motions was found near the linear one.

    Attributes:
        problem: which one.
        status: how far it came.
    """

    def __init__(self, problem: str, status: str) -> None:
        RuntimeError.__init__(self, f"{problem}: {status}")
        self.problem, self.status = problem, status


@dataclass(frozen=True, eq=False)
class Expansion:
    """The problem near a placement.

    Attributes:
        here: the placement.
        loads: on the robot.
        gradient: (N,) [J] of energy minus work.
        hessian: (N, N) [J] of the Lagrangian.
        multipliers: (6 K,) of the closures.
        loose: (N,) bool, unknowns without cones.
        inverse: (nw, 6 K) how these close what is open, at least size.
        basis: (N, nu + nv), see the head of this module.
        rigid_rows: (p, nu) closures that only clearances reach.
        rigid_right: (p,) their right side.
        rigid_basis: (6 K, p) how they are combined of the closures' rows.
    """

    here: Placement
    loads: DeadLoads
    gradient: NDArray
    hessian: NDArray
    multipliers: NDArray
    loose: NDArray
    inverse: NDArray
    basis: NDArray
    rigid_rows: NDArray
    rigid_right: NDArray
    rigid_basis: NDArray

    @property
    def small_wrench(self) -> float:
        """[N m] scaled wrench of a misfit of 1e-9 in the stiffest spring."""
        model = self.here.model
        softness = np.diag(model.metric)[model.springs]  # [rad^2/J]
        return _MISFIT / float(softness.min(initial=1.0))

    @property
    def small_energy(self) -> float:
        """[J] energy of a misfit of 1e-9."""
        return _MISFIT * self.small_wrench / 2


@dataclass(frozen=True, eq=False)
class Step:
    """An accepted step.

    Attributes:
        there: where it leads.
        gain: [J] by which the expansion falls, what closing costs included.
        decrement: [J] the same once closed: what the energy had left to gain.
        length: [rad, reference lengths] of the change.
        rigid: (6 K,) multipliers of closures that only clearances reach.
        damping: [J/rad^2] for the next step; 0 if this one was not damped.
    """

    there: Placement
    gain: float
    decrement: float
    length: float
    rigid: NDArray
    damping: float


def expand(here: Placement, loads: DeadLoads, rigid: NDArray) -> Expansion:
    """Closures to first and the Lagrangian to second order.

    Args:
        here: a placement.
        loads: on the robot.
        rigid: (6 K,) guess of the multipliers of closures that only clearances reach;
            the others are those that balance springs and free motions best.

    Returns:
        The expansion.
    """
    model, A = here.model, here.rows
    loose = np.ones(len(here.x), dtype=bool)
    loose[model.bounded] = False
    gradient = -slopes_of(here, loads)
    gradient[model.springs] += here.x[model.springs]
    unit = model.units[loose]
    U, S, Vt = svd(A[:, loose] * unit, full_matrices=True)
    rank = int(np.sum(S > _tolerance(here) * S.max(initial=0.0)))
    grip, rest, still = U[:, :rank] / S[:rank], U[:, rank:], unit[:, None] * Vt.T
    inverse = still[:, :rank] @ grip.T
    multipliers = inverse.T @ gradient[loose] + rest @ (rest.T @ rigid)
    rows, left = _independent(rest.T @ A[:, ~loose])
    hessian = -curvature_of(here, multipliers, loads)
    hessian[model.springs, model.springs] += np.eye(model.springs.stop)
    return Expansion(
        here, loads, gradient, hessian, multipliers, loose, inverse,
        _basis(loose, inverse @ A[:, ~loose], still[:, rank:]),
        rows, rows @ here.x[~loose] - left.T @ (rest.T @ here.residual), rest @ left,
    )  # fmt: skip


def _tolerance(here: Placement) -> float:
    """Relative size of a singular value that counts as zero."""
    return _RANK + 30.0 * here.model.posture.mismatch


def _basis(loose: NDArray, room: NDArray, still: NDArray) -> NDArray:
    """(N, nu + nv) of an expansion."""
    nu = room.shape[1]
    basis = np.zeros((len(loose), nu + still.shape[1]))
    basis[~loose, :nu] = np.eye(nu)
    basis[loose, :nu], basis[loose, nu:] = -room, still
    return basis


def _independent(rows: NDArray) -> tuple[NDArray, NDArray]:
    """Rows (m, nu) combined into independent ones (p, nu), and how (m, p)."""
    if not rows.size:
        return np.zeros((0, rows.shape[1])), np.zeros((rows.shape[0], 0))
    U, S, _ = svd(rows, full_matrices=False)
    rank = int(np.sum(S > 1e-9 * S[0])) if S[0] > 1e-15 else 0
    return U[:, :rank].T @ rows, U[:, :rank]


def energy_of(place: Placement) -> float:
    """[J] elastic energy."""
    y = place.x[place.model.springs]
    return float(y @ y) / 2


def potential(place: Placement, loads: DeadLoads) -> float:
    """[J] elastic energy minus the loads' work."""
    return energy_of(place) - work_of(place, loads)


def advance(local: Expansion, penalty: float, damping: float, near: bool) -> Step:
    """A step that lowers energy plus penalty.

    Args:
        local: the problem here.
        penalty: [N m] on the norm of the scaled misfit, above that of the multipliers.
        damping: [J/rad^2] of the last step.
        near: whether Newton's method is tried for the clearances.

    Returns:
        The step.

    Raises:
        NotConverged: there is none, however short.
    """
    start = local.here
    left_open = penalty * float(np.linalg.norm(start.residual))
    least = float(np.abs(local.multipliers).max(initial=local.small_wrench))
    least = max(least, largest_wrench(start, local.loads))
    before = potential(start, local.loads) + left_open
    noise = 1e-13 * (abs(before) + abs(energy_of(start)))
    noise += 1e-14 * penalty
    for attempt in range(_ATTEMPTS):
        # refused, Newton's step is followed by the conic one before either is damped
        newton = near and attempt != 1
        step = _solve(local, damping + _LEAST_DAMPING * least, newton)
        if step is not None and step.length <= LONGEST:
            after = potential(step.there, local.loads)
            after += penalty * float(np.linalg.norm(step.there.residual))
            expected = step.gain + left_open
            if before - after >= 1e-4 * expected - noise:
                good = before - after >= 0.5 * expected - noise
                damping = damping / 10 if good else damping
                damping = damping if damping > _LEAST_DAMPING * least else 0.0
                return Step(**vars(step) | {"damping": damping})
        if attempt or not near or step is None:
            damping = max(8.0 * damping, _DAMPING * least)
    raise NotConverged(
        whose(start), f"no step lowers the energy; open by {start.largest_gap:.2g}"
    )


def whose(here: Placement) -> str:
    """Which problem it is, for messages."""
    return f"exact equilibrium of {here.model.posture.robot.name}"


def _solve(local: Expansion, damping: float, near: bool) -> Step | None:
    """The expansion's minimum; None where it has none."""
    here, model = local.here, local.here.model
    normal = np.zeros(len(here.x))
    normal[local.loose] = -local.inverse @ here.residual
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
    play = PlayProblem(
        (S + S.T) / 2, s, here.x[model.bounded], model.joints.group,
        local.rigid_rows, local.rigid_right,
    )  # fmt: skip
    found = move_play(play, near)
    if found is None:
        status = "no play within its bounds closes what no spring can"
        raise NotConverged(whose(here), status)
    u, rigid = found
    z = np.concatenate([u, -relaxed[:, nu] - relaxed[:, :nu] @ u])
    change = normal + B @ z
    return Step(
        there=_draw_back(local, change),
        gain=-float(local.gradient @ change + change @ H @ change / 2),
        decrement=-float(g @ z + z @ K @ z / 2),
        length=float(np.sqrt(change @ model.metric @ change)),
        rigid=local.rigid_basis @ rigid,
        damping=damping,
    )


def _draw_back(local: Expansion, change: NDArray) -> Placement:
    """The placement after a step, drawn onto the closures."""
    model = local.here.model
    x = local.here.x + change
    x[model.bounded] = into_cones(x[model.bounded], model.joints.group)
    there = model.place(x)
    for _ in range(_DRAWN_BACK):
        if there.largest_gap <= 0.1 * CLOSED:
            break
        x = there.x.copy()
        x[local.loose] -= local.inverse @ there.residual
        better = model.place(x)
        if not better.largest_gap < there.largest_gap:
            break
        there = better
    return there


def imbalance(local: Expansion) -> float:
    """How far a placement is from equilibrium.

    Args:
        local: the expansion there.

    Returns:
        [-] largest generalised force on an unknown that nothing balances, relative to
        the sizes of those that act on it, or to those of a misfit of 1e-9.
    """
    here, A, model = local.here, local.here.rows, local.here.model
    left = local.gradient - A.T @ local.multipliers
    wrench = float(np.linalg.norm(local.multipliers)) + local.small_wrench
    pull = size_of_pull(here, local.loads)
    acting = np.linalg.norm(A, axis=0) * wrench + np.abs(local.gradient) + pull
    # within a cone nothing pulls; at its rim the pull is straight outward
    u, group = here.x[model.bounded], model.joints.group
    force = rim_forces(u, left[model.bounded], group)
    left[model.bounded] += force[group] * u
    short = np.zeros(len(left))
    short[model.bounded] = (force * (1.0 - cone_sizes(u, group)))[group]
    left = np.maximum(np.abs(left), np.abs(short))
    return float(np.max(left / np.maximum(acting, 1e-30), initial=0.0))


def least_curvature(local: Expansion) -> float:
    """Whether an equilibrium is stable.

    Args:
        local: the expansion there.

    Returns:
        [J/rad^2] least second derivative of the potential along the motions that keep
        closures, and the rims pressed on, per squared rad and reference length of all
        screws together; positive at a strict minimum, inf if nothing can move.
    """
    D, H = tangent_space(local)
    if not D.shape[1]:
        return np.inf
    metric = D.T @ local.here.model.metric @ D
    return float(eigh(H, metric, eigvals_only=True)[0])


def tangent_space(
    local: Expansion, hold_touching: bool = False
) -> tuple[NDArray, NDArray]:
    """Motions near an equilibrium that keep closures, and the rims pressed on.

    Args:
        local: the expansion there.
        hold_touching: whether clearances at their rim that carry no force keep it too.

    Returns:
        (N, k) a basis of them, and (k, k) [J] the potential's second derivative there.
    """
    model, nu = local.here.model, len(local.here.model.joints.group)
    u, group = local.here.x[model.bounded], model.joints.group
    rim, force = pressed_rims(local)
    if hold_touching:
        rim = rim | (cone_sizes(u, group) >= 1.0 - AT_RIM)
    B = local.basis
    C = np.hstack([across_rims(u, rim, group), local.rigid_rows.T])
    C = np.vstack([C, np.zeros((B.shape[1] - nu, C.shape[1]))])
    D = B @ np.linalg.qr(C, mode="complete")[0][:, np.linalg.matrix_rank(C) :]
    H = local.hessian.copy()
    H[~local.loose, ~local.loose] += force[group]
    return D, D.T @ H @ D


def pressed_rims(local: Expansion) -> tuple[NDArray, NDArray]:
    """Clearances that carry a force at an equilibrium.

    Args:
        local: the expansion there.

    Returns:
        (cones,) bool, and (cones,) [J] the force on each bound times the bound.
    """
    model = local.here.model
    u, group = local.here.x[model.bounded], model.joints.group
    left = local.gradient - local.here.rows.T @ local.multipliers
    force = rim_forces(u, left[model.bounded], group)
    bound = np.sqrt(np.bincount(group, weights=np.diag(model.metric)[model.bounded]))
    rounding = _ROUNDED * local.small_wrench * bound
    return force > np.maximum(1e-9 * force.max(initial=0.0), rounding), force
