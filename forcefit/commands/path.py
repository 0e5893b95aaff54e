"""Command ``forcefit assembly path``: compute errors due to inertia along a path."""

import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from forcefit.commands.answer import answer
from forcefit.commands.options import (
    DriveForceOption,
    FigureOption,
    GravityOption,
    JsonOption,
    LoadOption,
    MismatchOption,
    RestOption,
    RobotArgument,
    UnderOption,
    note_closing,
    parse_assignments,
    parse_covariates,
    parse_gravity,
    parse_load,
    parse_state,
)
from forcefit.commands.progress import one_thread, progress_lines
from forcefit.commands.report import ReportOption, provenance
from forcefit.inputs.writing import (
    PICTURE,
    check_writable,
    save_figure,
    write_text,
)


def path(
    robot: RobotArgument,
    path: Annotated[
        Path,
        typer.Option(
            help="CSV table of the path, with columns pose.tx .. or q.<frame>, and "
            "optionally time [s] and id."
        ),
    ],
    profile: Annotated[
        str | None,
        typer.Option(
            help="Rest-to-rest motion profile: quintic | seventh | trapezoid."
        ),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(help="[s] Duration of the motion with a profile.")
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Maximum speed with a profile: of the platform [m/s], or of the "
            "drives [rad/s or m/s]."
        ),
    ] = None,
    acceleration: Annotated[
        float | None,
        typer.Option(
            help="Maximum acceleration with a profile: of the platform [m/s^2], or of "
            "the drives [rad/s^2 or m/s^2]."
        ),
    ] = None,
    interval: Annotated[
        float | None,
        typer.Option(help="[s] Time between rows, for a table without times."),
    ] = None,
    ends: Annotated[
        str,
        typer.Option(
            help="State at both ends of a path with times: rest (zero speed and "
            "acceleration) | moving."
        ),
    ] = "rest",
    points: Annotated[
        int, typer.Option(help="Number of equally spaced instants to compute.")
    ] = 201,
    load: LoadOption = None,
    gravity: GravityOption = None,
    assumption: Annotated[
        str,
        typer.Option(
            help="Also bound the pose error, problem (27): frozen | free | none."
        ),
    ] = "none",
    state: Annotated[
        str,
        typer.Option(
            help="State for the platform compliance: nominal (clearances at zero) | "
            "contact (errors, loads, clearances) | exact (finite motions)."
        ),
    ] = "nominal",
    drive_force: DriveForceOption = None,
    under: UnderOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Also write all results (NetCDF)."),
    ] = None,
    figure: FigureOption = None,
    report: ReportOption = None,
    json: JsonOption = None,
) -> None:
    """Compute pose errors due to inertia along a path.

    The robot file must declare the masses of the bodies.  Vibration is neglected.  With
    -o, an interrupted computation resumes when the command is run again.
    """
    from forcefit.assembly.model.largest import LARGEST
    from forcefit.assembly.path.request import errors_along_path
    from forcefit.assembly.path.summary import path_summary, path_text
    from forcefit.assembly.sweeps.dataset import check_dataset

    if output is not None:
        check_dataset(output, "a path")
    if figure is not None:
        check_writable(figure, PICTURE)
    wrench, g = parse_load(load), parse_gravity(gravity)
    forces = drive_force and parse_assignments(drive_force, "--drive-force", LARGEST)
    machine, source = _closed(robot, rest, mismatch), provenance(robot, path)
    with one_thread(), progress_lines() as update, _resumable(output) as note:
        errors = errors_along_path(
            machine, path, profile=profile, duration=duration, speed=speed,
            acceleration=acceleration, interval=interval, ends=ends, points=points,
            load=wrench, gravity=g, assumption=assumption,
            state=parse_state(state), drive_force=forces or None,
            under=parse_covariates(under), output=output, command=source.command,
            progress=lambda done, total: update("points", note(done), total),
        )  # fmt: skip
    summary = path_summary(errors)
    if output is not None:
        summary["output"] = str(output)
    _write(summary, errors, source, figure, report)
    answer(summary, path_text(summary), summary["status"], json)


def _closed(robot: str, rest: str | None, mismatch: str | None) -> Any:
    """Load the robot and close its loops as specified by the options."""
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.assembly.kinematics.closing import closing_of

    machine = load_robot(robot, closing_of(rest, mismatch))
    note_closing(machine, rest, mismatch)
    return machine


@contextmanager
def _resumable(output: Path | None) -> Generator[Callable[[int], int], None, None]:
    """Yield a counter of finished points; after Ctrl-C, print how to resume."""
    done = [0]

    def note(finished: int) -> int:
        done[0] = finished
        return finished

    try:
        yield note
    except KeyboardInterrupt:
        if output is None:
            raise
        from forcefit.assembly.sweeps.sweep import journal_path

        print(
            f"forcefit: interrupted; {done[0]} points are stored in "
            f"{journal_path(output)}: run the same command again to continue",
            file=sys.stderr,
        )
        raise typer.Exit(130) from None


def _write(
    summary: dict[str, Any], errors: Any, source: Any, figure: Path | None,
    report: Path | None,
) -> None:  # fmt: skip
    """Write the figure and the report, if requested."""
    from forcefit.assembly.path.report import path_page, plot_path

    if figure is not None:
        save_figure(plot_path(errors), figure)
    if report is not None:
        write_text(path_page(summary, errors, source), report)
