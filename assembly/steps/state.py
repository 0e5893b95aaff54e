"""State of partly assembled machines: constraints and equilibrium."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.linear.load import FrameLoads, loads_on_frames, weights
from forcefit.assembly.steps.equilibrium import (
    Equilibrium,
    Held,
    equilibrium,
    without_idle_weight,
)
from forcefit.assembly.steps.machine import Machine, Part
from forcefit.assembly.steps.plan import (
    GRAVITY,
    Fix,
    Measure,
    Plan,
    closure_name,
    rows_of,
)


@dataclass(frozen=True, eq=False)
class Hold:
    """Constraints due to a joined closure or a fixture.

    Attributes:
        rows: (m, 6n) coefficients of the screws of all frames, with lengths in
            reference lengths.
        right: (k, m) right-hand sides.
        roots: (m, nf) coefficients of the fixture's springs.
        part: frame or closure that is constrained.
        components: (m,) constrained components of its screw.
    """

    rows: NDArray
    right: NDArray
    roots: NDArray
    part: Part
    components: NDArray


@dataclass(frozen=True, eq=False)
class State:
    """State of k partly assembled machines.

    Attributes:
        errors: (k, 6n) [rad, m] geometric errors, including adjustments.
        found: equilibrium.
        holds: constraints of closures and fixtures, by name of the step.
        loads: acting loads, by name of the step.
        bolted: index of the frame whose joint is bolted, by name of the step.
    """

    errors: NDArray
    found: Equilibrium
    holds: dict[str, Hold] = field(default_factory=dict)
    loads: dict[str, FrameLoads] = field(default_factory=dict)
    bolted: dict[str, int] = field(default_factory=dict)

    def is_linear(self, machine: Machine) -> bool:
        """Return whether no joint can move within its clearance."""
        return not machine.movable((), tuple(self.bolted.values()), 1)[1].any()

    def multipliers(self) -> dict[str, NDArray]:
        """Return the multipliers of each closure and fixture, (k, m)."""
        ends = np.cumsum([len(hold.rows) for hold in self.holds.values()])[:-1]
        parts = np.split(self.found.multipliers, ends, axis=1) if self.holds else []
        return dict(zip(self.holds, parts, strict=True))


def first_state(
    machine: Machine, plan: Plan, errors: ArrayLike | None, gravity: ArrayLike | None
) -> State:
    """Return the machine before the first step.

    Args:
        machine: the robot in array form.
        plan: steps of assembly.  Closures that no step joins are closed initially.
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
            hold = closed_rows(machine, state, closure)
            state.holds[closure_name(closure)] = hold
    if gravity is not None:
        bodies, carried = weights(machine.posture, gravity)
        loads = loads_on_frames(machine.posture, None, bodies, carried)
        state.loads[GRAVITY] = loads
    return settle(machine, state)


def settle(machine: Machine, state: State) -> State:
    """Return a state in equilibrium, as close as possible to the previous equilibrium.

    Args:
        machine: the robot in array form.
        state: new constraints, loads and errors, with the previous equilibrium.

    Returns:
        The state in equilibrium.
    """
    k, held = len(state.errors), list(state.holds.values())
    rows = np.vstack([np.zeros((0, state.errors.shape[1])), *(h.rows for h in held)])
    right = np.hstack([np.zeros((k, 0)), *(h.right for h in held)])
    roots = _blocks([hold.roots for hold in held], len(rows))
    last, bolted = state.found, tuple(state.bolted.values())
    movable, cones, motions = machine.movable(tuple(state.loads.values()), bolted, k)
    if GRAVITY in state.loads:
        weight = state.loads[GRAVITY].joint @ movable.free
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
    """Return a block-diagonal matrix with ``count`` rows."""
    columns = np.zeros((count, sum(block.shape[1] for block in blocks)))
    row = column = 0
    for block in blocks:
        m, n = block.shape
        columns[row : row + m, column : column + n] = block
        row, column = row + m, column + n
    return columns


def closed_rows(machine: Machine, state: State, closure: tuple[str, str]) -> Hold:
    """Return the constraints of a closed loop."""
    rows = machine.rows(closure)
    none = np.zeros((len(state.errors), 6)), np.zeros((6, 0))
    return Hold(rows, *none, closure, np.arange(6))


def fixture_rows(machine: Machine, state: State, step: Fix) -> Hold:
    """Return the constraints of a fixture."""
    k, rows = len(state.errors), machine.rows(step.frame)
    if step.position is None:
        chosen = np.arange(6)
        right = machine.values(rows, state.errors, state.found)
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


def with_hold(state: State, name: str, hold: Hold) -> State:
    """Return a state with additional constraints, without computing its equilibrium."""
    return replace(state, holds=state.holds | {name: hold})


def without(state: State, names: tuple[str, ...]) -> State:
    """Return a state without the constraints and loads of given steps.

    Its equilibrium is not computed.
    """

    def kept(given: dict) -> dict:
        return {name: value for name, value in given.items() if name not in names}

    return replace(
        state, holds=kept(state.holds), loads=kept(state.loads),
        bolted=kept(state.bolted),
    )  # fmt: skip


def reading_of(machine: Machine, state: State, step: Measure) -> NDArray:
    """Return the measured values of a measuring step, (k, p) [rad or m]."""
    chosen = rows_of(step.components)
    if isinstance(step.part, str):
        rows = machine.rows(step.part)
        screws = machine.values(rows, state.errors, state.found)
        return (screws / machine.scale)[:, chosen]
    hold = closed_rows(machine, state, step.part)
    opening = machine.opening(state.errors, state.found, state.holds, hold)
    return (-opening / machine.scale)[:, chosen]
