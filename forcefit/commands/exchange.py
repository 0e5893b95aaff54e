"""The commands ``forcefit validation import`` and ``validation iso``."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.inspect import CampaignArgument
from forcefit.commands.options import JsonOption
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
) -> None:
    """Make a campaign of a measuring device's own files.

    Readings are joined to commands by name, by time or by order; where the device
    stood is found; exchanged targets and gross readings are named and left out.
    """
    from validation.exchange.tracker import import_readings

    imported = import_readings(files, targets, commands, output)
    write_json(imported.table(), json)
    if json != "-":
        print(imported.text())


def iso(campaign: CampaignArgument, json: JsonOption = None) -> None:
    """Figures of ISO 9283 and ISO 230-2, from repeats.

    Pose accuracy and repeatability, distance accuracy, drift; reversal, repeatability
    and accuracy of each reading that was approached from both sides.
    """
    from validation.campaign.campaign_file import read_campaign
    from validation.standards.figures import standard_figures

    figures = standard_figures(read_campaign(campaign))
    write_json(figures.table(), json)
    if json != "-":
        print(figures.text())
