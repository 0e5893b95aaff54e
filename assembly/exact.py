r"""The forced assembly at least energy with finite motions: closures hold on SE(3).

Springs, clearance cones and geometric errors are those of the linear virtual-joint
model (:mod:`assembly.energy`); only the closures differ: motions follow one another as
in :mod:`assembly.finite`.  Minimised is the springs' energy minus the work of a dead
load,

    minimise  |y|^2 / 2 - w . x_p(y, u, q)
    subject to  r(y, u, q) = 0,   |u_k| <= 1 for each cone k.

Method: sequential conic programmes.  At each iterate closures are linearised anew and
the Lagrangian's true second derivative is taken: the closures' curvature times the
wrenches they carry outweighs soft springs, which is where Gauss-Newton stalls.  What
no cone bounds is eliminated, the cones' problem goes to :mod:`assembly.conic`, the
step is drawn back onto the closures, and accepted if it lowers energy plus a penalty
on what is still open; else the step is shortened by a proximal term (as Levenberg and
Marquardt do).

======  =================  =============  ===========================================
symbol  code               shape          meaning
======  =================  =============  ===========================================
w       (y, q) together    (ny + nq,)     unknowns without cones
N       ``still``          (ny + nq, nv)  what they can do without moving closures
nu      ``damping``        J/rad^2        proximal term
======  =================  =============  ===========================================

The problem is not convex: the answer is a local minimum, reached from the linear one.

Sources:
    Nocedal, Wright (2006), Numerical Optimization, chapter 18 (sequential quadratic
    programming, exact penalties, second-order corrections).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_factor, cho_solve, svd

from assembly.clearance import clearance_bounds, clearance_excess, has_bounded_motion
from assembly.closure import VirtualJoints, closure_signs, virtual_joints
from assembly.conic import SolverFailed, cone_sizes, minimise_energy
from assembly.energy import Assembly, solve_assembly
from assembly.finite import LINK, PLAY, SPRING, FiniteRobot, Placement
from assembly.posture import Posture
from stiffness.screws import screw_map

_STEPS = 80  # conic programmes at most; 5 to 10 are usual
_CLOSED = 1e-12  # [rad, reference lengths] what an answer may leave open
_NEAR = 1e-2  # relative energy left to gain where Newton's method is tried
_NEARLY_CLOSED = 1e-9  # the same, before the last step
_DECREMENT = 1e-14  # relative energy left to gain before the last step
_STATIONARY = 1e-7  # relative imbalance of an answer; 1e-10 is usual
_RANK = 1e-10  # relative size below which a singular value counts as zero
_LEAST_DAMPING = 1e-9  # of the largest closure wrench: holds what nothing else holds
_DAMPING = 1e-4  # the same, where damping starts once it is needed
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
class LinearisationError:
    """What the linear model gets wrong: linear minus exact.

    Attributes:
        rotation: (3,) [rad] of the platform.
        translation: (3,) [m] of its origin.
        energy: [J] absolute.
        relative_energy: [-] relative to the exact energy.
    """

    rotation: NDArray
    translation: NDArray
    energy: float
    relative_energy: float


@dataclass(frozen=True, eq=False)
class ExactAssembly:
    """A manipulator forced together with finite motions; exists only if converged.

    A local minimum: stationary, closed and within the cones as reported; that no
    other equilibrium has less energy is not proved.

    Attributes:
        linear: the linear model's answer from which this one was reached.
        placement: where everything is.
        load: (6,) [N m, N] on the platform at its origin, base axes.
        multipliers: (6 closures,) of the scaled closures.
        stationarity: [-] largest imbalance of any unknown, relative to what acts on it.
        iterations: conic programmes solved.
    """

    linear: Assembly
    placement: Placement
    load: NDArray
    multipliers: NDArray
    stationarity: float
    iterations: int

    @property
    def posture(self) -> Posture:
        """Where the robot stands nominally."""
        return self.placement.model.posture

    @property
    def energy(self) -> float:
        """[J] elastic energy stored."""
        y = self.placement.x[: len(self.placement.model.joints.links)]
        return float(y @ y) / 2

    @property
    def potential(self) -> float:
        """[J] energy minus the work of the load."""
        return self.energy - float(self.load @ self.platform_screw)

    @property
    def platform_screw(self) -> NDArray:
        """(6,) rotation vector of R R_nominal^T and shift of the origin, base axes."""
        return self.placement.platform_screw

    @property
    def transforms(self) -> NDArray:
        """(n, 4, 4) frames seen from the base, before their joint's coordinate."""
        return self.placement.transforms

    @property
    def link_screws(self) -> NDArray:
        """(n, 6) [rad, m] deformations of the bodies, logarithms."""
        return self.placement.screws[LINK]

    @property
    def joint_screws(self) -> NDArray:
        """(n, 6) [rad, m] deformations of the joints, logarithms."""
        return self.placement.screws[SPRING]

    @cached_property
    def clearance_screws(self) -> NDArray:
        """(n, 6) [rad, m] play, and what passive joints move, own row."""
        play = self.placement.screws[PLAY].copy()
        axes = [frame.own_axis for frame in self.posture.robot.frames]
        play[np.arange(len(axes)), axes] += self.placement.own
        return play

    @cached_property
    def closure_wrenches(self) -> NDArray:
        """(closures, 6) [N m, N] what each closure's second chain exerts on its first.

        At the platform's nominal origin, base axes.
        """
        return self.multipliers.reshape(-1, 6) * self.placement.model.scale

    @cached_property
    def wrenches(self) -> NDArray:
        """(n, 6) [N m, N] what the outer part exerts on the inner through each frame.

        At the frame where it is, after its small motions, in its axes there.
        """
        robot, T = self.posture.robot, self.transforms
        through = closure_signs(robot).T @ self.closure_wrenches
        loaded = robot.on_path[robot.index(robot.platform)]
        through = through + loaded[:, None] * self.placement.load_wrench(self.load)
        readings = screw_map(T[:, :3, 3] - self.posture.platform[:3, 3], T[:, :3, :3])
        return np.einsum("nji,nj->ni", readings, through)

    @cached_property
    def linearisation_error(self) -> LinearisationError:
        """Linear minus exact platform screw and energy."""
        screw = self.linear.platform_screw - self.platform_screw
        energy = self.linear.energy - self.energy
        # inside an assembly zone both are zero up to rounding
        scale = max(self.energy, 1e-6 * self.linear.energy_without_play, 1e-300)
        return LinearisationError(screw[:3], screw[3:], energy, energy / scale)

    def closure_residual(self) -> float:
        """Largest of abs(rad) and abs(m) / reference length left open in a closure."""
        return float(np.abs(self.placement.residual).max(initial=0.0))

    def clearance_excess(self) -> float:
        """[-] by how much the worst clearance leaves its cone, relative to its size."""
        bounds = clearance_bounds(self.posture.robot)
        return clearance_excess(self.clearance_screws, bounds)


