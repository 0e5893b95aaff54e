"""The commands ``forcefit assembly ...``: parse, call one function, print or save."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.answer import answer
from forcefit.commands.deflection import deflection
from forcefit.commands.frequencies import frequencies
from forcefit.commands.help import Commands
from forcefit.commands.options import (
    AlongOption,
    AtOption,
    GravityOption,
    JointOption,
    JsonOption,
    LoadOption,
    MismatchOption,
    PoseOption,
    RestOption,
    RobotArgument,
    UnderOption,
    declared_under,
    parse_direction,
    parse_load,
    parse_point,
    posture_of,
)
from forcefit.commands.platform_stiffness import stiffness
from forcefit.commands.plot import plot
from forcefit.commands.progress import one_thread
from forcefit.commands.solve import solve
from forcefit.commands.statistics import statistics, tolerances
from forcefit.commands.steps import steps
from forcefit.commands.sweep import sweep
from forcefit.inputs.errors import BadInput, checked, nearest
from forcefit.inputs.writing import (
    PIXELS,
    check_writable,
    save_pixels,
)

app = Commands(no_args_is_help=True)
app.command()(solve)


@app.command()
def error(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    assumption: Annotated[
        list[str] | None,
        typer.Option(
            help="Assumption on the clearances: frozen | free | budget. Default: all; "
            "under a load frozen and free."
        ),
    ] = None,
    load: LoadOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    energy_budget: Annotated[
        float, typer.Option(help="eta of the budget assumption: E <= (1 + eta) E*.")
    ] = 0.05,
    tolerance_rotation: Annotated[
        float, typer.Option(help="[rad] Largest difference of upper and lower bound.")
    ] = 1e-6,
    tolerance_translation: Annotated[
        float, typer.Option(help="[m] Largest difference of upper and lower bound.")
    ] = 1e-6,
    at: AtOption = None,
    along: AlongOption = None,
    json: JsonOption = None,
) -> None:
    """Bound the largest pose error, problem (27)."""
    from assembly.linear.reference.pose_error import ASSUMPTIONS
    from assembly.model.largest import LARGEST_LENGTH
    from assembly.report.pose_errors import pose_error_of, pose_error_text

    for name in assumption or ():
        if name not in ASSUMPTIONS:
            hint = nearest(name, ASSUMPTIONS)
            raise BadInput(f'--assumption: found "{name[:60]}"{hint}')
    options = {
        "energy_budget": energy_budget,
        "tolerance_rotation": tolerance_rotation,
        "tolerance_translation": tolerance_translation,
    }
    for key, value in options.items():
        if not 0 < value <= LARGEST_LENGTH:
            option = "--" + key.replace("_", "-")
            expected = f"a finite number > 0, at most {LARGEST_LENGTH:g}"
            raise BadInput(f"{option}: found {value}, expected {expected}")
    applied = declared_under(
        robot, pose, joint, load, gravity, under, rest=rest, mismatch=mismatch
    )
    with one_thread():
        results = pose_error_of(
            applied.posture, assumption or None,
            load=applied.load, gravity=applied.gravity,
            point=parse_point(at),
            direction=parse_direction(along), **options,
        )  # fmt: skip
    answer(results, pose_error_text(results), results["status"], json)


@app.command()
def show(
    robot: RobotArgument,
    figure: Annotated[
        Path | None,
        typer.Option(
            "--figure",
            help="Picture to write: PNG, JPEG, BMP or TIFF; without it a window opens.",
        ),
    ] = None,
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    load: LoadOption = None,
    exaggeration: Annotated[
        float | None, typer.Option(help="Factor on displacements.")
    ] = None,
    error_body: Annotated[
        str | None,
        typer.Option(
            help="Also show the set of possible platform errors: translation | "
            "rotation."
        ),
    ] = None,
    assumption: Annotated[
        str | None,
        typer.Option(
            help="Assumption of that set: frozen | free | budget. Default: budget; "
            "under a load frozen."
        ),
    ] = None,
) -> None:
    """Plot the nominal and the forced robot, and its errors."""
    from assembly.linear.energy import CannotAssemble, failure_status, solve_assembly
    from assembly.linear.reference.pose_error import ASSUMPTIONS
    from assembly.linear.reference.reduction import FreeMotion
    from assembly.report.error_body import PARTS
    from assembly.report.plot import plot_assembly
    from assembly.report.results import remark_lines
    from assembly.solvers.conic import SolverFailed

    if figure is not None:
        check_writable(figure, PIXELS)
    elif not (os.environ.get("DISPLAY") or sys.platform in {"win32", "darwin"}):
        raise BadInput("no display to open a window on; name a file with --figure")
    for option, value, valid in (
        ("--error-body", error_body, PARTS), ("--assumption", assumption, ASSUMPTIONS)
    ):  # fmt: skip
        if value is not None and value not in valid:
            raise BadInput(f'{option}: found "{value[:60]}"{nearest(value, valid)}')
    if exaggeration is not None:
        checked("--exaggeration", exaggeration, "1", above=0)
    wrench = parse_load(load)
    loaded = wrench is not None and any(wrench)
    if loaded and error_body is not None and assumption == "budget":
        raise BadInput(
            "--assumption: found budget together with --load, but the budget bound "
            "is defined for a robot without load; expected frozen or free"
        )
    assumption = assumption or ("frozen" if loaded else "budget")
    posture = posture_of(robot, pose, joint, rest, mismatch)
    for line in remark_lines(posture.robot.remarks):
        print(line)
    try:
        assembly = solve_assembly(posture, wrench)
        plotter = plot_assembly(
            assembly, exaggeration, error_body, assumption, figure is not None
        )
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        print(f"{failure_status(error)}: {error}")
        raise typer.Exit(1) from None
    if figure is None:
        plotter.show()
    else:
        save_pixels(plotter.screenshot(return_img=True), figure)
    plotter.close()


for command in (
    stiffness, deflection, frequencies, statistics, tolerances, sweep, steps, plot
):  # fmt: skip
    app.command()(command)
