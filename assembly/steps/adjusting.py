"""Adjustments: changes of a geometric error that minimise a measured value.

====================== =============================================================
problem                method
====================== =============================================================
no loose clearance     The measured value is linear in the change.  Linear least
                       squares are used.
closure, no loads      The energy is convex in the change and the motions within
                       clearances.  One equilibrium is computed.
frame, or loads        The measured value is piecewise linear in the change.  The
                       Gauss-Newton method finds local minima from two initial
                       guesses, and the smaller minimum is used.
====================== =============================================================
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.ranks import RANK
from forcefit.assembly.steps.machine import Machine
from forcefit.assembly.steps.plan import Adjust, rows_of
from forcefit.assembly.steps.state import (
    State,
    closed_rows,
    reading_of,
    settle,
    with_hold,
)
from forcefit.inputs.table import BadInput, quoted

_MOST_STEPS, _HALVINGS = 30, 12  # maximum number of steps, and of halvings of a step
_STEP = 1e-7  # [rad, reference lengths] step of the finite differences
_FLAT = 1e-6  # [-] tolerance for zero derivatives, relative to the largest
_SETTLED = 1e-7  # [-] convergence tolerance on the relative change of the value


def with_adjustment(
    machine: Machine, state: State, step: Adjust, amount: NDArray
) -> State:
    """Return a state with a changed geometric error.

    Its equilibrium is not computed.
    """
    first = 6 * machine.posture.robot.index(step.frame)
    errors = state.errors.copy()
    errors[:, first + rows_of(step.components)] += amount
    return replace(state, errors=errors)


def adjustment_of(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the change of a geometric error that minimises a measured value.

    Args:
        machine: the robot in array form.
        state: state before the step.
        step: the adjustment.

    Returns:
        (k, a) [rad or m] changes of the a adjusted components of the error.

    Raises:
        BadInput: the joint of the frame is bolted, and other clearances are loose.
    """
    if step.amount is not None:
        return np.broadcast_to(step.amount, (len(state.errors), len(step.components)))
    if state.is_linear(machine):
        amount = _linear_adjustment(machine, state, step)
    elif state.loads or isinstance(step.reading.part, str):
        amount = _best_local_adjustment(machine, state, step)
    else:
        _check_not_bolted(machine, state, step)
        amount = _closing_adjustment(machine, state, step)
    if step.increment:
        amount = step.increment * np.round(amount / step.increment)
    return amount