def solve_exact(
    posture: Posture, load: ArrayLike | None = None, start: Assembly | None = None
) -> ExactAssembly:
    """Close a manipulator at least energy with finite motions, from the linear answer.

    Args:
        posture: where the robot stands; its errors, clearances, links and joint
            springs are the robot's.
        load: (6,) [N m, N] on the platform at its origin, base axes.  The force is
            dead; the moment's work is its product with the rotation vector.
        start: the linear answer for this posture and load, if it is there already.

    Returns:
        The assembled manipulator: closed, stationary, within its cones.

    Raises:
        CannotAssemble: the linear model has no answer to start from.
        FreeMotion: the load drives a motion that nothing resists.
        NotConverged: no equilibrium was found; a :class:`SolverFailed`.
    """
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    linear = solve_assembly(posture, wrench) if start is None else start
    answer = _search(linear.joints, linear, wrench)
    if answer.clearance_excess() > 1e-9 and has_bounded_motion(posture.robot):
        # the bound of a passive joint's own motion was left out, but it matters
        joints = virtual_joints(posture.robot, bounded_motion=True)
        answer = _search(joints, linear, wrench)
    return answer


def _search(joints: VirtualJoints, linear: Assembly, load: NDArray) -> ExactAssembly:
    """Sequential conic programmes from the linear answer."""
    model = FiniteRobot(linear.posture, joints)
    here = model.place(_begin(model, linear))
    whose = f"exact equilibrium of {model.posture.robot.name}"
    rigid = np.zeros(len(here.residual))
    penalty = damping = 0.0
    near = False
    for count in range(1, _STEPS + 1):
        local = _localise(here, load, rigid, near)
        penalty = max(penalty, 2.0 * float(np.linalg.norm(local.multipliers)))
        step, there, damping = _advance(local, penalty, damping, whose)
        scale = _energy_scale(there, linear, load)
        here, rigid, near = there, step.rigid, step.decrement <= _NEAR * scale
        small = abs(step.decrement) <= _DECREMENT * scale
        if small and _size(here) <= _CLOSED + linear.posture.mismatch:
            last = _localise(here, load, rigid)
            imbalance = _imbalance(last)
            if imbalance <= _STATIONARY:
                return ExactAssembly(
                    linear, here, load, last.multipliers, imbalance, count
                )
    imbalance = _imbalance(_localise(here, load, rigid))
    raise NotConverged(
        whose,
        f"after {_STEPS} programmes closures are open by {_size(here):.2g} and forces "
        f"out of balance by {imbalance:.2g}, relative",
    )


