"""Command ``forcefit assembly plot``, and the shared option ``--csv``."""

from pathlib import Path
from typing import Annotated, Any

import typer

from forcefit.commands.options import FigureOption
from forcefit.inputs.errors import BadInput, nearest
from forcefit.inputs.writing import PICTURE, TABLE, check_writable, save_figure


def _table(path: Path | None) -> Path | None:
    """Check before the computation that the table can be written."""
    if path is not None:
        check_writable(path, TABLE)
    return path


CsvOption = Annotated[
    Path | None,
    typer.Option(
        "--csv",
        help="Also write a CSV table with one row per point and one column per "
        "component.",
        callback=_table,
    ),
]


def plot(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="Data set of a sweep, of draws or of tolerances."
        ),
    ],
    picture: FigureOption = None,
    csv: CsvOption = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="For the figure: values on the remaining axes, for example draw=3."
        ),
    ] = None,
    kind: Annotated[
        str | None,
        typer.Option(
            help="Type of figure: histogram | tornado | allocation. Default: a type "
            "that suits the file."
        ),
    ] = None,
    quantities: Annotated[
        list[str] | None,
        typer.Option(
            help="Variables or components to plot, for example "
            "stiffness.FX,translation or wrench.leg1.link_a.FZ. The name of a variable "
            "selects all of its components."
        ),
    ] = None,
    rows: Annotated[
        str | None,
        typer.Option(
            help="Axes that span the rows of the CSV table instead of points, for "
            "example quantity,group."
        ),
    ] = None,
) -> None:
    """Plot a saved file, or write it as a CSV table.

    Figures show maps, lines, histograms or tolerances.  Tables contain one row per
    point and one column per component of each variable.  The first column, id, numbers
    the rows from 0.  Column headings state the units in brackets.
    """
    from forcefit.assembly.sweeps.point_table import write_point_table

    if picture is None and csv is None:
        raise BadInput(
            "plot: found no output to write; expected --figure, --csv or both"
        )
    figure_options = {"--at": at, "--kind": kind, "--quantities": quantities}
    _check_goes_with("--figure", picture, figure_options)
    _check_goes_with("--csv", csv, {"--rows": rows})
    if picture is not None:
        _plot_file(file, picture, at or [], kind, quantities or [])
    if csv is not None:
        axes = [name.strip() for name in rows.split(",")] if rows is not None else []
        write_point_table(file, csv, axes)


def _check_goes_with(option: str, path: Path | None, others: dict[str, Any]) -> None:
    """Raise BadInput for options that apply to an output that was not requested."""
    for name, value in others.items():
        if value and path is None:
            raise BadInput(
                f"{name}: found without {option}; add {option} or remove {name}"
            )


def _plot_file(
    file: Path, picture: Path, at: list[str], kind: str | None, quantities: list[str]
) -> None:
    """Plot the data in a saved file."""
    from forcefit.assembly.statistics.plot import KINDS
    from forcefit.assembly.statistics.show import show

    if kind is not None and kind not in KINDS:
        raise BadInput(f'--kind: found "{kind[:60]}"{nearest(kind, KINDS)}')
    check_writable(picture, PICTURE)
    places = {}
    for text in at:
        name, equals, value = (piece.strip() for piece in text.rpartition("="))
        if not equals:
            raise BadInput(f'--at: found "{text[:60]}", expected AXIS=VALUE')
        places[name] = value
    names = [part.strip() for text in quantities for part in text.split(",")]
    save_figure(show(file, quantities=names, at=places, kind=kind), picture)
