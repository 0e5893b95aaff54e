"""A plan carried out on one machine, or on many that differ in their errors.

The machine is linear in small screws, at one posture.  Each step changes what is held;
then the springs find the equilibrium from the last state (``equilibrium.py``).

======  ==================  ==========  ==============================================
symbol  code                shape       meaning
======  ==================  ==========  ==============================================
E       ``energy``          (k,)        [J] of all springs, those of fixtures included
lambda  ``closing_wrench``  (k, 6)      [N m, N] that closes a closure, at its peak
gamma   ``opening``         (k, 6)      [rad, m] before it is closed
======  ==================  ==========  ==============================================
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.kinematics.posture import Posture
from assembly.linear.assembled import without_rounding
from assembly.linear.load import FrameLoads, loads_on_frames, weights
from assembly.steps.equilibrium import (
    Equilibrium,
    Held,
    equilibrium,
    without_idle_weight,
)
from assembly.steps.machine import Machine, Part, machine_at
from assembly.steps.plan import (
    Adjust,
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
from forcefit.inputs.table import BadInput

_ROUNDED = 1e-13  # share of the energies below which their difference is rounding
_HALVINGS = 50  # of the share of an opening that a limited force closes


@dataclass(frozen=True, eq=False)
class Hold:
    """Rows of one joined closure or of one fixture.

    Attributes:
        rows: (m, 6n) on the frames' screws, lengths in reference lengths.
        right: (k, m) right sides.
        roots: (m, nf) of the fixture's springs.
        part: frame or closure in whose axes the rows are.
        components: (m,) components of the screw.
    """

    rows: NDArray
    right: NDArray
    roots: NDArray
    part: Part
    components: NDArray


@dataclass(frozen=True, eq=False)
class State:
    """A partly assembled machine; k of them.

    Attributes:
        errors: (k, 6n) [rad, m] geometric errors, adjustments included.
        found: springs, clearances, free motions and multipliers.
        holds: closures and fixtures that hold, by step.
        loads: loads that act, by step.
        bolted: by step, the frame whose joint is bolted as it lies.
    """

    errors: NDArray
    found: Equilibrium
    holds: dict[str, Hold] = field(default_factory=dict)
    loads: dict[str, FrameLoads] = field(default_factory=dict)
    bolted: dict[str, int] = field(default_factory=dict)

    def multipliers(self) -> dict[str, NDArray]:
        """Return the (k, m) multipliers of each hold."""
        ends = np.cumsum([len(hold.rows) for hold in self.holds.values()])[:-1]
        parts = np.split(self.found.multipliers, ends, axis=1) if self.holds else []
        return dict(zip(self.holds, parts, strict=True))


@dataclass(frozen=True, eq=False)
class StepResult:
    """One step of k machines.

    Attributes:
        step: the step.
        energy: (k,) [J] afterwards.
        work: (k,) [J] of the step: of the closing wrench, of a clamp, or of a preload
            that grows slowly.
        load_work: (k,) [J] of the loads that acted before and after.
        lost: (k,) [J] energy that a release loses.
        closing_wrench: (k, 6) [N m, N] peak, in the axes of the closure or fixture; 0
            for other steps.
        opening: (k, 6) [rad, m] of the closure before, as far as free motions cannot
            close it; what a force limit leaves open is in ``left_open``.
        left_open: (k, 6) [rad, m] opening that the step leaves.
        exceeded: (k,) bool, whether closing needs more than the allowed force.
        spring_back: (k, 6) [rad, m] motion of what is released, in its axes.
        reading: (k, p) [rad or m] of a measurement.
        adjustment: (k, a) [rad or m] change that an adjustment makes.
        platform_screw: (k, 6) [rad, m] afterwards, at its origin, base axes.
        wrenches: (k, 6) [N m, N] locked in afterwards, by step that holds, in its axes.
        balance: (k,) [J] difference of the work, or of the energy lost, from half the
            multipliers times the opening; NaN with clearances or gravity.
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
        """(k,) [N] force part of the closing wrench."""
        return np.linalg.norm(self.closing_wrench[:, 3:], axis=1)