def _begin(model: FiniteRobot, linear: Assembly) -> NDArray:
    """(N,) the linear answer as a first guess, its play drawn into the cones."""
    cones = np.hstack([model.joints.cones, model.joints.free])
    sizes = np.sum(cones**2, axis=0)
    play = cones.T @ linear.clearance_screws.ravel() / sizes
    x = np.concatenate([linear.elastic, play])
    group = model.joints.group
    x[model.bounded] = _into_cones(x[model.bounded], group)
    return x


def _into_cones(u: NDArray, group: NDArray) -> NDArray:
    """Cones' vectors shortened to length 1 where they are longer."""
    return u / np.maximum(1.0, cone_sizes(u, group))[group]


def _size(place: Placement) -> float:
    """Largest component of the closures' residual."""
    return float(np.abs(place.residual).max(initial=0.0))


def _energy(place: Placement, load: NDArray) -> float:
    """[J] elastic energy minus the load's work."""
    y = place.x[: len(place.model.joints.links)]
    work = float(load @ place.platform_screw) if load.any() else 0.0
    return float(y @ y) / 2 - work


def _energy_scale(place: Placement, linear: Assembly, load: NDArray) -> float:
    """[J] size of the energies at play."""
    without = np.zeros(6)
    work = abs(_energy(place, load) - _energy(place, without))
    return max(_energy(place, without), work, 1e-3 * linear.energy_without_play, 1e-300)


@dataclass(frozen=True, eq=False)
class _Local:
    """The problem near a placement, closures and energy expanded there.

    Attributes:
        here: the placement.
        load: (6,) on the platform.
        gradient: (N,) [J] of energy minus work.
        hessian: (N, N) [J] of the Lagrangian.
        multipliers: (6 K,) of the closures.
        loose: (N,) bool, unknowns without cones.
        inverse: (nw, 6 K) how they close what is open, at least size.
        basis: (N, nu + nv) what moves no closure that springs and free motions reach.
        rigid_rows: (p, nu) closures that only clearances reach.
        rigid_right: (p,) their right side for the whole u.
        rigid_basis: (6 K, p) of the closures' rows.
        near: whether the answer is near enough for Newton's method.
    """

    here: Placement
    load: NDArray
    gradient: NDArray
    hessian: NDArray
    multipliers: NDArray
    loose: NDArray
    inverse: NDArray
    basis: NDArray
    rigid_rows: NDArray
    rigid_right: NDArray
    rigid_basis: NDArray
    near: bool


