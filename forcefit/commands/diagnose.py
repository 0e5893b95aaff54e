"""Command ``forcefit validation diagnose``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forcefit.commands.inspect import CampaignArgument
from forcefit.commands.options import JsonOption
from forcefit.commands.progress import progress_bars
from forcefit.commands.report import ReportOption, campaign_provenance
from forcefit.inputs.errors import BadInput, nearest, quoted
from forcefit.inputs.writing import ROBOT, check_writable, write_json

if TYPE_CHECKING:
    from forcefit.validation.diagnosis.diagnosis import Diagnosis


def diagnose(
    campaign: CampaignArgument,
    json: JsonOption = None,
    report: ReportOption = None,
    calibrate: Annotated[
        int,
        typer.Option(
            help="Number of campaigns to simulate with the same design, in order to "
            "estimate error rates.",
            min=0,
            max=1_000_000,
        ),
    ] = 0,
    finite_motions: Annotated[
        bool,
        typer.Option(
            "--finite-motions",
            help="Use finite instead of small motions in the declared model.",
        ),
    ] = False,
    without: Annotated[
        list[str] | None,
        typer.Option(
            help="Effect to exclude: its name, or function (all functions), geometry "
            "(geometric errors), springs (stiffnesses)."
        ),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Consider only this effect; names as for --without."),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(help="Factor on the prior odds of an effect: NAME=FACTOR."),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(help="Also write the robot with the identified effects."),
    ] = None,
) -> None:
    """Identify effects missing from a model from measured data.

    The verdict is explained, learned, none_needed, ambiguous, outside_library or
    not_enough_rows.  The errors before and after identification are evaluated on
    held-out rows, which are not used to select or fit a model.  --save writes the
    identified robot if it predicts these rows better than the declared robot.
    """
    from forcefit.validation.campaign.campaign_file import read_campaign
    from forcefit.validation.diagnosis import results
    from forcefit.validation.diagnosis.diagnose import diagnose as trace
    from forcefit.validation.diagnosis.saving import save as save_robot

    if save is not None:
        check_writable(save, ROBOT)
    odds = _odds(without or [], only or [], prior or [])
    data = read_campaign(campaign)
    with progress_bars() as update:
        diagnosis = trace(data, finite=finite_motions, odds=odds, update=update)
    tally = None
    if calibrate:
        from forcefit.validation.diagnosis.calibration import calibrate as simulate

        with progress_bars() as update:
            tally = simulate(
                diagnosis, calibrate,
                lambda done, n: update("simulated campaigns", done, n),
            )  # fmt: skip
    write_json(results.table(diagnosis, tally), json)
    if json != "-":
        from forcefit.validation.diagnosis.text import text

        print(text(diagnosis, tally))
    if report is not None:
        from forcefit.validation.diagnosis.report import write_report

        write_report(diagnosis, report, tally, campaign_provenance(campaign))
    if save is not None:
        if not diagnosis.better:
            typer.echo(f"{save}: not written, because {_worse(diagnosis)}", err=True)
            raise typer.Exit(1)
        save_robot(diagnosis, save)


def _odds(without: list[str], only: list[str], prior: list[str]) -> dict[str, float]:
    """Return the factor on the prior odds of each effect named in an option."""
    from forcefit.assembly.effects import LIBRARY

    names = [*LIBRARY, "function", "geometry", "springs"]
    odds = dict.fromkeys(names, 0.0) if only else {}
    factors = [("--without", n, 0.0) for n in without] + [
        ("--only", n, 1.0) for n in only
    ]
    for text in prior:
        name, _, factor = text.partition("=")
        try:
            value = float(factor)
        except ValueError:
            value = float("nan")
        if not 0.0 < value < 1e9:
            expected = "expected NAME=FACTOR with a factor > 0"
            raise BadInput(f"--prior: found {quoted(text)}, {expected}")
        factors.append(("--prior", name, value))
    for option, name, value in factors:
        if name not in names:
            raise BadInput(f"{option}: found {quoted(name)}{nearest(name, names)}")
        odds[name] = value
    return odds


def _worse(diagnosis: "Diagnosis") -> str:
    """Return the reason why the identified robot is not saved."""
    if not len(diagnosis.fit.unknowns) and not diagnosis.effects:
        return "the diagnosis found no error or effect in addition to the declared ones"
    after, before = diagnosis.after.normalised, diagnosis.before.normalised
    return (
        "the identified robot predicts the held-out rows no better than the declared "
        f"robot ({after:.3g} and {before:.3g} sigma)"
    )
