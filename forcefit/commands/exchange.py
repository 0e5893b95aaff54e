"""The command ``forcefit validation import``."""

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
        list[Path], typer.Argument(metavar="FILE...", help="Exports of the device.")
    ],
    targets: Annotated[
        Path, typer.Option(help="Robot, targets on its platform, units (TOML).")
    ],
    commands: Annotated[
        Path, typer.Option(help="What was commanded: id, q.* or pose.*, time, load.*.")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder of the new campaign.")
    ],
    json: JsonOption = None,
    diagnose: Annotated[
        bool,
        typer.Option(
            "--diagnose",
            help="Then trace what the model lacks, as validation diagnose does; --json "
            "and --report are its.",
        ),
    ] = False,
    report: ReportOption = None,
) -> None:
    """Make a campaign of a measuring device's own files.

    Readings are joined to commands by name, by time or by order; where the device
    stood is found; exchanged targets and gross readings are named and left out.
    """
    from validation.exchange.tracker import import_readings

    if report is not None and not diagnose:
        raise BadInput("--report: expected --diagnose with it, whose report it is")
    imported = import_readings(files, targets, commands, output)
    if not diagnose:
        write_json(imported.table(), json)
    if json != "-":
        print(imported.text())
    if diagnose:
        trace(output, json, report)
