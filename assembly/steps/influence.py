"""Influence of the order of joining steps (joins) on the assembled machine.

Join k can lock the present opening G_k x of its closure.  The set S of earlier joins
has changed this opening by A_kS lambda_S + B_k q, where

======  ======================  =====================================================
symbol  code                    meaning
======  ======================  =====================================================
A_kj    ``coefficients``        influence coefficient G_k K^-1 G_j^T of join j at k
B_k     ``free``                opening at k per unit of each free motion q
lambda                          wrenches of the earlier joins
======  ======================  =====================================================

K is the stiffness of the machine before the first of these joins.  If A_kj = 0 for all
other joins j, and if no free motion changes the openings at k and j together, the
opening at k does not depend on the order of the joins.  Free motions that change only
the opening at j, for example the rotation of its pin, are omitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from forcefit.assembly.steps.machine import Machine
from forcefit.assembly.steps.plan import Adjust, Fix, Join, Plan, Step, rows_of
from forcefit.assembly.steps.state import State

_ZERO = 1e-9  # [-] tolerance for zero influences, relative to the largest possible one
_FREE = 1e-11  # [-] tolerance for zero stiffnesses, relative to the largest


@dataclass(frozen=True, eq=False)
class Influence:
    """Influence of a join on the opening that another join locks.

    Attributes:
        locked: step that locks its present opening.
        joined: another joining step.
        coefficients: (p, r) [rad, m per N m, N] change of p locked components per unit
            of r components of the closing wrench.
        free: whether a free motion changes both openings.
        zero: whether ``joined`` never changes the opening, whatever the geometric
            errors.
    """

    locked: str
    joined: str
    coefficients: NDArray
    free: bool
    zero: bool


def why_order_matters(plan: Plan) -> str:
    """Return the steps whose result depends on the order of a plan.

    Args:
        plan: any plan.

    Returns:
        Names of the steps whose result depends on the state before, or an empty string.
    """
    steps = [step.name for step in plan.steps if depends_on_state(step)]
    return ", ".join(steps)


def depends_on_state(step: Step) -> bool:
    """Return whether the result of a step depends on the state before the step.

    Args:
        step: any step.

    Returns:
        True for joints and clamps that lock the present position, for force limits that
        leave an opening, and for adjustments.
    """
    if isinstance(step, Join):
        return isinstance(step.part, str) or bool(step.locked) or step.leave_open
    return isinstance(step, Adjust) or (isinstance(step, Fix) and not step.position)


def influences(machine: Machine, state: State, run: Sequence[Join]) -> list[Influence]:
    """Return the influence of all joins on the joins that lock an opening.

    Args:
        machine: the robot in array form.
        state: state before the first of the joins, without loose clearances.
        run: joins whose order may be changed.

    Returns:
        Influence for each pair of a join that locks an opening and another join.
    """
    rows = [_rows(machine, join) for join in run]
    bodies, free = _motions(machine, state)
    moved = [W @ free for W in rows]
    alone = [_moving_alone(moved, j) for j in range(len(run))]
    found = []
    for k, locked in enumerate(run):
        if not depends_on_state(locked):
            continue
        chosen = rows_of(locked.locked) if locked.locked else slice(None)
        at_k = rows[k][chosen] @ bodies
        shared = moved[k][chosen] @ (np.eye(len(alone[k])) - alone[k] @ alone[k].T)
        for j, joined in enumerate(run):
            if j == k:
                continue
            carried = _carried(moved[j] @ alone[j])
            at_j = carried @ rows[j] @ bodies
            small = _size(at_k @ at_j.T) <= _ZERO * _norm(at_k) * _norm(at_j)
            both = min(_size(shared), _size(carried @ moved[j])) > _ZERO
            units = _unit(machine, locked)[chosen], _unit(machine, joined)
            A = np.where(small, 0.0, at_k @ at_j.T) * np.outer(*units)
            zero = small and not both
            found.append(Influence(locked.name, joined.name, A, both, zero))
    return found


def _moving_alone(moved: list[NDArray], j: int) -> NDArray:
    """Return the free motions that change no opening except at join j, as columns."""
    others = np.vstack([np.zeros((1, moved[j].shape[1])), *moved[:j], *moved[j + 1 :]])
    return null_space(others, rcond=_ZERO) if others.size else np.zeros((0, 0))


def _carried(motions: NDArray) -> NDArray:
    """Return the projector on wrenches that do no work on given motions."""
    return np.eye(len(motions)) - motions @ np.linalg.pinv(motions, rcond=_ZERO)


def _norm(A: NDArray) -> float:
    """Return the largest row norm of a matrix."""
    return float(np.linalg.norm(A, axis=1).max(initial=0.0))


def _size(A: NDArray) -> float:
    """Return the largest absolute entry of a matrix."""
    return float(np.abs(A).max(initial=0.0))


def _unit(machine: Machine, join: Join) -> NDArray:
    """Return factors that convert the opening at a join from reference lengths to m."""
    if isinstance(join.part, str):
        frames = np.abs(machine.free).reshape(-1, 6, machine.free.shape[1]).any(axis=1)
        return machine.free_size[frames[machine.posture.robot.index(join.part)]]
    return 1 / machine.scale


def _rows(machine: Machine, join: Join) -> NDArray:
    """Return the derivative of an opening with respect to springs and free motions."""
    ny = machine.springs.shape[1]
    if isinstance(join.part, str):
        row = machine.posture.robot.index(join.part)
        own = np.abs(machine.free)[6 * row : 6 * row + 6].any(axis=0)
        motions = np.eye(len(own))[own]
        return np.hstack([np.zeros((len(motions), ny)), motions])
    rows = machine.rows(join.part)
    return np.hstack([rows @ machine.springs, rows @ machine.free])


def _motions(machine: Machine, state: State) -> tuple[NDArray, NDArray]:
    """Return the elastic motions and the free motions that satisfy all constraints.

    Returns:
        Elastic motions W, with K^-1 = W W^T, and free motions, as columns.
    """
    movable, _, motions = machine.movable((), tuple(state.bolted.values()), 1)
    holds = list(state.holds.values())
    ny, nq = machine.springs.shape[1], machine.free.shape[1]
    size = 1 / max(_size(machine.springs), 1e-300)  # scaling factor of the springs
    roots = [hold.roots for hold in holds]
    columns = np.hstack([machine.springs * size, machine.free[:, motions]])
    held = [hold.rows @ columns for hold in holds]
    nf = sum(root.shape[1] for root in roots)
    R = np.zeros((sum(map(len, held)), columns.shape[1] + nf))
    row, column = 0, columns.shape[1]
    for on, root in zip(held, roots, strict=True):
        R[row : row + len(on), : columns.shape[1]] = on
        R[row : row + len(on), column : column + root.shape[1]] = root * size
        row, column = row + len(on), column + root.shape[1]
    N = null_space(R, rcond=machine.tolerance) if len(R) else np.eye(R.shape[1])
    strains = np.vstack([N[:ny], N[columns.shape[1] :]])
    h, V = np.linalg.eigh(strains.T @ strains)
    x = np.zeros((ny + nq, N.shape[1]))
    x[:ny] = N[:ny] * size
    x[ny + np.flatnonzero(motions)] = N[ny : columns.shape[1]]
    loose = h <= _FREE
    return (x @ V[:, ~loose]) / (size * np.sqrt(h[~loose])), x @ V[:, loose]
