"""Results of a stepwise assembly as a dictionary and as text."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import failure_status
from forcefit.assembly.linear.reference.energy import CannotAssemble
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.statuses import OK
from forcefit.assembly.report.influences import (
    about_influences,
    about_order,
    influence_values,
    influences_among_joins,
)
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.steps.influence import Influence
from forcefit.assembly.steps.machine import Machine, machine_at
from forcefit.assembly.steps.plan import Adjust, Fix, Join, Plan, Preload, Release, Step
from forcefit.assembly.steps.run import StepResult, carry_out
from forcefit.assembly.steps.search import BestOrder
from forcefit.assembly.steps.state import State, first_state
from forcefit.inputs.errors import quoted
from forcefit.results.display import listing, numbers
from forcefit.results.text import lines_of

QUANTILES = (0.05, 0.5, 0.95, 0.99)
_BLOCK = 2_000  # number of robots that are computed together
_IN_CLEARANCES = (
    "joints without contact forces stay as close as possible to their position after "
    "the previous step; a clamp or a load determines their position"
)
_ADJUSTED = (
    "an adjustment to a frame or under loads is the better of two local minima: one "
    "near the present error, and one near the optimum for constant contacts"
)


def steps_of(
    plan: Plan, posture: Posture, gravity: ArrayLike | None = None,
    best: BestOrder | None = None, objective: str = "",
    states: list[State] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Compute the results of ``assembly steps`` as a dictionary.

    Args:
        plan: assembly steps, which have been checked.
        posture: pose at which the robot is assembled.
        gravity: (3,) [m/s^2] gravity in base axes.
        best: result of a search for the best order, which replaces ``plan``.
        objective: objective of that search.
        states: list to which the state after each step is appended.

    Returns:
        Results of all steps until the first failure. ``status`` is ``"ok"`` or the type
        of failure.
    """
    plan = plan if best is None else best.plan
    machine = machine_at(posture)
    results: dict[str, Any] = {
        "robot": posture.robot.name, "status": OK, "pose": posture.pose(),
        "remarks": [about_order(plan)], "steps": [],
    }  # fmt: skip
    if machine.cones.shape[1]:
        results["remarks"].append(_IN_CLEARANCES)
        if any(isinstance(step, Adjust) for step in plan.steps):
            results["remarks"].append(_ADJUSTED)
    if best is not None:
        results["order"] = {
            "objective": objective, "value": best.value, "bound": best.bound,
            "given": best.given if np.isfinite(best.given) else None,
            "searched": best.searched, "steps": [step.name for step in plan.steps],
        }  # fmt: skip
    try:
        state = first_state(machine, plan, None, gravity)
        results["first_energy"] = float(state.found.energy[0])
        found: list[Influence] = []
        for number, step in enumerate(plan.steps):
            found += influences_among_joins(machine, state, plan, number)
            state, result = carry_out(machine, state, step)
            results["steps"].append(_values(result))
            if states is not None:
                states.append(state)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        failed = plan.steps[len(results["steps"])].name
        reason = f"step {quoted(failed)}: {error}"
        return results | {"status": failure_status(error), "reason": reason}
    if found:
        results["remarks"][:1] = about_influences(plan, found)
        results["influences"] = [influence_values(pair) for pair in found]
    return results | _totals(results)


def kind_of(step: Step) -> str:
    """Return the kind of a step as in a plan file."""
    kinds = {Join: "join", Preload: "preload", Release: "release", Adjust: "adjust"}
    if isinstance(step, Fix):
        return step.kind
    return kinds.get(type(step), "measure")


def _values(result: StepResult) -> dict[str, Any]:
    """Convert the result of a step for one robot to a dictionary."""
    values: dict[str, Any] = {
        "name": result.step.name, "kind": kind_of(result.step),
        "energy": float(result.energy[0]), "work": float(result.work[0]),
        "load_work": float(result.load_work[0]), "lost": float(result.lost[0]),
        "closing_force": float(result.closing_force[0]),
        "closing_moment": float(np.linalg.norm(result.closing_wrench[0, :3])),
        "closing_wrench": result.closing_wrench[0], "opening": result.opening[0],
        "platform_screw": result.platform_screw[0],
        "wrenches": {name: w[0] for name, w in result.wrenches.items()},
    }  # fmt: skip
    if np.any(result.left_open):
        values["left_open"] = result.left_open[0]
    if result.exceeded.any():
        values["exceeded"] = True
    if isinstance(result.step, Release):
        values["spring_back"] = result.spring_back[0]
    if result.reading.size:
        values["reading"] = result.reading[0]
    if result.adjustment.size:
        values["adjustment"] = result.adjustment[0]
    return values


def _totals(results: dict[str, Any]) -> dict[str, Any]:
    """Return the energy balance and the results for the assembled robot."""
    steps = results["steps"]
    work = sum(step["work"] + step["load_work"] for step in steps)
    lost = sum(step["lost"] for step in steps)
    return {
        "work": work, "lost": lost, "energy": steps[-1]["energy"],
        "peak_force": max(
            (s["closing_force"] for s in steps if s["kind"] == "join"), default=0.0
        ),
        "platform_screw": steps[-1]["platform_screw"],
    }  # fmt: skip


