"""Command ``forcefit validation import``: import the files of a measuring device."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.diagnose import diagnose as trace
from forcefit.commands.options import JsonOption
from forcefit.commands.report import ReportOption
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import write_json


def import_(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Files of the device.")
    ],
    targets: Annotated[
        Path, typer.Option(help="Robot, targets on the platform, units (TOML).")
    ],
    commands: Annotated[
        Path, typer.Option(help="Table of commands: id, q.* or pose.*, time, load.*.")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the new campaign.")
    ],
    json: JsonOption = None,
    diagnose: Annotated[
        bool,
        typer.Option(
            "--diagnose",
            help="Also run validation diagnose; --json and --report then write the "
            "results of the diagnosis.",
        ),
    ] = False,
    report: ReportOption = None,
) -> None:
    """Create a campaign from the files of a measuring device.

    Readings are matched to commands by name, by time or by order.  The pose of the
    device is fitted.  Interchanged targets and outliers are reported, and outliers are
    omitted from the campaign.
    """
    from forcefit.validation.exchange.tracker import import_readings

    if report is not None and not diagnose:
        raise BadInput(
            "--report: found without --diagnose; add --diagnose, because the report "
            "shows the diagnosis"
        )
    imported = import_readings(files, targets, commands, output)
    if not diagnose:
        write_json(imported.table(), json)
    if json != "-":
        print(imported.text())
    if diagnose:
        trace(output, json, report)
