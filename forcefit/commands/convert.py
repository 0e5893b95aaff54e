"""Command ``forcefit convert``: import and export robots in other file formats."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.options import JsonOption, MismatchOption, RestOption
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import write_json


def convert(
    source: Annotated[
        str,
        typer.Argument(
            metavar="IN",
            help="Robot: .urdf, .xml (MJCF), .sdf or .toml; or a built-in name.",
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="File to write: .toml, .urdf or .xml (MJCF)."
        ),
    ],
    version: Annotated[
        int,
        typer.Option(
            "--format",
            help="Version of the robot file format: 1 (frames and closures) or 2 "
            "(bodies and joints given by points and axes).",
        ),
    ] = 1,
    loops: Annotated[
        Path | None,
        typer.Option(
            help="File with the loops and drives of a URDF (YAML, closed_loop). "
            "Default: a YAML file with the same name as the URDF in the same folder, "
            "or robot.yaml."
        ),
    ] = None,
    overlay: Annotated[
        Path | None,
        typer.Option(help="Elasticity, clearances and errors of each frame (TOML)."),
    ] = None,
    points: Annotated[
        str | None,
        typer.Option(
            help="Loops closed at a point only, with free orientation: loop1 (the "
            "first loop) or the names of their ends, separated by commas; all; or "
            "none, which uses the declared types."
        ),
    ] = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    json: JsonOption = None,
) -> None:
    """Convert a robot from URDF, MJCF or SDF, or to URDF or MJCF.

    If the loops are not closed in the home pose of the file, a new home pose is
    computed.  The output file is read back and compared with the original robot in 100
    random postures.  Data that the output format cannot represent are listed.  If
    MuJoCo is installed, the robot that it reads from the same URDF or MJCF is compared
    as well.  The exit status is 1 if the robots differ.
    """
    from forcefit.assembly.exchange.convert import convert as convert_robot
    from forcefit.assembly.kinematics.closing import closing_of

    if version not in (1, 2):
        raise BadInput(f"--format: found {version}, expected 1 or 2")
    named = None
    if points is not None:
        names = [name.strip() for name in points.split(",")]
        named = [] if names == ["none"] else names
    close = closing_of(rest, mismatch)
    conversion = convert_robot(source, output, loops, overlay, named, close, version)
    write_json(conversion.table(), json)
    if json != "-":
        print(conversion.text())
    if not conversion.agrees:
        raise typer.Exit(1)
