"""Command ``forcefit validation generate``: simulate a measurement campaign."""

from pathlib import Path
from typing import Annotated, Any

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
from forcefit.inputs.errors import BadInput, checked
from forcefit.inputs.writing import check_json, check_new_folder, write_json

DEFAULT_STRENGTH = 5.0  # [-] default size of an effect divided by the noise


def parse_effects(texts: list[str] | None) -> dict[str, float]:
    """Parse the names and sizes of effects from ``--effect``.

    Args:
        texts: for example ``["self_weight", "link_length=3"]``.

    Returns:
        Size of each effect as a multiple of the measurement noise, by name.

    Raises:
        BadInput: a multiple is not a number > 0, or an effect is given twice.
    """
    from forcefit.commands.options import parse_assignments

    wanted: dict[str, float] = {}
    for text in texts or []:
        name, equals, strength = (part.strip() for part in text.partition("="))
        given = parse_assignments([text], "--effect") if equals else {}
        multiple = given.get(name, DEFAULT_STRENGTH)
        if not multiple > 0:
            raise BadInput(
                f'--effect {name}: found "{strength}", expected a number > 0'
            )
        if name in wanted:
            raise BadInput(f'--effect: found "{name[:60]}" twice, expected it once')
        wanted[name] = multiple
    return wanted


def generate(
    robot: RobotArgument,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Output folder.")],
    truth: Annotated[
        Path, typer.Option(help="File for the hidden effects, outside FOLDER.")
    ],
    effect: Annotated[
        list[str] | None,
        typer.Option(
            "--effect",
            help="Hidden effect: NAME, or NAME=MULTIPLE of the noise (default 5).",
        ),
    ] = None,
    configurations: Annotated[
        int, typer.Option(help="Number of configurations.", min=1, max=1_000_000)
    ] = 24,
    rows: Annotated[
        int,
        typer.Option(
            help="Number of measurements, cycling through the configurations.",
            min=1,
            max=1_000_000,
        ),
    ] = 116,
    reach: Reach = 0.6,
    stroke: Stroke = 0.1,
    force: Force = 40.0,
    loads: Annotated[
        str,
        typer.Option(
            help="Loads: many (different sizes and directions) | one (constant)."
        ),
    ] = "many",
    temperature: Temperature = "swing",
    command: CommandedIn = "joints",
    humidity: Annotated[
        bool, typer.Option("--humidity", help="Record the humidity as a covariate.")
    ] = False,
    rotation: RotationNoise = 1e-5,
    position: PositionNoise = 5e-6,
    error_size: Annotated[
        float,
        typer.Option(
            help="[rad] Largest declared angular error; the largest linear error is "
            "0.5 mm per mrad."
        ),
    ] = 0.0,
    outliers: Annotated[
        int, typer.Option(help="Number of outlier rows, with a large error.", min=0)
    ] = 0,
    missing: Annotated[
        float, typer.Option(help="Fraction of missing readings, from 0 to 1.")
    ] = 0.0,
    hidden_frame: Annotated[
        float,
        typer.Option(
            help="[rad, m] Magnitude of the unknown pose of the device frame."
        ),
    ] = 0.0,
    at: AtOption = None,
    program: Annotated[
        str, typer.Option(help="Simulation: multibody | springs (faster).")
    ] = "multibody",
    seed: Annotated[int, typer.Option(help="Random seed.", min=0)] = 0,
    json: JsonOption = None,
) -> None:
    """Simulate a campaign with effects not in the file.

    Writes campaign.toml, measurements.csv and robot.toml to FOLDER.  Joints have no
    clearance, unless one of the hidden effects is a clearance.
    """
    import numpy as np

    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.validation.multibody.simulation import (
        SimulationFailed,
        without_clearance,
    )
    from forcefit.validation.synthetic.design import CampaignDesign, varied_for
    from forcefit.validation.synthetic.draws import NotApplicable
    from forcefit.validation.synthetic.generator import (
        Noise,
        generate_campaign,
        write_campaign,
    )
    from forcefit.validation.synthetic.rest import PROGRAMS
    from forcefit.validation.synthetic.truth import truth_of

    if program not in PROGRAMS:
        raise BadInput(
            f'--program: found "{program[:60]}", expected ' + " | ".join(PROGRAMS)
        )
    wanted = parse_effects(effect)
    x, y, z = parse_point(at)
    design = CampaignDesign(
        configurations=configurations,
        rows=rows,
        reach=reach,
        size=stroke,
        load=force,
        levels=loads,
        temperature=temperature,
        command=command,
        humidity=humidity,
        reference_point=(x, y, z),
    )
    design = varied_for(design, wanted)
    checked("--error-size", error_size, "rad", least=0)
    noise = Noise(rotation, position, outliers, missing, hidden_frame)
    check_new_folder(folder)
    check_json(str(truth))
    if folder.resolve() in truth.resolve().parents:
        raise BadInput(
            f"--truth {truth}: found a path inside {folder}, where the hidden effects "
            "would be visible; expected a file outside that folder"
        )
    machine = without_clearance(load_robot(robot))
    if error_size:
        errors = np.random.default_rng(seed + 1).uniform(
            -error_size, error_size, (len(machine.frames), 6)
        )
        machine = machine.with_errors(errors * np.repeat([1.0, 0.5], 3))
    try:
        with progress_bars() as update:
            campaign = generate_campaign(
                machine, wanted, design, noise, seed, program, update
            )
    except (NotApplicable, SimulationFailed) as error:
        raise BadInput(str(error)) from None
    hidden: dict[str, Any] = truth_of(campaign)
    write_campaign(campaign, folder)
    write_json({folder.name: hidden}, str(truth))
    write_json({"folder": str(folder), "rows": len(campaign.readings)}, json)
    if json != "-":
        print(f"{folder}: {len(campaign.readings)} rows; hidden effects: {truth}")