def _localise(
    here: Placement, load: NDArray, rigid: NDArray, near: bool = True
) -> _Local:
    """Expand closures to first and the Lagrangian to second order.

    The multipliers are those that balance springs and free motions best, plus
    ``rigid`` (6 K,) where only clearances act.
    """
    model, A = here.model, here.rows
    bounded = model.bounded
    loose = np.ones(len(here.x), dtype=bool)
    loose[bounded] = False
    gradient = -here.platform_rows.T @ load
    gradient[: len(model.joints.links)] += here.x[: len(model.joints.links)]
    unit = model.units[loose]
    U, S, Vt = svd(A[:, loose] * unit, full_matrices=True)
    tolerance = _RANK + 30.0 * model.posture.mismatch
    rank = int(np.sum(S > tolerance * S.max(initial=0.0)))
    pinv = (unit[:, None] * Vt[:rank].T / S[:rank]) @ U[:, :rank].T
    rest = U[:, rank:]
    balanced = (U[:, :rank] / S[:rank]) @ (Vt[:rank] @ (unit * gradient[loose]))
    multipliers = balanced + rest @ (rest.T @ rigid)
    rows, left = _independent(rest.T @ A[:, bounded])
    right = rows @ here.x[bounded] - left.T @ (rest.T @ here.residual)
    hessian = -here.curvature(multipliers, load)
    springs = np.arange(len(model.joints.links))
    hessian[springs, springs] += 1.0
    return _Local(
        here, load, gradient, hessian, multipliers, loose, pinv,
        _basis(loose, pinv, A, unit[:, None] * Vt[rank:].T), rows, right, rest @ left,
        near,
    )  # fmt: skip


def _basis(loose: NDArray, pinv: NDArray, A: NDArray, still: NDArray) -> NDArray:
    """(N, nu + nv) clearances with what makes room for them, then still motions."""
    nu, nv = int(np.sum(~loose)), still.shape[1]
    basis = np.zeros((len(loose), nu + nv))
    basis[~loose, :nu] = np.eye(nu)
    basis[loose, :nu] = -pinv @ A[:, ~loose]
    basis[loose, nu:] = still
    return basis


def _independent(rows: NDArray) -> tuple[NDArray, NDArray]:
    """Rows (m, nu) combined into independent ones (p, nu), and how (m, p)."""
    if not rows.size:
        return np.zeros((0, rows.shape[1])), np.zeros((rows.shape[0], 0))
    U, S, _ = svd(rows, full_matrices=False)
    rank = int(np.sum(S > 1e-9 * S[0])) if S[0] > 1e-15 else 0
    return U[:, :rank].T @ rows, U[:, :rank]


@dataclass(frozen=True, eq=False)
class _Step:
    """One answer of a local problem.

    Attributes:
        change: (N,) of the unknowns.
        gain: [J] by which the local model falls, what closing costs included.
        decrement: [J] the same once closed; never negative.
        rigid: (6 K,) multipliers of closures that only clearances reach.
    """

    change: NDArray
    gain: float
    decrement: float
    rigid: NDArray