def assemble_in_steps(
    plan: Plan,
    posture: Posture,
    errors: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
) -> list[StepResult]:
    """Carry out a plan.

    Args:
        plan: the steps.
        posture: pose at which the robot of n frames is assembled.
        errors: (k, n, 6) [rad, m] geometric errors of k machines; the robot's if
            absent.
        gravity: (3,) [m/s^2] base axes; acts from the beginning.  It does not move
            parts that nothing holds yet.

    Returns:
        The results, step by step.

    Raises:
        BadInput: the plan does not fit the robot.
        CannotAssemble: rigid parts contradict each other.
        FreeMotion: a load drives a motion that nothing resists.
        SolverFailed: the solver of the clearances gave up.
    """
    check_plan(plan, posture.robot)
    machine = machine_at(posture)
    state = first_state(machine, plan, errors, gravity)
    results = []
    for step in plan.steps:
        state, result = carry_out(machine, state, step)
        results.append(result)
    return results


def first_state(
    machine: Machine, plan: Plan, errors: ArrayLike | None, gravity: ArrayLike | None
) -> State:
    """Return the machine before the first step.

    Args:
        machine: columns and rows of the robot.
        plan: the steps; closures that they do not join are closed.
        errors: see :func:`assemble_in_steps`.
        gravity: see :func:`assemble_in_steps`.

    Returns:
        The state.
    """
    robot = machine.posture.robot
    given = robot.errors if errors is None else np.asarray(errors, dtype=float)
    flat = given.reshape(-1, robot.errors.size)
    k, zero = len(flat), np.zeros((len(flat), 0))
    state = State(
        errors=flat,
        found=Equilibrium(
            springs=np.zeros((k, machine.springs.shape[1])), fixtures=zero,
            clearances=np.zeros((k, machine.cones.shape[1])),
            motions=np.zeros((k, machine.free.shape[1])), multipliers=zero,
        ),
    )  # fmt: skip
    joined = plan.joined()
    for closure in robot.closures:
        if closure not in joined:
            name = f"{closure[0]} - {closure[1]}"
            state.holds[name] = _closed(machine, state, closure)
    if gravity is not None:
        bodies, carried = weights(machine.posture, gravity)
        loads = loads_on_frames(machine.posture, None, bodies, carried)
        state.loads["gravity"] = loads
    return settle(machine, state)


def carry_out(machine: Machine, state: State, step: Step) -> tuple[State, StepResult]:
    """Carry out one step.

    Args:
        machine: columns and rows of the robot.
        state: before the step.
        step: of a plan that was checked.

    Returns:
        The state after it, and the result.
    """
    blank = _blank(machine, state, step)
    if isinstance(step, Join) and isinstance(step.part, str):
        after = replace(state, bolted=state.bolted | {step.name: _row(machine, step)})
        return _told(machine, state, settle(machine, after), blank)
    if isinstance(step, Join):
        return _join(machine, state, step, blank)
    if isinstance(step, Fix):
        hold = _fixture(machine, state, step)
        after = settle(machine, _with_hold(state, step.name, hold))
        return _told(machine, state, after, blank)
    if isinstance(step, Preload):
        bodies = np.zeros((len(machine.posture.robot.frames), 6))
        bodies[machine.posture.robot.index(step.frame)] = step.wrench
        loads = loads_on_frames(machine.posture, None, bodies)
        after = replace(state, loads=state.loads | {step.name: loads})
        return _told(machine, state, settle(machine, after), blank)
    if isinstance(step, Release):
        after = settle(machine, _without(state, step.steps))
        return _told(machine, state, after, blank)
    if isinstance(step, Measure):
        reading = _reading(machine, state, step)
        return state, replace(blank, reading=reading)
    amount = _adjustment(machine, state, step)
    after = settle(machine, _adjusted(machine, state, step, amount))
    return _told(machine, state, after, replace(blank, adjustment=amount))


def settle(machine: Machine, state: State) -> State:
    """Return the equilibrium of what is held, from the last state.

    Args:
        machine: columns and rows of the robot.
        state: holds, loads and errors; its unknowns are those of the last state.

    Returns:
        The same with its unknowns at equilibrium.
    """
    k, held = len(state.errors), list(state.holds.values())
    rows = np.vstack([np.zeros((0, state.errors.shape[1])), *(h.rows for h in held)])
    right = np.hstack([np.zeros((k, 0)), *(h.right for h in held)])
    roots = _blocks([hold.roots for hold in held], len(rows))
    last, bolted = state.found, tuple(state.bolted.values())
    movable, cones, motions = machine.movable(tuple(state.loads.values()), bolted, k)
    if "gravity" in state.loads:
        weight = state.loads["gravity"].joint @ movable.free
        movable = without_idle_weight(movable, weight, rows)
    fixed = state.errors.copy()
    fixed += last.clearances[:, ~cones] @ machine.cones[:, ~cones].T
    fixed += last.motions[:, ~motions] @ machine.free[:, ~motions].T
    start = last.clearances[:, cones], last.motions[:, motions]
    new = equilibrium(
        Held(rows, right - fixed @ rows.T, roots), movable, start, machine.tolerance
    )
    u, q = last.clearances.copy(), last.motions.copy()
    u[:, cones], q[:, motions] = new.clearances, new.motions
    return replace(state, found=replace(new, clearances=u, motions=q))


