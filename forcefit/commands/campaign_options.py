"""Shared options of the commands that plan or simulate a measurement campaign."""

from typing import Annotated

import typer

Reach = Annotated[
    float,
    typer.Option(
        help="[rad] Largest change of a revolute drive from its home position."
    ),
]
Stroke = Annotated[
    float,
    typer.Option(help="[m/rad] Travel of a prismatic drive per rad of --reach."),
]
Force = Annotated[float, typer.Option(help="[N] Largest force on the platform.")]
Temperature = Annotated[
    str,
    typer.Option(
        help="Temperature profile: swing (-0.5 to 6.5 K) | around (-4 to 4 K) | "
        "constant (6 K)."
    ),
]
CommandedIn = Annotated[str, typer.Option(help="Commanded quantities: joints | pose.")]
RotationNoise = Annotated[
    float, typer.Option(help="[rad] Standard deviation of a rotation reading.")
]
PositionNoise = Annotated[
    float, typer.Option(help="[m] Standard deviation of a position reading.")
]
