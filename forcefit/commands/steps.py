"""Command ``forcefit assembly steps``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forcefit.commands.answer import answer
from forcefit.commands.options import (
    GravityOption,
    JointOption,
    JsonOption,
    MismatchOption,
    PoseOption,
    RestOption,
    RobotArgument,
    SeedOption,
    declared_posture,
    parse_gravity,
)
from forcefit.commands.progress import one_thread, progress_lines
from forcefit.commands.report import ReportOption, provenance
from forcefit.inputs.errors import BadInput, nearest
from forcefit.inputs.writing import write_text

if TYPE_CHECKING:
    from forcefit.assembly.steps.state import State


def steps(
    robot: RobotArgument,
    plan: Annotated[Path, typer.Argument(help="Assembly steps (TOML).")],
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    gravity: GravityOption = None,
    best: Annotated[
        str | None,
        typer.Option(
            help="Find the order of the joining steps that minimises: force (maximum "
            "closing force) | energy (final energy) | error (final translation error "
            "of the platform)."
        ),
    ] = None,
    errors: Annotated[
        Path | None,
        typer.Option(help="Error distributions of a series of machines (TOML)."),
    ] = None,
    draws: Annotated[
        int | None,
        typer.Option(help="Number of machines with random errors.", min=1, max=10**7),
    ] = None,
    seed: SeedOption = 1,
    report: ReportOption = None,
    json: JsonOption = None,
) -> None:
    """Simulate the assembly of the robot step by step.

    Each step computes an equilibrium, starting from that of the previous step.  The
    results are closing forces, energies, spring-back on release, and locked-in
    wrenches.
    """
    from forcefit.assembly.effects.robot_effects import (
        errors_of_effects,
        with_effects_applied,
    )
    from forcefit.assembly.files.step_file import read_steps
    from forcefit.assembly.model.error_distributions import read_sources
    from forcefit.assembly.report.steps import drawn_steps, steps_of, steps_text
    from forcefit.assembly.report.steps_page import steps_page
    from forcefit.assembly.steps.machine import machine_at
    from forcefit.assembly.steps.search import OBJECTIVES, best_order

    if (errors is None) != (draws is None):
        raise BadInput("steps: found only one of --errors and --draws, expected both")
    declared = declared_posture(robot, pose, joint, rest, mismatch)
    posture = with_effects_applied(declared)
    asked, g = read_steps(plan, posture.robot), parse_gravity(gravity)
    sources = None
    if errors is not None:
        fixed = errors_of_effects(declared, posture)
        sources = read_sources(errors, posture.robot, fixed)
    order = None
    states: list[State] = []
    with one_thread():
        if best is not None:
            if best not in OBJECTIVES:
                raise BadInput(
                    f'--best: found "{best[:60]}"{nearest(best, OBJECTIVES)}'
                )
            with progress_lines() as update:
                order = best_order(
                    asked, posture, best, g, lambda done: update("orders", done, done)
                )
        results = steps_of(asked, posture, g, order, best or "", states)
        if sources is not None and draws is not None and results["status"] == "ok":
            drawn = sources.errors(sources.draw(0, draws, seed))
            carried = asked if order is None else order.plan
            with progress_lines() as update:
                results |= drawn_steps(
                    carried, posture, drawn, g, lambda d, n: update("machines", d, n)
                )
    if report is not None:
        machine, source = machine_at(posture), provenance(robot, plan, errors)
        write_text(steps_page(results, machine, states, source), report)
    answer(results, steps_text(results), results["status"], json)