def _linear_adjustment(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the best adjustment if no clearance is loose."""
    count = len(step.components)
    value = _to_vanish(machine, state, step)
    slopes = np.empty((value.shape[1], count))
    for i in range(count):
        unit = np.zeros((len(value), count))
        unit[:, i] = 1.0
        moved = settle(machine, with_adjustment(machine, state, step, unit))
        slopes[:, i] = (_to_vanish(machine, moved, step) - value)[0]
    # minimum-norm solution, with lengths in reference lengths
    unit = 1 / machine.scale[rows_of(step.components)]
    return -value @ np.linalg.pinv(slopes * unit).T * unit


def _best_local_adjustment(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the better of two local minima, found from different initial guesses."""
    none = np.zeros((len(state.errors), len(step.components)))
    amount, size = _local_adjustment(machine, state, step, none)
    pressed = _linear_adjustment(*_with_pressed_clearances(machine, state), step)
    other, other_size = _local_adjustment(machine, state, step, pressed)
    better = other_size < size * (1 - _SETTLED)
    return np.where(better[:, None], other, amount)


def _with_pressed_clearances(machine: Machine, state: State) -> tuple[Machine, State]:
    """Return a machine whose joints are fixed at their positions within clearances."""
    moved, joints = state.found.clearances @ machine.cones.T, machine.joints
    fixed = replace(joints, cones=joints.cones[:, :0], group=joints.group[:0])
    found = replace(state.found, clearances=state.found.clearances[:, :0])
    held = replace(state, errors=state.errors + moved, found=found)
    return replace(machine, joints=fixed), held


def _local_adjustment(
    machine: Machine, state: State, step: Adjust, start: NDArray
) -> tuple[NDArray, NDArray]:
    """Return the adjustment at a local minimum, and the minimum value, (k,)."""
    unit = 1 / machine.scale[rows_of(step.components)]
    amount = start
    value, slopes = _value_and_slopes(machine, state, step, amount)
    for _ in range(_MOST_STEPS):
        inverse = np.linalg.pinv(slopes * unit, rcond=_FLAT)
        change = -np.einsum("kcp,kp->kc", inverse, value) * unit
        size, going = np.linalg.norm(value, axis=1), np.ones(len(value), dtype=bool)
        for _ in range(_HALVINGS):  # halve the step if the value does not decrease
            trial = amount + change * going[:, None]
            found = _value_at(machine, state, step, trial)
            less = np.linalg.norm(found, axis=1) < size * (1 - _SETTLED)
            amount = np.where((going & less)[:, None], trial, amount)
            going &= ~less
            change /= 2
            if not going.any():
                break
        if going.all():
            break
        value, slopes = _value_and_slopes(machine, state, step, amount)
    return amount, np.linalg.norm(value, axis=1)


def _value_and_slopes(
    machine: Machine, state: State, step: Adjust, amount: NDArray
) -> tuple[NDArray, NDArray]:
    """Return the quantities to minimise, (k, p), and their derivatives."""
    value = _value_at(machine, state, step, amount)
    slopes = np.empty((*value.shape, len(step.components)))
    for i, scale in enumerate(machine.scale[rows_of(step.components)]):
        one = np.zeros(len(step.components))
        one[i] = _STEP / scale
        ahead = _value_at(machine, state, step, amount + one)
        slopes[..., i] = (ahead - value) / one[i]
    return value, slopes


def _value_at(machine: Machine, state: State, step: Adjust, amount: NDArray) -> NDArray:
    """Return the quantities to minimise for a trial adjustment."""
    moved = settle(machine, with_adjustment(machine, state, step, amount))
    return _to_vanish(machine, moved, step)


def _check_not_bolted(machine: Machine, state: State, step: Adjust) -> None:
    """Raise BadInput for an adjustment of a bolted joint."""
    if machine.posture.robot.index(step.frame) in state.bolted.values():
        raise BadInput(
            f"step {quoted(step.name)}: found an adjustment of {quoted(step.frame)}, "
            "whose joint is bolted; this is possible only if all joints with clearance "
            "are bolted; adjust another frame"
        )


def _closing_adjustment(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the adjustment that minimises the energy required to close a loop.

    The adjusted errors are treated as free motions of the closed machine.  If several
    adjustments have the same energy, the smallest one is returned.
    """
    rows = rows_of(step.components)
    units = np.zeros((len(machine.free), len(rows)))
    units[6 * machine.posture.robot.index(step.frame) + rows, np.arange(len(rows))] = 1
    free = np.hstack([machine.joints.free, units])
    wider = replace(machine, joints=replace(machine.joints, free=free))
    none = np.zeros((len(state.errors), len(rows)))
    found = replace(state.found, motions=np.hstack([state.found.motions, none]))
    assert not isinstance(step.reading.part, str)
    hold = closed_rows(machine, state, step.reading.part)
    closed = settle(wider, with_hold(replace(state, found=found), step.name, hold))
    least = _least_change(wider, closed, len(rows))
    return least * wider.free_size[-len(rows) :]


def _least_change(machine: Machine, state: State, count: int) -> NDArray:
    """Return the smallest last a motions for which openings do not change, (k, a)."""
    motions = machine.movable((), tuple(state.bolted.values()), 1)[2][:-count]
    rows = np.vstack([hold.rows for hold in state.holds.values()])
    changing, free = rows @ machine.free[:, -count:], rows @ machine.free[:, :-count]
    free = free[:, motions]
    kept = np.eye(len(rows)) - free @ np.linalg.pinv(free, rcond=RANK)
    own = kept @ changing
    own[np.abs(own) <= RANK * np.abs(changing).max()] = 0.0
    opened = state.found.motions[:, -count:] @ own.T
    return opened @ np.linalg.pinv(own, rcond=RANK).T


def _to_vanish(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the quantities to minimise: a screw, or the springs of a closed loop."""
    part = step.reading.part
    if isinstance(part, str):
        return reading_of(machine, state, step.reading)
    hold = closed_rows(machine, state, part)
    found = settle(machine, with_hold(state, step.name, hold)).found
    return np.hstack([found.springs, found.fixtures])
