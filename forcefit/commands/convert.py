"""The command ``forcefit convert``: robots of other programs, in and out."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.options import JsonOption, MismatchOption, RestOption
from forcefit.inputs.writing import write_json


def convert(
    source: Annotated[
        str,
        typer.Argument(
            metavar="IN", help=".urdf, .xml (MJCF), .sdf or .toml; or a built-in name."
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help=".toml, .urdf or .xml (MJCF).")
    ],
    loops: Annotated[
        Path | None,
        typer.Option(
            help="Loops and drives of a URDF (YAML, closed_loop); without it the file "
            "of the URDF's name, or robot.yaml beside it."
        ),
    ] = None,
    overlay: Annotated[
        Path | None,
        typer.Option(help="Elasticity, clearances and errors by frame (TOML)."),
    ] = None,
    points: Annotated[
        str | None,
        typer.Option(
            help="Loops that meet only in a point, whatever their type: loop1 for the "
            "first, or a name of an end, between commas; all; none: types as they "
            "stand."
        ),
    ] = None,
    rest: RestOption = None,
    mismatch: MismatchOption = None,
    json: JsonOption = None,
) -> None:
    """Convert a robot from or to URDF, MJCF and SDF.

    A home pose is found where the file's own leaves loops open.  What is written is
    read back and compared in 100 random postures; what it cannot hold is listed.  Where
    MuJoCo is installed, what it reads in the same URDF or MJCF is compared too: exit
    status 1 if that is another robot.
    """
    from assembly.exchange.convert import convert as convert_robot
    from assembly.kinematics.closing import closing_of

    named = None
    if points is not None:
        names = [name.strip() for name in points.split(",")]
        named = [] if names == ["none"] else names
    close = closing_of(rest, mismatch)
    conversion = convert_robot(source, output, loops, overlay, named, close)
    write_json(conversion.table(), json)
    if json != "-":
        print(conversion.text())
    if not conversion.agrees:
        raise typer.Exit(1)
