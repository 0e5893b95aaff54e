"""The command ``forcefit validation plan``: parse, call one function, save."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.options import JsonOption, RobotArgument, parse_point
from forcefit.commands.progress import progress_bars
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import check_new_folder, write_json


def plan(
    robot: RobotArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Campaign folder to be written.")
    ],
    rows: Annotated[int, typer.Option(help="Measurements.")] = 60,
    configurations: Annotated[
        int, typer.Option(help="Different ones to choose from.")
    ] = 120,
    reach: Annotated[
        float, typer.Option(help="[rad] Largest change of a drive from home.")
    ] = 0.6,
    stroke: Annotated[
        float, typer.Option(help="[m/rad] What a sliding drive moves per rad of reach.")
    ] = 0.1,
    force: Annotated[float, typer.Option(help="[N] Largest load.")] = 40.0,
    temperature: Annotated[
        str, typer.Option(help="swing | around | constant")
    ] = "swing",
    command: Annotated[str, typer.Option(help="joints | pose")] = "joints",
    rotation: Annotated[float, typer.Option(help="[rad] 1 sigma.")] = 1e-5,
    position: Annotated[float, typer.Option(help="[m] 1 sigma.")] = 5e-6,
    point: Annotated[
        str, typer.Option(help="[m] Measured point, platform axes.")
    ] = "0,0,0",
    seed: Annotated[int, typer.Option(help="Of the rows to choose from.")] = 0,
    json: JsonOption = None,
) -> None:
    """Plan rows that tell effects apart.

    Writes campaign.toml, measurements.csv without readings and robot.toml.  Times and
    temperatures are those to aim at, to be replaced by those that were.
    """
    from assembly.robots import load_robot
    from validation.inspection import planning
    from validation.synthetic.design import CampaignDesign
    from validation.synthetic.generator import write_campaign

    x, y, z = parse_point(point, "--point")
    if not (rotation > 0 and position > 0):
        wrong = "rotation" if not rotation > 0 else "position"
        size = rotation if not rotation > 0 else position
        raise BadInput(f"--{wrong}: found {size:g}, expected > 0")
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
