"""Command group ``forcefit assembly``, with the command ``error``."""

from typing import Annotated

import typer

from forcefit.commands.answer import answer
from forcefit.commands.deflection import deflection
from forcefit.commands.frequencies import frequencies
from forcefit.commands.help import Commands
from forcefit.commands.options import (
    AlongOption,
    AtOption,
    DriveForceOption,
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
    parse_point,
)
from forcefit.commands.path import path
from forcefit.commands.platform_stiffness import stiffness
from forcefit.commands.plot import plot
from forcefit.commands.progress import one_thread
from forcefit.commands.show import show
from forcefit.commands.solve import solve
from forcefit.commands.statistics import statistics, tolerances
from forcefit.commands.steps import steps
from forcefit.commands.sweep import sweep
from forcefit.inputs.errors import BadInput, nearest

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
            help="Assumption about open clearances: frozen | free | budget. Default: "
            "all three, or frozen and free if a load is given."
        ),
    ] = None,
    load: LoadOption = None,
    drive_force: DriveForceOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    energy_budget: Annotated[
        float,
        typer.Option(
            help="Relative energy margin eta of the budget assumption: "
            "E <= (1 + eta) E*."
        ),
    ] = 0.05,
    tolerance_rotation: Annotated[
        float,
        typer.Option(
            help="[rad] Largest accepted gap between the upper and lower rotation "
            "bounds."
        ),
    ] = 1e-6,
    tolerance_translation: Annotated[
        float,
        typer.Option(
            help="[m] Largest accepted gap between the upper and lower translation "
            "bounds."
        ),
    ] = 1e-6,
    at: AtOption = None,
    along: AlongOption = None,
    json: JsonOption = None,
) -> None:
    """Bound the pose error from above and below, problem (27)."""
    from forcefit.assembly.linear.reference.pose_error import ASSUMPTIONS
    from forcefit.assembly.model.largest import LARGEST_LENGTH
    from forcefit.assembly.report.pose_errors import pose_error_of, pose_error_text

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
        robot, pose, joint, load, gravity, under, rest=rest, mismatch=mismatch,
        drive_force=drive_force,
    )  # fmt: skip
    with one_thread():
        results = pose_error_of(
            applied.posture, assumption or None,
            load=applied.load, gravity=applied.gravity,
            point=parse_point(at),
            direction=parse_direction(along), **options,
        )  # fmt: skip
    answer(results, pose_error_text(results), results["status"], json)


for command in (
    show, stiffness, deflection, frequencies, path, statistics, tolerances, sweep,
    steps, plot,
):  # fmt: skip
    app.command()(command)
