"""Commands ``forcefit validation predict``, ``carry``, ``compensate``, ``explain``."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forcefit.commands.inspect import CampaignArgument
from forcefit.commands.options import FigureOption, JsonOption, RobotArgument
from forcefit.inputs.errors import BadInput, nearest, quoted
from forcefit.inputs.writing import (
    PICTURE,
    ROBOT,
    TABLE,
    check_writable,
    save_figure,
    write_json,
    write_text,
)

if TYPE_CHECKING:
    from forcefit.assembly.model.function import Function
    from forcefit.validation.campaign.campaign import Campaign

CommandsArgument = Annotated[
    Path,
    typer.Argument(metavar="CAMPAIGN|CSV", help="Commands, with or without readings."),
]


def predict(
    robot: RobotArgument,
    commands: CommandsArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Table of readings (CSV).")
    ],
    json: JsonOption = None,
) -> None:
    """Predict readings for the commands of a campaign or table.

    The prediction includes the geometric errors, effects and functions of the robot
    file.  If the file states uncertainties, an interval is written for each reading.
    If the commands come with measurements, the prediction error is printed.  If a row
    has no solution, its cells are left empty and the exit status is 1.
    """
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.results.text import readings_text
    from forcefit.validation.campaign.campaign_file import read_commands
    from forcefit.validation.correction.prediction import predict as predict_readings
    from forcefit.validation.correction.prediction import reading_table

    check_writable(output, TABLE)
    prediction = predict_readings(read_commands(commands, load_robot(robot)))
    table = prediction.table() | _warned(prediction.commands)
    write_text(reading_table(prediction), output)
    write_json(table, json)
    if json != "-":
        print(f"{output}: {len(prediction.commands)} readings")
        error = prediction.error
        if error.normalised == error.normalised:
            print(f"rms of measured minus predicted: {readings_text(vars(error))}")
        print("\n".join(_about(table)))
        for row in table["without_answer"]:
            print(f"{row['id']}: {row['reason']}")
    if table["without_answer"]:
        raise typer.Exit(1)


def _about(table: dict[str, Any]) -> list[str]:
    """Format the assumptions and the uncertainty of a prediction as lines of text."""
    from forcefit.results.text import readings_text

    lines = []
    if any(size > 0.0 for size in table["std"].values()):
        lines.append(
            f"model uncertainty, 1 sigma: {readings_text(table['std'])}; measurement "
            f"noise: {readings_text(table['noise'])}"
        )
    if table["not_measured"]:
        names = ", ".join(table["not_measured"])
        lines.append(
            f"components without readings when the robot was identified: {names}"
        )
    if table["registration"] != "known":
        lines.append(f"registration: {table['registration']}")
    if table["identified_at"] is not None:
        lines.append(
            f"predicted readings refer to the point {table['reference_point']} [m]; "
            f"the robot was identified at {table['identified_at']}"
        )
    if table["extrapolated"]:
        count = len(table["extrapolated"])
        lines.append(f"{count} rows extrapolate (column extrapolated)")
    return lines


def compensate(
    robot: RobotArgument,
    targets: Annotated[
        Path,
        typer.Argument(
            metavar="TARGETS", help="Commands to correct: a table or a campaign."
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Corrected commands (CSV).")
    ],
    offsets: Annotated[
        Path | None,
        typer.Option(
            help="Also write the correction of each drive [rad or m], row by row (CSV)."
        ),
    ] = None,
    diagnosed: Annotated[
        Path | None,
        typer.Option(
            help="Results of validation diagnose (JSON), used for the expected error."
        ),
    ] = None,
    as_read: Annotated[
        bool,
        typer.Option(
            "--as-read", help="Also compensate effects that change only the readings."
        ),
    ] = False,
    json: JsonOption = None,
) -> None:
    """Find the commands that compensate the robot's errors.

    ROBOT contains the identified errors, as written by diagnose --save.  TARGETS
    contains the commands with which the nominal robot would reach the required poses.
    The corrected commands respect the joint limits and keep the loops closed.  If a row
    has no solution, its command stays unchanged and the exit status is 1.
    """
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.validation.campaign.campaign_file import read_commands
    from forcefit.validation.correction import compensation_table as tables
    from forcefit.validation.correction.compensation import compensate as correct

    check_writable(output, TABLE)
    if offsets is not None:
        check_writable(offsets, TABLE)
    left = None if diagnosed is None else _left(diagnosed)
    wanted = read_commands(targets, load_robot(robot))
    compensation = correct(wanted, as_read=as_read)
    table = tables.summary(compensation, left) | _warned(wanted)
    write_text(tables.command_table(compensation), output)
    if offsets is not None:
        write_text(tables.offset_table(compensation), offsets)
    write_json(table, json)
    if json != "-":
        print(tables.summary_text(compensation, table))
    if any(compensation.reason):
        raise typer.Exit(1)


def _warned(commands: "Campaign") -> dict[str, Any]:
    """Warn about variables outside the range of the identification data."""
    from forcefit.validation.diagnosis.learned_range import beyond

    left = beyond(commands.robot, commands)
    for one in left:
        print(f"warning: {one}", file=sys.stderr)
    return {"beyond_learned_range": [one.table() for one in left]}


def _left(path: Path) -> dict[str, float]:
    """Return the rms error on held-out rows [m, rad] from the JSON of a diagnosis."""
    from json import loads

    from forcefit.inputs.table import read_text

    try:
        after = loads(read_text(path))["error"]["after"]
        return {key: float(after[key] or 0.0) for key in ("position", "rotation")}
    except (ValueError, KeyError, TypeError):
        expected = (
            "expected the JSON file that forcefit validation diagnose --json writes"
        )
        raise BadInput(
            f"{path}: found no error of the identified robot; {expected}"
        ) from None


def carry(
    robot: RobotArgument,
    campaign: CampaignArgument,
    setup: Annotated[
        str,
        typer.Option(
            help="Set-up rows: N for the first N rows of each session, row numbers "
            "such as 1-20,31, or row labels."
        ),
    ],
    fit: Annotated[
        str,
        typer.Option(
            help="Quantities to fit in each session: registration,tool,zeros."
        ),
    ] = "registration",
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Robot fitted to these sessions (TOML)."),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Fit a saved robot to a new session.

    The pose of the measuring device, time-dependent effects and the quantities named in
    --fit are fitted to the set-up rows of each session.  The robot parameters are also
    fitted, with their stored covariance as prior.  The prediction errors of the fitted
    and the declared robot are evaluated on all remaining rows.  If there are too few
    set-up rows, or if the fitted robot predicts worse than the declared one, no robot
    is written and the exit status is 1.
    """
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.validation.campaign.campaign_file import read_campaign, read_commands
    from forcefit.validation.correction import carried_file, carrying, carrying_table
    from forcefit.validation.correction.session_unknowns import OF_A_SESSION
    from forcefit.validation.correction.setup_rows import setup_rows

    if output is not None:
        check_writable(output, ROBOT)
    fitted = [name.strip() for name in fit.split(",")]
    for name in fitted:
        if name not in OF_A_SESSION:
            hint = nearest(name, OF_A_SESSION)
            raise BadInput(f"--fit: found {quoted(name)}{hint}")
    declared = read_campaign(campaign)
    data = read_commands(campaign, load_robot(robot))
    data = data.take(data.cells.any(axis=1))
    carried = carrying.carry(data, declared, setup_rows(data, setup), fitted)
    if output is not None and carried.good:
        carried_file.save(carried, output)
    write_json(carrying_table.table(carried) | _warned(data), json)
    if json != "-":
        print(carrying_table.text(carried))
        if output is not None and not carried.good:
            print(f"{output}: not written")
    if not carried.good:
        raise typer.Exit(1)


