"""Command ``forcefit validation inspect``."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.options import JsonOption
from forcefit.commands.progress import progress_bars
from forcefit.commands.report import ReportOption, campaign_provenance
from forcefit.inputs.writing import write_json, write_text

CampaignArgument = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Folder that contains campaign.toml.")
]


def inspect(
    campaign: CampaignArgument,
    iso: Annotated[
        bool,
        typer.Option(
            "--iso", help="Print the characteristics of ISO 9283 and ISO 230-2 instead."
        ),
    ] = False,
    report: ReportOption = None,
    json: JsonOption = None,
) -> None:
    """Inspect measured data; characteristics of ISO 9283 and 230-2.

    The report lists the numbers of rows, the ranges of loads and covariates, the noise
    estimated from repeats compared with the declared sigma, the detectable effects, and
    the effects that cannot be distinguished with this design.  With --iso, it lists
    characteristics computed from repeats instead: pose accuracy and repeatability,
    distance accuracy and drift, as well as the reversal value, repeatability and
    accuracy of positions approached from both sides.
    """
    from forcefit.validation.campaign.campaign_file import read_campaign
    from forcefit.validation.inspection.inspection import inspect_campaign
    from forcefit.validation.inspection.text import inspection_text

    data = read_campaign(campaign)
    if iso:
        from forcefit.validation.standards.figures import standard_figures

        figures = standard_figures(data)
        if report is not None:
            from forcefit.validation.standards.report import standards_page

            write_text(standards_page(figures, campaign_provenance(campaign)), report)
        write_json(figures.table(), json)
        if json != "-":
            print(figures.text())
        return
    with progress_bars() as update:
        inspection = inspect_campaign(data, lambda done, n: update("effects", done, n))
    if report is not None:
        from forcefit.validation.inspection.report import inspection_page

        write_text(inspection_page(inspection, campaign_provenance(campaign)), report)
    write_json(inspection.table(), json)
    if json != "-":
        print(inspection_text(inspection))
