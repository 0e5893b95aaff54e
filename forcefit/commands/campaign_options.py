"""Options of the commands that plan or simulate a campaign: ranges and noise."""

from typing import Annotated

import typer

Reach = Annotated[
    float, typer.Option(help="[rad] Largest change of a drive from home.")
]
Stroke = Annotated[
    float, typer.Option(help="[m/rad] Travel of a sliding drive per rad of reach.")
]
Force = Annotated[float, typer.Option(help="[N] Largest force on the platform.")]
Temperature = Annotated[
    str, typer.Option(help="Temperature over the rows: swing | around | constant.")
]
CommandedIn = Annotated[str, typer.Option(help="Commanded quantities: joints | pose.")]
RotationNoise = Annotated[
    float, typer.Option(help="[rad] Standard deviation of a rotation reading.")
]
PositionNoise = Annotated[
    float, typer.Option(help="[m] Standard deviation of a position reading.")
]