def drawn_steps(
    plan: Plan, posture: Posture, errors: NDArray, gravity: ArrayLike | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:  # fmt: skip
    """Compute quantiles of the results over many robots with random errors.

    After Ctrl-C, quantiles are computed for the robots that have been assembled.

    Args:
        plan: assembly steps, which have been checked.
        posture: pose at which the robot of n frames is assembled.
        errors: (k, n, 6) [rad, m] geometric errors of the robots.
        gravity: (3,) [m/s^2] gravity in base axes.
        progress: function called with the number of finished robots and the number of
            all robots.

    Returns:
        ``draws``, the number of robots, and ``quantiles`` by step and quantity.

    Raises:
        CannotAssemble: the constraints on rigid bodies of a robot contradict each
            other.
        FreeMotion: a load acts along a motion that nothing resists.
        KeyboardInterrupt: Ctrl-C was pressed before a robot was assembled.
        SolverFailed: the solver for the clearances did not converge.
    """
    machine = machine_at(posture)
    blocks: list[dict[tuple[str, str], NDArray]] = []
    try:
        for first in range(0, len(errors), _BLOCK):
            some = errors[first : first + _BLOCK]
            blocks.append(_drawn_block(machine, plan, some, gravity))
            progress(first + len(some), len(errors))
    except KeyboardInterrupt:
        if not blocks:
            raise
    quantiles: dict[str, dict[str, dict[str, float]]] = {}
    for step, name in blocks[0]:
        values = np.concatenate([block[step, name] for block in blocks])
        found = np.quantile(values, QUANTILES).tolist()
        named = {f"{q:g}": v for q, v in zip(QUANTILES, found, strict=True)}
        quantiles.setdefault(step, {})[name] = named
    return {"draws": len(values), "quantiles": quantiles}


def _drawn_block(
    machine: Machine, plan: Plan, errors: NDArray, gravity: ArrayLike | None
) -> dict[tuple[str, str], NDArray]:
    """Compute the results of a block of robots by step and quantity."""
    state, values = first_state(machine, plan, errors, gravity), {}
    for step in plan.steps:
        state, result = carry_out(machine, state, step)
        screw = result.platform_screw
        for name, found in (
            ("energy", result.energy), ("closing_force", result.closing_force),
            ("rotation", np.linalg.norm(screw[:, :3], axis=1)),
            ("translation", np.linalg.norm(screw[:, 3:], axis=1)),
        ):  # fmt: skip
            values[step.name, name] = found
    return values


def steps_text(results: dict[str, Any]) -> str:
    """Format the results of :func:`steps_of` as text.

    Args:
        results: result of :func:`steps_of`.

    Returns:
        The text.
    """
    about = lines_of(results, "pose status reason")
    lines = [listing(results["robot"], about, results["remarks"])]
    order = results.get("order")
    if order is not None:
        unit = {"force": "N", "energy": "J", "error": "m"}[order["objective"]]
        given = "none" if order["given"] is None else f"{order['given']:.4g} {unit}"
        lines.append(
            f"minimum {order['objective']} {order['value']:.4g} {unit} (at least "
            f"{order['bound']:.4g} in any order, {given} in the given order)"
        )
    head = ("step", "energy [J]", "work [J]", "lost [J]", "force [N]", "moment [N m]")
    table = [head]
    for step in results["steps"]:
        keys = ("energy", "work", "lost", "closing_force", "closing_moment")
        table.append((step["name"], *(f"{step[key]:.4g}" for key in keys)))
    widths = [max(len(row[i]) for row in table) for i in range(len(head))]
    for row, step in zip(table, [None, *results["steps"]], strict=True):
        cells = [row[0].ljust(widths[0])]
        cells += [cell.rjust(w) for cell, w in zip(row[1:], widths[1:], strict=True)]
        lines.append("  ".join(cells) + ("" if step is None else _extra(step)))
    if "peak_force" in results:
        lines.append(
            f"assembled: energy {results['energy']:.4g} J, peak force "
            f"{results['peak_force']:.4g} N, platform error "
            f"{numbers(results['platform_screw'])} [rad, m]"
        )
    for step_name, quantiles in results.get("quantiles", {}).items():
        force, shift = quantiles["closing_force"], quantiles["translation"]
        lines.append(
            f"{results['draws']} machines, {step_name}: force 95 % "
            f"{force['0.95']:.4g} N, translation 95 % {shift['0.95']:.4g} m"
        )
    return "\n".join(lines)


def _extra(step: dict[str, Any]) -> str:
    """Format the results that exist only for some kinds of steps."""
    words = {
        "reading": "reads", "adjustment": "changed by", "left_open": "left open",
        "spring_back": "springs back",
    }  # fmt: skip
    parts = [f"{word} {numbers(step[k])}" for k, word in words.items() if k in step]
    parts += ["more than the allowed force"] if step.get("exceeded") else []
    return f"  {'; '.join(parts)}" if parts else ""
