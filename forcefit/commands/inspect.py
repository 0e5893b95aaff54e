"""The command ``forcefit validation inspect``."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.options import JsonOption
from forcefit.commands.progress import progress_bars
from forcefit.inputs.writing import write_json

CampaignArgument = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Folder with campaign.toml in it.")
]


def inspect(campaign: CampaignArgument, json: JsonOption = None) -> None:
    """What measured data can and cannot tell, before diagnosis.

    Rows, loads and covariates; noise from repeats against the stated sigma; which
    effects would show, and which this design cannot tell apart.
    """
    from validation.campaign.campaign_file import read_campaign
    from validation.inspection.inspection import inspect_campaign
    from validation.inspection.text import inspection_text

    data = read_campaign(campaign)
    with progress_bars() as update:
        inspection = inspect_campaign(data, lambda done, n: update("effects", done, n))
    write_json(inspection.table(), json)
    if json != "-":
        print(inspection_text(inspection))
