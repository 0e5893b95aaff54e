"""Search for the joining order with minimum force, energy or error.

Consecutive joins and adjustments are permuted (:mod:`.choices`).  There are two
methods:

- If no joint is bolted at its present position, the state depends only on the set of
  joined closures.  Minimising the peak force is a shortest-path problem over the 2^n
  sets, where the length of a path is its largest force.  The search starts from the set
  of all closures, because its equilibrium contains the closing force of each closure.
- Otherwise, the orders are searched by branch and bound.  The lower bound on the peak
  force is the peak so far.  The lower bound on the final energy is the energy with all
  closures joined that have no locked components.  There is no bound on the error.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import groupby
from math import inf
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.reference.energy import CannotAssemble
from forcefit.assembly.steps.amounts import with_best_amounts
from forcefit.assembly.steps.choices import choices, movable_runs, order_matters
from forcefit.assembly.steps.influence import depends_on_state
from forcefit.assembly.steps.machine import Machine, machine_at
from forcefit.assembly.steps.plan import Join, Plan, Step, check_plan
from forcefit.assembly.steps.run import StepResult, carry_out
from forcefit.assembly.steps.state import State, closed_rows, first_state, settle
from forcefit.inputs.table import BadInput, quoted

Objective = Literal["force", "energy", "error"]
OBJECTIVES: tuple[Objective, ...] = ("force", "energy", "error")
_EQUAL = 1e-9  # [-] smallest relative improvement over the given order
MOST_STATES = 200_000  # maximum number of computed states, which takes a few minutes


# partial order of steps: state, peak force, completed steps, remaining steps
_Partial = tuple[State, float, tuple[Step, ...], tuple[Step, ...]]


@dataclass(frozen=True)
class BestOrder:
    """Best order of the steps of a plan.

    Attributes:
        plan: the plan in the best order, with the amounts of its adjustments.
        value: value of the objective [N, J or m].
        bound: lower bound of the objective over all orders.  It is 0 if the adjustments
            were optimised together.
        given: value for the order in the given plan; inf if it cannot be assembled.
        searched: number of computed sets or partial orders.
        method: ``"sets"`` or ``"orders"``.
    """

    plan: Plan
    value: float
    bound: float
    given: float
    searched: int
    method: str


def best_order(
    plan: Plan,
    posture: Posture,
    objective: Objective = "force",
    gravity: ArrayLike | None = None,
    progress: Callable[[int], None] = lambda done: None,
    most: int = MOST_STATES,
) -> BestOrder:
    """Return the order of the joining steps that minimises an objective.

    Args:
        plan: steps whose consecutive joins and adjustments are permuted.
        posture: pose at which the robot is assembled.
        objective: ``"force"`` for the largest closing force [N] of all steps,
            ``"energy"`` for the final energy [J], or ``"error"`` for the final
            translation error of the platform [m].
        gravity: (3,) [m/s^2] gravity in base axes.
        progress: function called with the number of computed states.
        most: maximum number of computed states.

    Returns:
        The best order found, with a lower bound of the objective.

    Raises:
        BadInput: the plan is inconsistent with the robot, or the robot cannot be
            assembled in any order.
    """
    check_plan(plan, posture.robot)
    machine = machine_at(posture)
    start = first_state(machine, plan, None, gravity)
    runs = [list(run) for _, run in groupby(plan.steps, lambda s: isinstance(s, Join))]
    search = _Search(machine, objective, progress, most)
    given = search.value_of(start, plan.steps)
    pinned = not any(map(order_matters, movable_runs(plan.steps)))
    if pinned and objective == "force":
        found = _over_sets(search, start, runs, given)
        if found.value < given * (1 - _EQUAL):
            return found
        return replace(found, plan=plan, value=given, bound=min(given, found.bound))
    found = _over_orders(search, start, plan, given)

    def many(count: int) -> State:
        errors = np.repeat(start.errors, count, axis=0)
        return first_state(machine, plan, errors, gravity)

    own = found.plan, machine, many, objective, found.value
    best, value = with_best_amounts(*own)
    bound = found.bound if value == found.value else 0.0
    return replace(found, plan=best, value=value, bound=bound)


@dataclass(eq=False)
class _Search:
    """Settings of a search, and the number of computed states."""

    machine: Machine
    objective: Objective
    progress: Callable[[int], None]
    most: int
    done: int = 0

    def carry_out(self, state: State, step: Step) -> tuple[State, StepResult] | None:
        """Return the state after a step and its result, or None if impossible."""
        self.done += 1
        self.progress(self.done)
        try:
            return carry_out(self.machine, state, step)
        except CannotAssemble:
            return None

    def closing_forces(
        self, start: State, run: list[Step], chosen: int
    ) -> list[tuple[int, float]]:
        """Return the closing force [N] of each closure in a set, if joined last."""
        self.done += 1
        self.progress(self.done)
        joined = [k for k in range(len(run)) if chosen >> k & 1]
        holds = dict(start.holds)
        for k in joined:
            step = run[k]
            assert isinstance(step, Join)
            assert not isinstance(step.part, str)
            holds[step.name] = closed_rows(self.machine, start, step.part)
        try:
            found = settle(self.machine, replace(start, holds=holds)).multipliers()
        except CannotAssemble:
            raise BadInput(
                "order: the robot cannot be assembled in any order"
            ) from None
        wrenches = [found[run[k].name][0] * self.machine.scale for k in joined]
        forces = [float(np.linalg.norm(wrench[3:])) for wrench in wrenches]
        return list(zip(joined, forces, strict=True))

    def value(self, peak: float, state: State) -> float:
        """Return the objective for a state and the peak force of its steps."""
        if self.objective == "force":
            return peak
        if self.objective == "energy":
            return float(state.found.energy[0])
        screw = self.machine.platform_screw(state.errors, state.found)[0]
        return float(np.linalg.norm(screw[3:]))

    def bound(self, peak: float, state: State, left: tuple[Step, ...]) -> float:
        """Return a lower bound on the objective after the remaining steps."""
        if self.objective == "force":
            return peak
        joins = [step for step in left if isinstance(step, Join)]
        if self.objective != "energy" or len(joins) < len(left) or state.loads:
            return 0.0
        holds = dict(state.holds)
        for step in joins:
            if not depends_on_state(step) and not isinstance(step.part, str):
                holds[step.name] = closed_rows(self.machine, state, step.part)
        try:
            closed = settle(self.machine, replace(state, holds=holds))
        except CannotAssemble:
            return inf
        return float(closed.found.energy[0])

    def value_of(self, state: State, steps: tuple[Step, ...]) -> float:
        """Return the objective for steps in a given order; inf if impossible."""
        peak = 0.0
        for step in steps:
            found = self.carry_out(state, step)
            if found is None:
                return inf
            state, peak = found[0], max(peak, _force(found[1]))
        return self.value(peak, state)


def _force(result: StepResult) -> float:
    """Return the closing force [N] of a step, or 0 if the step is not a join."""
    return float(result.closing_force[0]) if isinstance(result.step, Join) else 0.0


def _over_sets(
    search: _Search, state: State, runs: list[list[Step]], given: float
) -> BestOrder:
    """Return the best order if the state depends only on the set of joined closures."""
    steps: list[Step] = []
    peak = bound = 0.0
    for run in runs:
        if isinstance(run[0], Join):
            run, worst, least = _bottleneck(search, state, run)
            peak, bound = max(peak, worst), max(bound, least)
        for step in run:
            found = search.carry_out(state, step)
            if found is None:
                raise BadInput(
                    f"step {quoted(step.name)}: the robot cannot be assembled"
                )
            state = found[0]
        steps += run
    return BestOrder(Plan(tuple(steps)), peak, bound, given, search.done, "sets")


def _bottleneck(
    search: _Search, start: State, run: list[Step]
) -> tuple[list[Step], float, float]:
    """Return the order of joins with minimum peak force, this force and a lower bound.

    The search starts from the set of all closures and removes closures in the order of
    increasing peak force.  After ``search.most`` states, or after Ctrl-C, it always
    removes the closure with the smallest force.
    """
    chosen = (1 << len(run)) - 1
    best, later = {chosen: 0.0}, {chosen: -1}
    heap, bound = [(0.0, len(run), chosen)], 0.0
    try:
        while heap[0][2] and search.done < search.most:
            peak, _, chosen = heappop(heap)
            if peak > best[chosen]:
                continue
            bound = peak
            for k, force in search.closing_forces(start, run, chosen):
                left, worst = chosen & ~(1 << k), max(peak, force)
                if worst < best.get(left, inf):
                    best[left], later[left] = worst, k
                    heappush(heap, (worst, left.bit_count(), left))
        bound, _, chosen = heap[0]
    except KeyboardInterrupt:
        pass
    peak, order = best[chosen], _joined_after(chosen, later)
    while chosen:
        forces = search.closing_forces(start, run, chosen)
        k, force = min(forces, key=lambda pair: pair[1])
        chosen, peak, order = chosen & ~(1 << k), max(peak, force), [k, *order]
    return [run[k] for k in order], peak, bound


def _joined_after(chosen: int, later: dict[int, int]) -> list[int]:
    """Return the closures that are joined after a set, in the order of joining."""
    order = []
    while (k := later[chosen]) >= 0:
        order.append(k)
        chosen |= 1 << k
    return order


def _over_orders(search: _Search, start: State, plan: Plan, given: float) -> BestOrder:
    """Return the best order, found by depth-first branch and bound.

    The search stops after ``search.most`` states or after Ctrl-C.  The lower bound of
    the result then includes the bounds of all other orders.

    Raises:
        BadInput: no order can be assembled.
        KeyboardInterrupt: Ctrl-C was pressed before an order was found.
    """
    best, value = plan.steps, given
    stack: list[_Partial] = [(start, 0.0, (), plan.steps)]
    try:
        while stack and search.done < search.most:
            state, peak, done, left = stack[-1]
            if not left and search.value(peak, state) < value * (1 - _EQUAL):
                best, value = done, search.value(peak, state)
            children = []
            if left and search.bound(peak, state, left) < value:
                children = _children(search, *stack[-1])
            # the most promising partial order is searched first
            stack[-1:] = sorted(children, key=lambda c: -search.value(c[1], c[0]))
    except KeyboardInterrupt:
        if value == inf:
            raise
    if value == inf:
        raise BadInput("order: the robot cannot be assembled in any order")
    bounds = [search.bound(peak, state, left) for state, peak, _, left in stack]
    bound = min([value, *bounds])
    return BestOrder(
        replace(plan, steps=best), value, bound, given, search.done, "orders"
    )


def _children(
    search: _Search, state: State, peak: float, done: tuple[Step, ...],
    left: tuple[Step, ...],
) -> list[_Partial]:  # fmt: skip
    """Return a partial order extended by each step that may be next."""
    children = []
    for step, others in choices(left):
        found = search.carry_out(state, step)
        if found is not None:
            worst = max(peak, _force(found[1]))
            children.append((found[0], worst, (*done, step), others))
    return children
