"""Command ``forcefit assembly frequencies``."""

from typing import Annotated

import typer

from forcefit.commands.answer import answer
from forcefit.commands.options import (
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
    parse_state,
)
from forcefit.commands.progress import one_thread


def frequencies(
    robot: RobotArgument,
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    load: LoadOption = None,
    drive_force: DriveForceOption = None,
    gravity: GravityOption = None,
    under: UnderOption = None,
    state: Annotated[
        str,
        typer.Option(
            help="nominal (clearances at zero) | exact (around the equilibrium with "
            "errors, clearances and loads)."
        ),
    ] = "nominal",
    count: Annotated[int, typer.Option(help="Number of modes.", min=1, max=1000)] = 6,
    json: JsonOption = None,
) -> None:
    """Compute natural frequencies and modes with locked drives.

    The robot file must declare the masses of the bodies.
    """
    from forcefit.assembly.report.vibration import vibration_of, vibration_text

    word = parse_state(state, ("nominal", "exact"))
    applied = declared_under(
        robot, pose, joint, load, gravity, under, finite=word == "exact", rest=rest,
        mismatch=mismatch, drive_force=drive_force,
    )  # fmt: skip
    with one_thread():
        results = vibration_of(
            applied.posture, count, applied.load, applied.gravity, word
        )
    answer(results, vibration_text(results), results["status"], json)
