"""HTML page on a stepwise assembly."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.closure import linearise
from forcefit.assembly.linear.load import no_loads
from forcefit.assembly.report.plot import displaced_bodies
from forcefit.assembly.report.scene import robot_scene
from forcefit.assembly.steps.machine import Machine
from forcefit.assembly.steps.state import State
from forcefit.page.charts import BLUE, RED, Axis, chart, grid
from forcefit.page.page import Page, Provenance, Tile, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, rotation_and_translation, table

_ASSUMED = (
    "Small screws at one pose: apart from contacts, every step is linear.",
    "There is no friction and no plastic deformation.",
    "Joints without contact forces stay as close as possible to their position "
    "after the previous step.",
)
_UNITS = {"force": "N", "energy": "J", "error": "m"}


def steps_page(
    results: Mapping[str, Any], machine: Machine, states: Sequence[State],
    provenance: Provenance,
) -> str:  # fmt: skip
    """Return the HTML page for the results of a stepwise assembly.

    Args:
        results: result of :func:`forcefit.assembly.report.steps.steps_of`.
        machine: the robot at its posture.
        states: states after each step.
        provenance: command line and input files.

    Returns:
        HTML that includes all data and scripts.
    """
    done = results["status"] == "ok"
    return page(
        Page(
            title=f"{results['robot']}: the order of assembly",
            verdict=_verdict(results),
            good=_good(results),
            tiles=_tiles(results) if done else [],
            about=f"{len(results['steps'])} steps.",
            body=[
                section("Steps", _table(results), _charts(results)),
                section("The machine", _scene(machine, states)) if states else "",
                _order(results),
                _machines(results),
            ],
            assumed=_ASSUMED,
            provenance=provenance,
            results=results,
        )
    )


def _verdict(results: Mapping[str, Any]) -> str:
    """Return a sentence on the success of the steps, and the first remark."""
    verdict = results.get("reason", "")
    if results["status"] == "ok":
        verdict = f"All {len(results['steps'])} steps are carried out"
    exceeded = sum(bool(step.get("exceeded")) for step in results["steps"])
    if exceeded:
        verdict += f", {exceeded} with more than the allowed force"
    return f"{verdict}; {results['remarks'][0]}."


def _good(results: Mapping[str, Any]) -> bool | None:
    """Return whether all steps succeed; None if a force limit is exceeded."""
    if results["status"] != "ok":
        return False
    return None if any(step.get("exceeded") for step in results["steps"]) else True


def _tiles(results: Mapping[str, Any]) -> list[Tile]:
    """Return tiles on the assembled robot."""
    screw = np.asarray(results["platform_screw"])
    peak, energy = results["peak_force"], results["energy"]
    turn, shift = np.linalg.norm(screw[:3]), np.linalg.norm(screw[3:])
    lost: list[str | Value] = [Value(results["lost"], "J"), " lost at releases."]
    return [
        Tile("Largest closing force", [Value(peak, "N")], ["of a step that joins."]),
        Tile("Elastic energy", [Value(energy, "J")], lost),
        Tile(
            "Platform error",
            rotation_and_translation(float(turn), float(shift)),
            ["of the assembled machine."],
        ),
    ]


def _table(results: Mapping[str, Any]) -> str:
    """Return a table with one row per step as HTML."""
    head: list[str | Column] = [
        "step", Column("energy", "J"), Column("work", "J"), Column("lost", "J"),
        Column("closing force", "N"), Column("closing moment", "N m"),
        Column("platform, rotation", "rad"), Column("platform, translation", "m"),
    ]  # fmt: skip
    rows: list[list[Cell]] = []
    for step in results["steps"]:
        screw = np.asarray(step["platform_screw"])
        name = step["name"] + (" (too much force)" if step.get("exceeded") else "")
        keys = ("energy", "work", "lost", "closing_force", "closing_moment")
        sizes = [float(np.linalg.norm(part)) for part in (screw[:3], screw[3:])]
        rows.append([name, *(step[key] for key in keys), *sizes])
    return table(head, rows, "steps")


def _charts(results: Mapping[str, Any]) -> str:
    """Return charts of energy and closing force over the steps as HTML."""
    numbers = list(range(1, len(results["steps"]) + 1))
    charts = []
    for key, words, unit, colour in (
        ("energy", "energy", "J", BLUE), ("closing_force", "closing force", "N", RED)
    ):  # fmt: skip
        trace = {
            "type": "bar", "x": numbers, "y": [s[key] for s in results["steps"]],
            "marker": {"color": colour},
        }  # fmt: skip
        caption = f"{words.capitalize()} after each step, in the order of the table."
        charts.append(chart([trace], Axis("step"), Axis(words, unit), caption))
    return grid(*charts)


def _scene(machine: Machine, states: Sequence[State]) -> str:
    """Return a 3D scene in which the user can select a step, as HTML."""
    assemblies = [assembly_of(machine, state) for state in states]
    closing = np.repeat(machine.posture.transforms[None], len(states), axis=0)
    for transforms, assembly in zip(closing, assemblies, strict=True):
        transforms[:, :3, 3] += displaced_bodies(assembly).end_screws[:, 3:]
    caption = (
        "Robot with magnified displacements; the control selects the step. Bodies that "
        "are not yet joined are free of forces."
    )
    return robot_scene(assemblies[-1], closing, None, caption)


def assembly_of(machine: Machine, state: State) -> Assembly:
    """Convert the state of a partly assembled robot to an assembly.

    Args:
        machine: the robot at its posture.
        state: the state of one robot.

    Returns:
        The assembly. Loops that are not yet joined are open.
    """
    posture, found = machine.posture, state.found
    robot = posture.robot.with_errors(state.errors[0].reshape(-1, 6))
    multipliers = np.zeros((len(robot.closures), 6))
    for name, own in state.multipliers().items():
        hold = state.holds[name]
        if not isinstance(hold.part, str):
            row = robot.closures.index(hold.part)
            path = posture.paths[robot.index(hold.part[0])]
            wrench = np.linalg.solve(path.T, own[0] * machine.scale)
            multipliers[row] = wrench / machine.scale
    return Assembly(
        linearisation=linearise(replace(posture, robot=robot)), joints=machine.joints,
        load=np.zeros(6), frame_loads=no_loads(robot.errors.size),
        elastic=found.springs[0], clearances=found.clearances[0],
        motions=machine.free_size * found.motions[0],
        multipliers=multipliers.ravel(), energy_without_clearance=0.0,
        method="reference",
    )  # fmt: skip


def _order(results: Mapping[str, Any]) -> str:
    """Return the section on the search for the best order, if any."""
    order = results.get("order")
    if order is None:
        return ""
    unit = _UNITS[order["objective"]]
    parts: list[str | Value] = [
        f"Minimum {order['objective']}: ", Value(order["value"], unit),
        "; in any order at least ", Value(order["bound"], unit),
    ]  # fmt: skip
    if order["given"] is not None:
        parts += ["; in the given order ", Value(order["given"], unit)]
    names = ", ".join(order["steps"])
    return section("The best order", paragraph(*parts, "."), paragraph(f"{names}."))


def _machines(results: Mapping[str, Any]) -> str:
    """Return the section on quantiles over many robots, if any."""
    if "quantiles" not in results:
        return ""
    head: list[str | Column] = [
        "step", Column("force, median", "N"), Column("force, 95 %", "N"),
        Column("energy, 95 %", "J"), Column("rotation, 95 %", "rad"),
        Column("translation, 95 %", "m"),
    ]  # fmt: skip
    rows: list[list[Cell]] = [
        [
            name, q["closing_force"]["0.5"], q["closing_force"]["0.95"],
            q["energy"]["0.95"], q["rotation"]["0.95"], q["translation"]["0.95"],
        ]
        for name, q in results["quantiles"].items()
    ]  # fmt: skip
    return section(f"{results['draws']} machines", table(head, rows, "machines"))
