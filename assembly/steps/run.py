"""Results of an assembly plan for one or many machines, which differ in their errors.

The model is linear in small screws at one posture.  Each step changes the active
constraints, and the new equilibrium depends on the previous one (``equilibrium.py``).

======  ==================  ==========  ==============================================
symbol  code                shape       meaning
======  ==================  ==========  ==============================================
E       ``energy``          (k,)        [J] energy of all springs and fixtures
lambda  ``closing_wrench``  (k, 6)      [N m, N] wrench that closes a loop
gamma   ``opening``         (k, 6)      [rad, m] opening before the loop is closed
======  ==================  ==========  ==============================================
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.assembled import without_rounding
from forcefit.assembly.linear.load import loads_on_frames
from forcefit.assembly.steps.adjusting import adjustment_of, with_adjustment
from forcefit.assembly.steps.machine import Machine, machine_at
from forcefit.assembly.steps.plan import (
    GRAVITY,
    Fix,
    Join,
    Measure,
    Plan,
    Preload,
    Release,
    Step,
    check_plan,
    rows_of,
)
from forcefit.assembly.steps.state import (
    State,
    closed_rows,
    first_state,
    fixture_rows,
    reading_of,
    settle,
    with_hold,
    without,
)

_ROUNDED = 1e-13  # [-] tolerance for zero energy differences, relative to the energy
_HALVINGS = 50  # number of bisections to compute the opening at a limited force


@dataclass(frozen=True, eq=False)
class StepResult:
    """Result of one step for k machines.

    Attributes:
        step: the step.
        energy: (k,) [J] energy after the step.
        work: (k,) [J] work of the closing wrench, of a clamp, or of a preload that
            increases slowly.
        load_work: (k,) [J] work of the loads that act before and after the step.
        lost: (k,) [J] energy dissipated by a release.
        closing_wrench: (k, 6) [N m, N] wrench after the step, in the axes of the
            closure or fixture; 0 for other steps.
        opening: (k, 6) [rad, m] opening of the closure before the step.  It excludes
            the opening that free motions can close.
        left_open: (k, 6) [rad, m] opening that remains because of the force limit.
        exceeded: (k,) bool, True if the closing force exceeds the force limit.
        spring_back: (k, 6) [rad, m] motion of a closure or frame after its release, in
            its axes.
        reading: (k, p) [rad or m] values of a measurement.
        adjustment: (k, a) [rad or m] amount of an adjustment.
        platform_screw: (k, 6) [rad, m] screw of the platform after the step, at its
            origin, base axes.
        wrenches: (k, 6) [N m, N] wrenches of closures and fixtures after the step, by
            name of the step that created them.
        balance: (k,) [J] error of the energy balance; NaN with clearances or gravity.
    """

    step: Step
    energy: NDArray
    work: NDArray
    load_work: NDArray
    lost: NDArray
    closing_wrench: NDArray
    opening: NDArray
    left_open: NDArray
    exceeded: NDArray
    spring_back: NDArray
    reading: NDArray
    adjustment: NDArray
    platform_screw: NDArray
    wrenches: dict[str, NDArray]
    balance: NDArray

    @property
    def closing_force(self) -> NDArray:
        """Magnitude of the closing force, (k,) [N]."""
        return np.linalg.norm(self.closing_wrench[:, 3:], axis=1)


def assemble_in_steps(
    plan: Plan,
    posture: Posture,
    errors: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> list[StepResult]:
    """Return the result of each step of an assembly plan.

    Args:
        plan: steps of assembly.
        posture: pose at which the robot with n frames is assembled.
        errors: (k, n, 6) [rad, m] geometric errors of k machines; None for the errors
            in the robot file.
        gravity: (3,) [m/s^2] gravity in base axes.  It does not act on free motions,
            because bodies that are not yet joined are assumed to be supported.

    Returns:
        The results of all steps.

    Raises:
        BadInput: the plan is inconsistent with the robot.
        CannotAssemble: the constraints of rigid bodies contradict each other.
        FreeMotion: a load acts on a motion without stiffness.
        SolverFailed: the solver for the clearances did not converge.
    """
    check_plan(plan, posture.robot)
    machine = machine_at(posture)
    state = first_state(machine, plan, errors, gravity)
    results = []
    for step in plan.steps:
        state, result = carry_out(machine, state, step)
        results.append(result)
    return results


def carry_out(machine: Machine, state: State, step: Step) -> tuple[State, StepResult]:
    """Return the state after a step, and the result of the step.

    Args:
        machine: the robot in array form.
        state: state before the step.
        step: step of a plan that :func:`check_plan` accepts.

    Returns:
        The state after the step, and the result.
    """
    blank = _blank(machine, state, step)
    if isinstance(step, Join) and isinstance(step.part, str):
        after = replace(state, bolted=state.bolted | {step.name: _row(machine, step)})
        return _told(machine, state, settle(machine, after), blank)
    if isinstance(step, Join):
        return _join(machine, state, step, blank)
    if isinstance(step, Fix):
        hold = fixture_rows(machine, state, step)
        after = settle(machine, with_hold(state, step.name, hold))
        return _told(machine, state, after, blank)
    if isinstance(step, Preload):
        bodies = np.zeros((len(machine.posture.robot.frames), 6))
        bodies[machine.posture.robot.index(step.frame)] = step.wrench
        loads = loads_on_frames(machine.posture, None, bodies)
        after = replace(state, loads=state.loads | {step.name: loads})
        return _told(machine, state, settle(machine, after), blank)
    if isinstance(step, Release):
        after = settle(machine, without(state, step.steps))
        return _told(machine, state, after, blank)
    if isinstance(step, Measure):
        reading = reading_of(machine, state, step)
        return state, replace(blank, reading=reading)
    amount = adjustment_of(machine, state, step)
    after = settle(machine, with_adjustment(machine, state, step, amount))
    return _told(machine, state, after, replace(blank, adjustment=amount))


def _row(machine: Machine, step: Join) -> int:
    """Return the index of the frame whose joint a step bolts."""
    return machine.posture.robot.index(str(step.part))


def _join(
    machine: Machine, state: State, step: Join, blank: StepResult
) -> tuple[State, StepResult]:
    """Return the state after a closure is joined, and the result of this step."""
    assert not isinstance(step.part, str)
    hold = closed_rows(machine, state, step.part)
    opening = machine.opening(state.errors, state.found, state.holds, hold)
    locked = rows_of(step.locked)
    as_it_lies = machine.values(hold.rows, state.errors, state.found)
    hold.right[:, locked] = as_it_lies[:, locked]
    opening[:, locked] = 0.0
    blank = replace(blank, opening=-opening / machine.scale)

    def closed(share: NDArray) -> State:
        right = hold.right - (1 - share)[:, None] * opening
        joined = with_hold(state, step.name, replace(hold, right=right))
        return settle(machine, joined)

    def force(after: State) -> NDArray:
        wrench = after.multipliers()[step.name] * machine.scale
        return np.linalg.norm(wrench[:, 3:], axis=1)

    after = closed(np.ones(len(opening)))
    needed = force(after)
    exceeded = needed > step.force_limit * (1 + 1e-12)
    if step.leave_open and exceeded.any():
        linear = state.is_linear(machine)
        share = _share(linear, step.force_limit, needed, lambda s: force(closed(s)))
        after = closed(share)
        left = -(1 - share)[:, None] * opening / machine.scale
        blank = replace(blank, left_open=left)
    return _told(machine, state, after, replace(blank, exceeded=exceeded))


def _share(linear: bool, limit: float, needed: NDArray, force: Callable) -> NDArray:
    """Return the fraction of an opening that a limited closing force closes, (k,)."""
    share = np.minimum(1.0, limit / np.maximum(needed, 1e-300))
    if linear:
        return share  # the closing force is proportional to the fraction
    low, high = np.zeros_like(needed), np.ones_like(needed)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        within = force(middle) <= limit
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return np.where(needed > limit, low, 1.0)


def _blank(machine: Machine, state: State, step: Step) -> StepResult:
    """Return a result in which the step has not changed the state."""
    k = len(state.errors)
    zero, six, empty = np.zeros(k), np.zeros((k, 6)), np.zeros((k, 0))
    return StepResult(
        step=step, energy=state.found.energy, work=zero, load_work=zero, lost=zero,
        closing_wrench=six, opening=six, left_open=six, exceeded=np.zeros(k, bool),
        spring_back=six, reading=empty, adjustment=empty,
        platform_screw=machine.platform_screw(state.errors, state.found),
        wrenches=_wrenches(machine, state), balance=zero,
    )  # fmt: skip


def _wrenches(machine: Machine, state: State) -> dict[str, NDArray]:
    """Return the wrenches of all joined closures and active fixtures, by step name."""
    found = state.multipliers()
    wrenches = np.zeros((len(state.errors), len(found), 6))
    for i, (name, multipliers) in enumerate(found.items()):
        chosen = state.holds[name].components
        wrenches[:, i, chosen] = multipliers * machine.scale[chosen]
    if found:
        wrenches = without_rounding(wrenches)
    return {name: wrenches[:, i] for i, name in enumerate(found)}


def _told(
    machine: Machine, before: State, after: State, result: StepResult
) -> tuple[State, StepResult]:
    """Return the state after a step, and its result with energies and wrenches."""
    step = result.step
    kept = [after.loads[name] for name in after.loads if name in before.loads]
    load_work = machine.work(kept, after) - machine.work(kept, before)
    gained = after.found.energy - before.found.energy - load_work
    size = after.found.energy + before.found.energy + np.abs(load_work)
    gained = np.where(np.abs(gained) <= _ROUNDED * size, 0.0, gained)
    wrenches = _wrenches(machine, after)
    releasing = isinstance(step, Release)
    linear = before.is_linear(machine) and GRAVITY not in after.loads
    half = _half_work(machine, before, after, step)
    return after, replace(
        result, energy=after.found.energy, load_work=load_work,
        work=np.zeros_like(gained) if releasing else gained,
        lost=0.0 - gained if releasing else np.zeros_like(gained),
        closing_wrench=wrenches.get(step.name, np.zeros((len(gained), 6))),
        spring_back=_spring_back(machine, before, after, step), wrenches=wrenches,
        platform_screw=machine.platform_screw(after.errors, after.found),
        balance=gained - half if linear else np.full(len(gained), np.nan),
    )  # fmt: skip


def _half_work(machine: Machine, before: State, after: State, step: Step) -> NDArray:
    """Return the work of a step computed from wrenches and displacements, (k,) [J].

    For a step that adds or removes a wrench, it is half the product of the wrench and
    the displacement.  For other steps, it is NaN.
    """
    if step.name in after.holds:
        hold, multipliers = after.holds[step.name], after.multipliers()[step.name]
        old = machine.values(hold.rows, before.errors, before.found)
        return np.vecdot(multipliers, hold.right - old) / 2
    loads = before.loads if isinstance(step, Release) else after.loads
    names = step.steps if isinstance(step, Release) else (step.name,)
    acting = [loads[name] for name in names if name in loads]
    half = (machine.work(acting, after) - machine.work(acting, before)) / 2
    if not isinstance(step, Release):
        return half if acting else np.full(len(half), np.nan)
    for name in names:
        if name in before.holds:
            hold, multipliers = before.holds[name], before.multipliers()[name]
            new = machine.values(hold.rows, after.errors, after.found)
            half = half - np.vecdot(multipliers, hold.right - new) / 2
    return half


def _spring_back(machine: Machine, before: State, after: State, step: Step) -> NDArray:
    """Return the motion of the last closure or frame that a step releases, (k, 6)."""
    motion = np.zeros((len(after.errors), 6))
    released = step.steps if isinstance(step, Release) else ()
    for name in released:
        if name in before.holds:
            hold = before.holds[name]
            old = machine.values(hold.rows, before.errors, before.found)
            new = machine.values(hold.rows, after.errors, after.found)
            motion = np.zeros_like(motion)
            motion[:, hold.components] = (new - old) / machine.scale[hold.components]
    return motion
