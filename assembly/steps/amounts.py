"""Simultaneous optimisation of all adjustments of a plan.

The Gauss-Newton method minimises an objective of the whole plan.  The initial guess is
the plan in which each adjustment minimises its own measured value.  Derivatives are
computed by finite differences.  The result is a local minimum.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.linear.reference.energy import CannotAssemble
from forcefit.assembly.steps.machine import Machine
from forcefit.assembly.steps.plan import Adjust, Join, Plan, rows_of
from forcefit.assembly.steps.run import StepResult, carry_out
from forcefit.assembly.steps.state import State

_STEP = 1e-7  # [rad, reference lengths] step of the finite differences
_FLAT = 1e-6  # [-] tolerance for zero derivatives, relative to the largest
# maximum number of Gauss-Newton steps, and trial fractions of a step
_MOST_STEPS, _SHARES = 20, 0.5 ** np.arange(8)
_SETTLED = 1e-7  # [-] convergence tolerance on the relative change of the objective

# function that returns the state of a given number of machines before the first step
Start = Callable[[int], State]


def with_best_amounts(
    plan: Plan, machine: Machine, start: Start, objective: str, given: float
) -> tuple[Plan, float]:
    """Return a plan whose adjustments minimise an objective together.

    Args:
        plan: a feasible plan.
        machine: the robot in array form.
        start: function that returns the state before the first step, for a given number
            of equal machines.
        objective: ``"force"``, ``"energy"`` or ``"error"``.
        given: value of the objective if each adjustment minimises its own measured
            value.

    Returns:
        The plan with the optimal ``amount`` of each adjustment, and the objective.
        Without an improvement, both are returned unchanged.
    """
    steps = [step for step in plan.steps if isinstance(step, Adjust)]
    if not steps:
        return plan, given
    components = np.concatenate([rows_of(step.components) for step in steps])
    unit = 1 / machine.scale[components]

    def outcome(amounts: NDArray) -> tuple[NDArray, NDArray]:
        changed = _with_amounts(plan, amounts)
        return _outcome(changed, machine, start(len(amounts)), objective)

    results = _carried_out(plan, machine, start(1))
    amounts = np.concatenate([
        result.adjustment[0] for result in results if isinstance(result.step, Adjust)
    ])
    value = given
    try:
        for _ in range(_MOST_STEPS):
            steps_of = np.diag(_STEP * unit)
            residuals, _ = outcome(amounts + np.vstack([0 * unit, steps_of]))
            slopes = (residuals[1:] - residuals[0]).T / _STEP
            change = -np.linalg.pinv(slopes, rcond=_FLAT) @ residuals[0] * unit
            trials = _rounded(steps, amounts + _SHARES[:, None] * change)
            values = outcome(trials)[1]
            best = int(np.argmin(values))
            if not values[best] < value * (1 - _SETTLED):
                break
            amounts, value = trials[best], float(values[best])
    except CannotAssemble:
        pass
    if value >= given:
        return plan, given
    return _with_amounts(plan, amounts), value


def _rounded(steps: list[Adjust], amounts: NDArray) -> NDArray:
    """Return adjustments rounded to multiples of their increments."""
    sizes = np.concatenate([np.full(len(s.components), s.increment) for s in steps])
    whole = np.where(sizes > 0, sizes, 1.0)
    return np.where(sizes > 0, whole * np.round(amounts / whole), amounts)


def _with_amounts(plan: Plan, amounts: NDArray) -> Plan:
    """Return a plan whose adjustments have given amounts, (.., total)."""
    steps, first = [], 0
    for step in plan.steps:
        if isinstance(step, Adjust):
            last = first + len(step.components)
            step = replace(step, amount=amounts[..., first:last])
            first = last
        steps.append(step)
    return Plan(tuple(steps))


def _carried_out(plan: Plan, machine: Machine, state: State) -> list[StepResult]:
    """Return the results of all steps of a plan."""
    results = []
    for step in plan.steps:
        state, result = carry_out(machine, state, step)
        results.append(result)
    return results


def _outcome(
    plan: Plan, machine: Machine, state: State, objective: str
) -> tuple[NDArray, NDArray]:
    """Return the residuals (k, p) and the objective (k,) of a plan."""
    forces = [np.zeros((len(state.errors), 3))]
    screw = machine.platform_screw(state.errors, state.found)
    for step in plan.steps:
        state, result = carry_out(machine, state, step)
        screw = result.platform_screw
        if isinstance(step, Join):
            forces.append(result.closing_wrench[:, 3:])
    if objective == "error":
        return screw[:, 3:], np.linalg.norm(screw[:, 3:], axis=1)
    if objective == "energy":
        strains = np.hstack([state.found.springs, state.found.fixtures])
        return strains, state.found.energy
    peaks = [np.linalg.norm(force, axis=1) for force in forces]
    return np.hstack(forces), np.max(peaks, axis=0)