def explain(
    robot: RobotArgument,
    over: Annotated[
        list[str] | None,
        typer.Option(
            help="Plotted range of each variable, for example "
            "q.drive=-1:1,cov.tilt=0:0.1."
        ),
    ] = None,
    figure: FigureOption = None,
    json: JsonOption = None,
) -> None:
    """Plot the learned functions of a robot file.

    The curves are plotted with confidence bands.  For a function whose value depends
    on earlier inputs, the response to a unit step is plotted.
    """
    from forcefit.assembly.exchange.robot_files import load_robot
    from forcefit.validation.correction import curves

    if figure is not None:
        check_writable(figure, PICTURE)
    machine = load_robot(robot)
    if not machine.functions:
        raise BadInput(
            f"{robot}: found no learned function; expected a robot with at least one, "
            "as saved by forcefit validation diagnose --save"
        )
    shown = curves.curves_of(machine, _ranges(machine.functions, over or []))
    if figure is not None:
        save_figure(curves.figure_of(shown), figure)
    write_json({"functions": curves.table(machine, shown)}, json)
    if json != "-":
        print(curves.text(shown))


def _ranges(
    functions: tuple["Function", ...], texts: list[str]
) -> dict[str, tuple[float, float]]:
    """Return the range of each variable that ``--over`` names."""
    valid = {name for function in functions for name in (*function.variables, "time")}
    ranges = {}
    for part in ",".join(texts).split(",") if texts else ():
        name, _, ends = (piece.strip() for piece in part.partition("="))
        if name not in valid:
            raise BadInput(f"--over: found {quoted(name)}{nearest(name, valid)}")
        try:
            least, most = (float(end) for end in ends.split(":"))
        except ValueError:
            least = most = 0.0
        if not -1e15 < least < most < 1e15:
            expected = "expected MINIMUM:MAXIMUM"
            raise BadInput(f"--over {name}: found {quoted(ends)}, {expected}")
        ranges[name] = (least, most)
    return ranges
