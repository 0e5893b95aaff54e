"""Command ``forcefit validation plan``: design a measurement campaign."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.campaign_options import (
    CommandedIn,
    Force,
    PositionNoise,
    Reach,
    RotationNoise,
    Stroke,
    Temperature,
)
from forcefit.commands.options import (
    AtOption,
    JsonOption,
    RobotArgument,
    parse_point,
)
from forcefit.commands.progress import progress_bars
from forcefit.inputs.errors import checked
from forcefit.inputs.writing import check_new_folder, write_json


def plan(
    robot: RobotArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the new campaign.")
    ],
    rows: Annotated[
        int, typer.Option(help="Number of measurements.", min=1, max=1_000_000)
    ] = 60,
    configurations: Annotated[
        int,
        typer.Option(help="Number of candidate configurations.", min=1, max=1_000_000),
    ] = 120,
    reach: Reach = 0.6,
    stroke: Stroke = 0.1,
    force: Force = 40.0,
    temperature: Temperature = "swing",
    command: CommandedIn = "joints",
    rotation: RotationNoise = 1e-5,
    position: PositionNoise = 5e-6,
    at: AtOption = None,
    seed: Annotated[int, typer.Option(help="Seed for the candidate rows.", min=0)] = 0,
    json: JsonOption = None,
) -> None:
    """Plan measurements that distinguish effects.

    Writes campaign.toml, robot.toml, and measurements.csv without readings.  The times
    and temperatures in this table are targets; replace them with measured values.
    """
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.validation.inspection import planning
    from forcefit.validation.synthetic.design import CampaignDesign
    from forcefit.validation.synthetic.generator import write_campaign

    x, y, z = parse_point(at)
    checked("--rotation", rotation, "rad", above=0)
    checked("--position", position, "m", above=0)
    machine = load_robot(robot)
    check_new_folder(output)
    design = CampaignDesign(
        configurations=configurations, rows=max(rows, configurations), reach=reach,
        size=stroke, load=force, temperature=temperature, command=command,
        reference_point=(x, y, z),
    )  # fmt: skip
    with progress_bars() as update:
        planned = planning.plan_rows(
            machine, rows, design, (rotation, position), seed,
            lambda done, total: update("signatures", done, total),
        )  # fmt: skip
    write_campaign(planning.unmeasured(planned), output)
    write_json(planning.table(planned), json)
    if json != "-":
        print(f"{output}: {planning.text(planned)}")
