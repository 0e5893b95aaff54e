"""Options of the commands that lay out a campaign's rows: which, how, how exactly."""

from typing import Annotated

import typer

Reach = Annotated[
    float, typer.Option(help="[rad] Largest change of a drive from home.")
]
Stroke = Annotated[
    float, typer.Option(help="[m/rad] What a sliding drive moves per rad of reach.")
]
Force = Annotated[float, typer.Option(help="[N] Largest load.")]
Temperature = Annotated[str, typer.Option(help="swing | around | constant")]
CommandedIn = Annotated[str, typer.Option(help="joints | pose")]
RotationNoise = Annotated[float, typer.Option(help="[rad] 1 sigma.")]
PositionNoise = Annotated[float, typer.Option(help="[m] 1 sigma.")]
