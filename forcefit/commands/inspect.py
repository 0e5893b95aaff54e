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


def inspect(
    campaign: CampaignArgument,
    iso: Annotated[
        bool,
        typer.Option(
            "--iso", help="In place of that, figures of ISO 9283 and ISO 230-2."
        ),
    ] = False,
    json: JsonOption = None,
) -> None:
    """What measured data can tell; figures of ISO 9283 and 230-2.

    Rows, loads and covariates; noise from repeats against the stated sigma; which
    effects would show, and which this design cannot tell apart.  With --iso, from
    repeats: pose accuracy and repeatability, distance accuracy, drift; reversal,
    repeatability and accuracy of each reading that was approached from both sides.
    """
    from validation.campaign.campaign_file import read_campaign
    from validation.inspection.inspection import inspect_campaign
    from validation.inspection.text import inspection_text

    data = read_campaign(campaign)
    if iso:
        from validation.standards.figures import standard_figures

        figures = standard_figures(data)
        write_json(figures.table(), json)
        if json != "-":
            print(figures.text())
        return
    with progress_bars() as update:
        inspection = inspect_campaign(data, lambda done, n: update("effects", done, n))
    write_json(inspection.table(), json)
    if json != "-":
        print(inspection_text(inspection))
