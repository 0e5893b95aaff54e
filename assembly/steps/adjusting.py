"""Adjustments: a change of geometric errors that makes a reading least."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from assembly.steps.machine import Machine
from assembly.steps.plan import Adjust, rows_of
from assembly.steps.state import (
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
    """Return the (k, a) [rad or m] change that makes the reading least."""
    if not state.is_linear(machine):
        raise BadInput(
            f"step {quoted(step.name)}: found clearances that are not bolted; expected "
            "none before an adjustment, which is computed for a linear machine"
        )
    count = len(step.components)
    value = _to_vanish(machine, state, step)
    slopes = np.empty((value.shape[1], count))
    for i in range(count):
        unit = np.zeros((len(value), count))
        unit[:, i] = 1.0
        moved = settle(machine, with_adjustment(machine, state, step, unit))
        slopes[:, i] = (_to_vanish(machine, moved, step) - value)[0]
    amount = -value @ np.linalg.pinv(slopes).T
    if step.increment:
        amount = step.increment * np.round(amount / step.increment)
    return amount


def _to_vanish(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return what an adjustment makes least: a reading, or strains of a closure."""
    part = step.reading.part
    if isinstance(part, str):
        return reading_of(machine, state, step.reading)
    hold = closed_rows(machine, state, part)
    found = settle(machine, with_hold(state, step.name, hold)).found
    return np.hstack([found.springs, found.fixtures])
