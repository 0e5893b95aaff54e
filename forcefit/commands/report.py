"""Command ``forcefit report``, and the shared option ``--report``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forcefit.commands.help import Commands
from forcefit.commands.options import JsonOption
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import PAGE, check_writable, write_json, write_text

if TYPE_CHECKING:
    from forcefit.page.page import Provenance

app = Commands(no_args_is_help=True)


def _checked(path: Path | None) -> Path | None:
    """Check before the computation that the report can be written."""
    if path is not None:
        check_writable(path, PAGE)
    return path


ReportOption = Annotated[
    Path | None,
    typer.Option(
        "--report", help="Also write a report as a single HTML file.", callback=_checked
    ),
]
_File = Annotated[
    Path,
    typer.Argument(metavar="FILE", help="A report, or JSON results of a command."),
]


@app.callback()
def report() -> None:
    """Compare the results of two runs."""


@app.command()
def compare(
    first: _File,
    second: _File,
    page: ReportOption = None,
    json: JsonOption = None,
) -> None:
    """List values that differ between two runs, largest first."""
    from forcefit.page.comparison import compare as compare_results
    from forcefit.page.comparison import comparison_page, comparison_text

    names = (first.name, second.name) if first.name != second.name else (
        str(first), str(second)
    )  # fmt: skip
    comparison = compare_results(_results(first), _results(second), names)
    if page is not None:
        source = provenance(first, second)
        write_text(comparison_page(comparison, source), page)
    write_json(comparison.table(), json)
    if json != "-":
        print(comparison_text(comparison))


def _results(path: Path) -> dict:
    """Return the results contained in a report or a JSON file."""
    from forcefit.page.page import results_in

    try:
        return results_in(path.read_text(encoding="utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        raise BadInput(f"{path}: cannot be read: {reason}") from None


def provenance(*sources: Path | str | None) -> "Provenance":
    """Return the current command line and the files that the command reads.

    Args:
        sources: files, folders whose files are all read, names of built-in robots, or
            None.

    Returns:
        Command line, and the paths of those sources that are existing files.
    """
    from forcefit.page.page import Provenance, command_line

    paths = [Path(source) for source in sources if source is not None]
    files = [
        file
        for path in paths
        for file in (sorted(path.iterdir()) if path.is_dir() else [path])
        if file.is_file()
    ]
    return Provenance(command_line(), files)


def campaign_provenance(campaign: Path) -> "Provenance":
    """Return the current command line and the files in the campaign folder."""
    return provenance(campaign if campaign.is_dir() else campaign.parent)