def _advance(
    local: _Local, penalty: float, damping: float, whose: str
) -> tuple[_Step, Placement, float]:
    """A step that lowers energy plus penalty, where it leads, and the next damping."""
    start = local.here
    open_ = float(np.linalg.norm(start.residual))
    least = max(float(np.abs(local.multipliers).max(initial=0.0)), 1e-9)
    before = _energy(start, local.load) + penalty * open_
    noise = 1e-13 * (abs(before) + abs(_energy(start, np.zeros(6))))
    noise += 1e-14 * penalty
    for _ in range(40):
        step = _solve_local(local, damping + _LEAST_DAMPING * least, whose)
        if step is not None:
            there = _draw_back(local, step.change)
            after = _energy(there, local.load)
            after += penalty * float(np.linalg.norm(there.residual))
            expected = step.gain + penalty * open_
            if before - after >= 1e-4 * expected - noise:
                good = before - after >= 0.5 * expected - noise
                damping = damping / 10 if good else damping
                return step, there, damping if damping > 1e-8 * least else 0.0
        damping = max(4.0 * damping, _DAMPING * least)
    raise NotConverged(whose, f"no step lowers the energy; open by {_size(start):.2g}")


def _solve_local(local: _Local, damping: float, whose: str) -> _Step | None:
    """The local problem's answer; None where its energy has no minimum."""
    here, model = local.here, local.here.model
    normal = np.zeros(len(here.x))
    normal[local.loose] = -local.inverse @ here.residual
    B, nu = local.basis, len(model.joints.group)
    H = local.hessian + damping * model.metric
    K = B.T @ H @ B
    g = B.T @ (local.gradient + local.hessian @ normal)
    try:
        factor = cho_factor(K[nu:, nu:])
    except np.linalg.LinAlgError:
        return None
    relaxed = cho_solve(factor, np.column_stack([K[nu:, :nu], g[nu:]]))
    S = K[:nu, :nu] - K[:nu, nu:] @ relaxed[:, :nu]
    S = (S + S.T) / 2
    s = g[:nu] - K[:nu, nu:] @ relaxed[:, nu]
    u, rigid = _solve_cones(local, S, s, whose)
    v = -relaxed[:, nu] - relaxed[:, :nu] @ u
    z = np.concatenate([u, v])
    change = normal + B @ z
    gain = -float(local.gradient @ change + change @ (H @ change) / 2)
    decrement = -float(g @ z + z @ (K @ z) / 2)
    return _Step(change, gain, decrement, local.rigid_basis @ rigid)


def _solve_cones(
    local: _Local, S: NDArray, s: NDArray, whose: str
) -> tuple[NDArray, NDArray]:
    """Change of the clearances that is best within the cones, and rigid multipliers."""
    start, group = local.here.x[local.here.model.bounded], local.here.model.joints.group
    pressed = _pressed(start, s, group)[group]
    found = _newton_cones(local, S, s, pressed) if local.near else None
    if found is not None:
        return found
    curved = np.zeros(len(start))
    if len(start) and np.linalg.eigvalsh(S)[0] < 0.0:
        curved = 0.9 * pressed
    # curved (|u_k|^2 - 1) / 2 vanishes at the rim: it only makes S convex there
    found = _conic(local, S + np.diag(curved), s + curved * start, whose)
    u = start + found[0]
    if curved[(cone_sizes(u, group) < 0.999)[group]].any():
        found = _conic(local, S, s, whose)
    return found


def _conic(
    local: _Local, S: NDArray, s: NDArray, whose: str
) -> tuple[NDArray, NDArray]:
    """The same by the conic solver, directions of negative curvature turned round."""
    start, group = local.here.x[local.here.model.bounded], local.here.model.joints.group
    values, vectors = np.linalg.eigh(S)
    floor = 1e-10 * max(float(np.abs(values).max(initial=0.0)), 1e-150)
    G = np.sqrt(np.maximum(np.abs(values), floor))[:, None] * vectors.T
    least = minimise_energy(
        G, -G @ start, -s, local.rigid_rows, local.rigid_right, group
    )
    if not least.feasible:
        raise NotConverged(whose, "no play within its bounds closes what no spring can")
    return least.clearances - start, least.rigid_multipliers


