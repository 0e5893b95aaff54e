"""Command ``forcefit new``: write a template for a robot file."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import check_writable, write_text


def new(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="Name of the robot; the file is NAME.toml."
        ),
    ],
    kind: Annotated[
        str | None,
        typer.Option(
            help="Joints of each leg, starting at the base: UPS | RUS | UPU | PRS | "
            "RRR (planar) | delta. If omitted, forcefit prompts for it."
        ),
    ] = None,
    legs: Annotated[
        int | None,
        typer.Option(help="Number of legs. Default: 6 for UPS and RUS, otherwise 3."),
    ] = None,
) -> None:
    """Write a commented robot file with bodies and joints.

    The file can be solved as it is. Replace its numbers with those of your robot. An
    existing file is not overwritten.
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
            f"{path}: the file already exists and is not overwritten; choose a "
            "different name"
        )
    check_writable(path)
    if kind is None:
        if not sys.stdin.isatty():
            raise BadInput(f"--kind: missing, expected {' | '.join(KINDS)}")
        kind, legs = _asked(legs)
    write_text(new_robot(robot, kind, legs), path)
    print(f"written: {path}\n  forcefit assembly solve {path} --load fz=-100")


def _asked(legs: int | None) -> tuple[str, int | None]:
    """Prompt for the leg type and, unless it is given, the number of legs."""
    from forcefit.assembly.files.new_robot import KINDS

    for word, each in KINDS.items():
        print(f"{word:<8}{each.about}, {each.legs} legs")
    kind = typer.prompt("kind", default="UPS")
    if legs is None and kind in KINDS:
        legs = typer.prompt("legs", default=KINDS[kind].legs, type=int)
    return kind, legs
