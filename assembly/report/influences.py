"""Effect of the order of assembly steps on the assembled robot."""

from itertools import takewhile
from typing import Any

from forcefit.assembly.steps.influence import (
    Influence,
    depends_on_state,
    influences,
    why_order_matters,
)
from forcefit.assembly.steps.machine import Machine
from forcefit.assembly.steps.plan import Join, Plan
from forcefit.assembly.steps.state import State


def influences_among_joins(
    machine: Machine, state: State, plan: Plan, number: int
) -> list[Influence]:
    """Return the mutual influences of consecutive joining steps.

    Args:
        machine: the robot at its posture.
        state: state before the step.
        plan: assembly steps.
        number: index of the first joining step.

    Returns:
        The influences; empty if the previous step is also a joining step, or if no
        joint is in contact.
    """
    before = plan.steps[number - 1] if number else None
    if isinstance(before, Join) or not state.is_linear(machine):
        return []
    run = list(takewhile(lambda s: isinstance(s, Join), plan.steps[number:]))
    return influences(machine, state, [s for s in run if isinstance(s, Join)])


def about_influences(plan: Plan, found: list[Influence]) -> list[str]:
    """Return sentences on the order of the steps and on the loop openings they change.

    Args:
        plan: assembly steps.
        found: influences between joining steps.

    Returns:
        The sentences.
    """
    moved: dict[str, list[str]] = {pair.locked: [] for pair in found}
    for pair in found:
        moved[pair.locked] += [] if pair.zero else [pair.joined]
    still = [name for name, steps in moved.items() if not steps]
    if {s.name for s in plan.steps if depends_on_state(s)} == set(still):
        return [
            "the order of consecutive joins does not change the assembled machine: "
            f"they do not move the openings found by {', '.join(still)} (zero "
            "influence coefficients); it changes the closing forces"
        ]
    remarks = [about_order(plan)]
    for name, steps in moved.items():
        moving = (
            f"moved by {', '.join(steps)}" if steps else "moved by no adjacent join"
        )
        remarks.append(f"{name} fixes an opening in its current position, {moving}")
    return remarks


def influence_values(pair: Influence) -> dict[str, Any]:
    """Convert the influence between two joining steps to a dictionary.

    Args:
        pair: the influence.

    Returns:
        Values by name.
    """
    return {
        "locked": pair.locked, "joined": pair.joined, "zero": pair.zero,
        "free": pair.free, "coefficients": pair.coefficients,
    }  # fmt: skip


def about_order(plan: Plan) -> str:
    """Return a sentence on whether the result depends on the order of the steps.

    Args:
        plan: assembly steps.

    Returns:
        The sentence.
    """
    why = why_order_matters(plan)
    if why:
        return (
            f"the order matters: these steps fix parts in their current position: {why}"
        )
    return (
        "the order does not change the assembled machine, because every part is joined "
        "at a fixed position; it changes the closing forces"
    )