def _blocks(blocks: list[NDArray], count: int) -> NDArray:
    """Return the springs of all fixtures as columns of all rows."""
    columns = np.zeros((count, sum(block.shape[1] for block in blocks)))
    row = column = 0
    for block in blocks:
        m, n = block.shape
        columns[row : row + m, column : column + n] = block
        row, column = row + m, column + n
    return columns


def _row(machine: Machine, step: Join) -> int:
    """Return the frame whose joint a step bolts."""
    return machine.posture.robot.index(str(step.part))


def _with_hold(state: State, name: str, hold: Hold) -> State:
    return replace(state, holds=state.holds | {name: hold})


def _without(state: State, names: tuple[str, ...]) -> State:
    """Return the state without what earlier steps hold."""

    def kept(given: dict) -> dict:
        return {name: value for name, value in given.items() if name not in names}

    return replace(
        state, holds=kept(state.holds), loads=kept(state.loads),
        bolted=kept(state.bolted),
    )  # fmt: skip


def _closed(machine: Machine, state: State, closure: tuple[str, str]) -> Hold:
    """Return the rows of a closure that is closed."""
    rows = machine.rows(closure)
    none = np.zeros((len(state.errors), 6)), np.zeros((6, 0))
    return Hold(rows, *none, closure, np.arange(6))


def _fixture(machine: Machine, state: State, step: Fix) -> Hold:
    """Return the rows of a fixture."""
    k, rows = len(state.errors), machine.rows(step.frame)
    if step.position is None:
        chosen = np.arange(6)
        right = machine.screws(state.errors, state.found) @ rows.T
    else:
        chosen = rows_of(tuple(step.position))
        values = np.array(list(step.position.values()), dtype=float)
        right = np.broadcast_to(values * machine.scale[chosen], (k, len(chosen)))
    names = np.array([*step.stiffness])
    springs = rows_of(tuple(names))
    roots = np.zeros((6, len(names)))
    stiffness = np.array(list(step.stiffness.values()), dtype=float)
    roots[springs, np.arange(len(names))] = machine.scale[springs] / np.sqrt(stiffness)
    return Hold(rows[chosen], right, roots[chosen], step.frame, chosen)


def _join(
    machine: Machine, state: State, step: Join, blank: StepResult
) -> tuple[State, StepResult]:
    """Close a closure, with its locked components as they lie."""
    assert not isinstance(step.part, str)
    hold = _closed(machine, state, step.part)
    opening = machine.opening(state.errors, state.found, state.holds, hold)
    locked = rows_of(step.locked)
    as_it_lies = machine.screws(state.errors, state.found) @ hold.rows.T
    hold.right[:, locked] = as_it_lies[:, locked]
    opening[:, locked] = 0.0
    blank = replace(blank, opening=-opening / machine.scale)

    def closed(share: NDArray) -> State:
        right = hold.right - (1 - share)[:, None] * opening
        joined = _with_hold(state, step.name, replace(hold, right=right))
        return settle(machine, joined)

    def force(after: State) -> NDArray:
        wrench = after.multipliers()[step.name] * machine.scale
        return np.linalg.norm(wrench[:, 3:], axis=1)

    after = closed(np.ones(len(opening)))
    needed = force(after)
    exceeded = needed > step.force_limit * (1 + 1e-12)
    if step.leave_open and exceeded.any():
        share = _share(machine, step.force_limit, needed, lambda s: force(closed(s)))
        after = closed(share)
        left = -(1 - share)[:, None] * opening / machine.scale
        blank = replace(blank, left_open=left)
    return _told(machine, state, after, replace(blank, exceeded=exceeded))


def _share(machine: Machine, limit: float, needed: NDArray, force: Callable) -> NDArray:
    """Return the (k,) shares of the openings that a limited force closes."""
    share = np.minimum(1.0, limit / np.maximum(needed, 1e-300))
    if not machine.cones.shape[1]:
        return share  # the force is proportional to the share
    low, high = np.zeros_like(needed), np.ones_like(needed)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        within = force(middle) <= limit
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return np.where(needed > limit, low, 1.0)


