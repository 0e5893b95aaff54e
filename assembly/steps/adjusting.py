"""Adjustments: a change of geometric errors that makes a reading least."""

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


def with_adjustment(
    machine: Machine, state: State, step: Adjust, amount: NDArray
) -> State:
    """Return the state with a changed geometric error, before it settles."""
    first = 6 * machine.posture.robot.index(step.frame)
    errors = state.errors.copy()
    errors[:, first + rows_of(step.components)] += amount
    return replace(state, errors=errors)


def adjustment_of(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the (k, a) [rad or m] change that makes the reading least.

    Args:
        machine: columns and rows of the robot.
        state: before the step.
        step: the adjustment.

    Returns:
        The changes of the components of the frame's geometric error.

    Raises:
        BadInput: clearances are loose, and the reading is a frame, loads act, or the
            frame's joint is bolted.
    """
    if state.is_linear(machine):
        amount = _linear_adjustment(machine, state, step)
    else:
        _check_convex(machine, state, step)
        amount = _closing_adjustment(machine, state, step)
    if step.increment:
        amount = step.increment * np.round(amount / step.increment)
    return amount


def _linear_adjustment(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the change of a machine without loose clearances."""
    count = len(step.components)
    value = _to_vanish(machine, state, step)
    slopes = np.empty((value.shape[1], count))
    for i in range(count):
        unit = np.zeros((len(value), count))
        unit[:, i] = 1.0
        moved = settle(machine, with_adjustment(machine, state, step, unit))
        slopes[:, i] = (_to_vanish(machine, moved, step) - value)[0]
    # where many changes do alike, the least one, lengths in reference lengths
    unit = 1 / machine.scale[rows_of(step.components)]
    return -value @ np.linalg.pinv(slopes * unit).T * unit


def _check_convex(machine: Machine, state: State, step: Adjust) -> None:
    """Refuse adjustments that are not least energies, where clearances are loose."""
    where = f"step {quoted(step.name)}: found clearances that are not bolted, and"
    only = "only the energy of closing a closure without loads is made least there"
    if isinstance(step.reading.part, str):
        raise BadInput(f"{where} a frame as the reading; {only}")
    if state.loads:
        raise BadInput(
            f"{where} the loads {', '.join(map(quoted, state.loads))}; {only}"
        )
    if machine.posture.robot.index(step.frame) in state.bolted.values():
        found = f"{quoted(step.frame)}, whose joint is bolted"
        raise BadInput(f"{where} {found}; expected another frame to adjust")


def _closing_adjustment(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the change with which closing a closure needs the least energy.

    The changes are free motions of the closed machine, whose energy is convex in them
    and in the clearances together.  Where many changes do alike, the clearances stay as
    close as possible to where they are; then the change is the least one.
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
    """Return the (k, a) last motions, without what other free motions can do."""
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
    """Return what an adjustment makes least: a reading, or strains of a closure."""
    part = step.reading.part
    if isinstance(part, str):
        return reading_of(machine, state, step.reading)
    hold = closed_rows(machine, state, part)
    found = settle(machine, with_hold(state, step.name, hold)).found
    return np.hstack([found.springs, found.fixtures])
