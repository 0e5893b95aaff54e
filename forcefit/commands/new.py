"""The command ``forcefit new``, which writes a robot file to start from."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import check_writable, write_text


def new(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Name of the robot; NAME.toml.")
    ],
    kind: Annotated[
        str | None,
        typer.Option(
            help="Joints of a leg from the base: UPS | RUS | UPU | PRS | RRR (planar) "
            "| delta. If it is missing, a terminal asks for it."
        ),
    ] = None,
    legs: Annotated[
        int | None,
        typer.Option(help="Number of legs. Default: 6 for UPS and RUS, else 3."),
    ] = None,
) -> None:
    """Write a robot file of bodies and joints, with comments.

    The file can be solved without changes. Replace its numbers by those of your robot.
    An existing file is not overwritten.
    """
    from forcefit.assembly.files.new_robot import KINDS, new_robot

    path = Path(name if name.endswith(".toml") else f"{name}.toml")
    robot = path.stem
    if not robot.replace("-", "").replace("_", "").isalnum():
        raise BadInput(
            f'NAME: found "{robot[:60]}", expected letters, digits, "-" and "_"'
        )
    if path.exists():
        raise BadInput(
            f"{path}: found a file, expected none: it is not overwritten, choose "
            "another name"
        )
    check_writable(path)
    if kind is None:
        if not sys.stdin.isatty():
            raise BadInput(f"--kind: missing, expected {' | '.join(KINDS)}")
        kind, legs = _asked(legs)
    write_text(new_robot(robot, kind, legs), path)
    print(f"written: {path}\n  forcefit assembly solve {path} --load fz=-100")


def _asked(legs: int | None) -> tuple[str, int | None]:
    """Ask the user for the kind and the number of legs, and return both."""
    from forcefit.assembly.files.new_robot import KINDS

    for word, each in KINDS.items():
        print(f"{word:<8}{each.about}, {each.legs} legs")
    kind = typer.prompt("kind", default="UPS")
    if legs is None and kind in KINDS:
        legs = typer.prompt("legs", default=KINDS[kind].legs, type=int)
    return kind, legs