def _reading(machine: Machine, state: State, step: Measure) -> NDArray:
    """Return the (k, p) [rad or m] readings of a measurement."""
    chosen = rows_of(step.components)
    if isinstance(step.part, str):
        screws = machine.screws(state.errors, state.found)
        return (screws @ machine.rows(step.part).T / machine.scale)[:, chosen]
    hold = _closed(machine, state, step.part)
    opening = machine.opening(state.errors, state.found, state.holds, hold)
    return (-opening / machine.scale)[:, chosen]


def _adjusted(machine: Machine, state: State, step: Adjust, amount: NDArray) -> State:
    """Return the state with a changed geometric error, before it settles."""
    first = 6 * machine.posture.robot.index(step.frame)
    errors = state.errors.copy()
    errors[:, first + rows_of(step.components)] += amount
    return replace(state, errors=errors)


def _adjustment(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return the (k, a) [rad or m] change that makes the reading least."""
    if machine.cones.shape[1]:
        raise BadInput(
            f"step {step.name!r}: an adjustment needs a machine without clearances "
            "(it is linear); found joints with clearance"
        )
    count = len(step.components)
    value = _to_vanish(machine, state, step)
    slopes = np.empty((value.shape[1], count))
    for i in range(count):
        unit = np.zeros((len(value), count))
        unit[:, i] = 1.0
        moved = settle(machine, _adjusted(machine, state, step, unit))
        slopes[:, i] = (_to_vanish(machine, moved, step) - value)[0]
    amount = -value @ np.linalg.pinv(slopes).T
    if step.increment:
        amount = step.increment * np.round(amount / step.increment)
    return amount


def _to_vanish(machine: Machine, state: State, step: Adjust) -> NDArray:
    """Return what an adjustment makes least: a reading, or strains of a closure."""
    part = step.reading.part
    if isinstance(part, str):
        return _reading(machine, state, step.reading)
    hold = _closed(machine, state, part)
    found = settle(machine, _with_hold(state, step.name, hold)).found
    return np.hstack([found.springs, found.fixtures])


def _blank(machine: Machine, state: State, step: Step) -> StepResult:
    """Return the result of a step that changes nothing."""
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
    """Return the (k, 6) [N m, N] wrenches of all holds, each in its own axes."""
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
    old = machine.screws(before.errors, before.found)
    new = machine.screws(after.errors, after.found)
    kept = [after.loads[name] for name in after.loads if name in before.loads]
    load_work = machine.work(kept, after) - machine.work(kept, before)
    gained = after.found.energy - before.found.energy - load_work
    size = after.found.energy + before.found.energy + np.abs(load_work)
    gained = np.where(np.abs(gained) <= _ROUNDED * size, 0.0, gained)
    releasing = isinstance(step, Release)
    wrench = spring_back = np.zeros((len(new), 6))
    wrenches = _wrenches(machine, after)
    half = np.full(len(new), np.nan)
    if step.name in after.holds:
        hold, wrench = after.holds[step.name], wrenches[step.name]
        half = np.vecdot(
            after.multipliers()[step.name], hold.right - old @ hold.rows.T
        ) / 2  # fmt: skip
    elif step.name in after.loads:
        added = [after.loads[step.name]]
        half = (machine.work(added, after) - machine.work(added, before)) / 2
    elif isinstance(step, Release):
        removed = [before.loads[name] for name in step.steps if name in before.loads]
        half = (machine.work(removed, after) - machine.work(removed, before)) / 2
        for name in step.steps:
            if name not in before.holds:
                continue
            hold = before.holds[name]
            open_ = hold.right - new @ hold.rows.T
            half = half - np.vecdot(before.multipliers()[name], open_) / 2
            chosen = hold.components
            spring_back = np.zeros((len(new), 6))
            moved = (new - old) @ hold.rows.T
            spring_back[:, chosen] = moved / machine.scale[chosen]
    linear = not machine.cones.shape[1] and "gravity" not in after.loads
    return after, replace(
        result, energy=after.found.energy, load_work=load_work,
        work=np.zeros_like(gained) if releasing else gained,
        lost=0.0 - gained if releasing else np.zeros_like(gained),
        closing_wrench=wrench, spring_back=spring_back, wrenches=wrenches,
        platform_screw=machine.platform_screw(after.errors, after.found),
        balance=gained - half if linear else np.full(len(new), np.nan),
    )  # fmt: skip
