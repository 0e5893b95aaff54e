"""Command ``forcefit assembly show``."""

import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from forcefit.commands.options import (
    DriveForceOption,
    JointOption,
    JsonOption,
    LoadOption,
    MismatchOption,
    PoseOption,
    RestOption,
    RobotArgument,
    parse_load,
    posture_of,
)
from forcefit.inputs.animation import ANIMATION, save_animation
from forcefit.inputs.errors import BadInput, checked, nearest
from forcefit.inputs.packages import need
from forcefit.inputs.writing import (
    PAGE,
    PIXELS,
    check_writable,
    save_pixels,
    write_json,
    write_text,
)


def show(
    robot: RobotArgument,
    figure: Annotated[
        Path | None,
        typer.Option(
            "--figure",
            help="Output file: PNG, JPEG, BMP, TIFF, GIF (with --closing) or HTML (an "
            "interactive scene). Without --figure and --json, a window opens.",
        ),
    ] = None,
    closing: Annotated[
        bool,
        typer.Option(
            "--closing",
            help="Animate how the loops close, from the unassembled bodies with "
            "geometric errors to the minimum-energy assembly.",
        ),
    ] = False,
    pose: PoseOption = None,
    joint: JointOption = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    load: LoadOption = None,
    drive_force: DriveForceOption = None,
    exaggeration: Annotated[
        float | None, typer.Option(help="Scale factor for displacements.")
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
            help="Assumption about open clearances for --error-body: frozen | free | "
            "budget. Default: budget, or frozen if a load is given."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Plot the robot and its errors; print its mobility.

    Both the nominal and the assembled robot are drawn.  With --json but without
    --figure, nothing is drawn.
    """
    from forcefit.assembly.linear.energy import (
        CannotAssemble,
        failure_status,
        solve_assembly,
    )
    from forcefit.assembly.linear.reference.pose_error import ASSUMPTIONS
    from forcefit.assembly.linear.reference.reduction import FreeMotion
    from forcefit.assembly.report.error_body import PARTS
    from forcefit.assembly.report.mobility import shown_of, shown_text
    from forcefit.assembly.report.plot_closing import closing_pictures
    from forcefit.assembly.solvers.conic import SolverFailed

    drawn = figure is not None or json is None
    scene = figure is not None and not closing and _is_page(figure)
    if figure is not None:
        check_writable(figure, ANIMATION if closing else PAGE if scene else PIXELS)
    elif closing:
        raise BadInput("--closing: found no --figure, expected --figure FILE.gif")
    if closing and error_body is not None:
        raise BadInput(
            "--closing: found together with --error-body, expected only one of the two"
        )
    for option, value, valid in (
        ("--error-body", error_body, PARTS), ("--assumption", assumption, ASSUMPTIONS)
    ):  # fmt: skip
        if value is not None and value not in valid:
            raise BadInput(f'{option}: found "{value[:60]}"{nearest(value, valid)}')
    if exaggeration is not None:
        if scene:
            raise BadInput(
                "--exaggeration: found together with an HTML figure, in which a slider "
                "sets the factor; expected a different file format"
            )
        checked("--exaggeration", exaggeration, "1", above=0)
    wrench = parse_load(load)
    loaded = bool(drive_force) or (wrench is not None and any(wrench))
    if loaded and error_body is not None and assumption == "budget":
        raise BadInput(
            "--assumption: found budget together with a load, but the budget bound "
            "is defined only for an unloaded robot; expected frozen or free"
        )
    assumption = assumption or ("frozen" if loaded else "budget")
    posture = posture_of(robot, pose, joint, rest, mismatch, drive_force=drive_force)
    results = shown_of(posture)
    if drawn and not scene:
        need("pyvista")
    write_json(results, json)
    if json != "-":
        print(shown_text(results))
    if not drawn:
        return
    display = os.environ.get("DISPLAY") or sys.platform in {"win32", "darwin"}
    if figure is None and not display:
        raise BadInput("no display to open a window on; name a file with --figure")
    try:
        assembly = solve_assembly(posture, wrench)
        if closing and figure is not None:
            save_animation(closing_pictures(assembly, exaggeration), figure)
        elif figure is not None and scene:
            _write_scene(assembly, figure, error_body, assumption)
        else:
            _draw(assembly, figure, exaggeration, error_body, assumption)
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        print(f"{failure_status(error)}: {error}")
        raise typer.Exit(1) from None


def _is_page(path: Path) -> bool:
    """Return whether the file extension denotes an HTML page."""
    return path.suffix.lower() in PAGE.endings


def _write_scene(
    assembly: Any, figure: Path, error_body: str | None, assumption: str
) -> None:
    """Write the interactive scene, as used in reports, to its own HTML page."""
    from forcefit.assembly.report.show import show
    from forcefit.page.picture import Picture

    shown = show(assembly, errors=error_body, assumption=assumption, interactive=True)
    assert isinstance(shown, Picture)  # because the scene is interactive
    write_text(shown.html, figure)


def _draw(
    assembly: Any, figure: Path | None, exaggeration: float | None,
    error_body: str | None, assumption: str,
) -> None:  # fmt: skip
    """Write the picture to a file, or show it in a window."""
    from forcefit.assembly.report.plot import plot_assembly

    plotter = plot_assembly(
        assembly, exaggeration, error_body, assumption, figure is not None
    )
    if figure is None:
        plotter.show()
    else:
        save_pixels(plotter.screenshot(return_img=True), figure)
    plotter.close()