def _pressed(u: NDArray, s: NDArray, group: NDArray) -> NDArray:
    """(cones,) [J] force on the rim of each cone, 0 inside, from the gradient s."""
    force = -np.bincount(group, weights=s * u)
    force[cone_sizes(u, group) < 1.0 - 1e-7] = 0.0
    return np.where(force > 1e-9 * np.abs(force).max(initial=0.0), force, 0.0)


def _newton_cones(
    local: _Local, S: NDArray, s: NDArray, pressed: NDArray
) -> tuple[NDArray, NDArray] | None:
    """The same by Newton's method, cones now pressed staying so; None if they do not.

    Exact where the conic solver is good to half of its digits, and of least size
    where play is left.
    """
    start, group = local.here.x[local.here.model.bounded], local.here.model.joints.group
    sizes = cone_sizes(start, group)
    rim = np.unique(group[pressed > 0.0])
    across = np.where(group[:, None] == rim, start[:, None], 0.0)
    C = np.hstack([across, local.rigid_rows.T])
    wanted = (1.0 - sizes[rim] ** 2) / 2
    wanted = np.concatenate([wanted, local.rigid_right - local.rigid_rows @ start])
    S = S + np.diag(pressed)
    Q, R = np.linalg.qr(C, mode="complete")
    count = C.shape[1]
    if count > len(start) or np.abs(np.diag(R)).min(initial=1.0) < 1e-9:
        return None
    change = Q[:, :count] @ np.linalg.solve(R[:count].T, wanted)
    Z = Q[:, count:]
    values, vectors = np.linalg.eigh(Z.T @ S @ Z)
    largest = np.abs(values).max(initial=1e-150)
    if values.min(initial=0.0) < -1e-9 * largest:
        return None
    Z, values = (
        (Z @ vectors)[:, values > 1e-10 * largest],
        values[values > 1e-10 * largest],
    )
    change = change - Z @ ((Z.T @ (s + S @ change)) / values)
    forces = np.linalg.solve(R[:count], Q[:, :count].T @ -(s + S @ change))
    there = cone_sizes(start + change, group)
    there[rim] -= np.bincount(group, weights=change**2)[rim] + 1e-12
    if cone_sizes(change, group)[rim].max(initial=0.0) > 0.1:
        return None  # a rim is round: not so far along its tangent
    if (there > 1.0).any() or (forces[: len(rim)] < 0.0).any():
        return None
    return change, -forces[len(rim) :]


def _draw_back(local: _Local, change: NDArray) -> Placement:
    """The placement after a step, drawn onto the closures."""
    model = local.here.model
    x = local.here.x + change
    x[model.bounded] = _into_cones(x[model.bounded], model.joints.group)
    there = model.place(x)
    for _ in range(_DRAWN_BACK):
        if _size(there) <= 0.1 * _CLOSED:
            break
        x = there.x.copy()
        x[local.loose] -= local.inverse @ there.residual
        better = model.place(x)
        if not _size(better) < _size(there):
            break
        there = better
    return there


def _imbalance(local: _Local) -> float:
    """Largest force on an unknown that nothing balances, relative to those on it."""
    here, A = local.here, local.here.rows
    left = local.gradient - A.T @ local.multipliers
    acting = np.linalg.norm(A, axis=0) * np.linalg.norm(local.multipliers)
    acting += np.abs(local.gradient)
    bounded = here.model.bounded
    u, group = here.x[bounded], here.model.joints.group
    if len(group):
        # within a cone nothing pulls; at its rim the pull is outward
        push = -left[bounded]
        outward = np.bincount(group, weights=push * u)
        rim = cone_sizes(u, group) >= 1.0 - 1e-6
        held = np.where(rim, np.maximum(outward, 0.0), 0.0)
        left[bounded] = push - held[group] * u
    scale = np.maximum(acting, 1e-300)
    return float(np.max(np.abs(left) / scale, initial=0.0))
