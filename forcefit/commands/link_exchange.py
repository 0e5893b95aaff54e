"""Command ``forcefit stiffness convert``: exchange K_E with other programs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from forcefit.commands.options import JsonOption
from forcefit.inputs.errors import BadInput, quoted
from forcefit.inputs.writing import Kind, check_writable, write_bytes, write_json

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from forcefit.stiffness.link import LinkStiffness


def convert(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="K_E or a full stiffness matrix (.mtx, .pch, .dmig, .npy, .npz), or "
            "link results written with --json (.json).",
        ),
    ],
    to: Annotated[
        str | None,
        typer.Option(
            help="Format of --output: matrix-market, abaqus, calculix, nastran, numpy, "
            "exudyn, adams, mapdl."
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Output file; see --to.")
    ] = None,
    base: Annotated[
        str | None,
        typer.Option(
            help='Fixed interface: a node (default: 1), or "z=0" [m] with --nodes.'
        ),
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option(
            help="Interface at which the screw is evaluated: a node (default: 2), or "
            '"z=0.4" [m] with --nodes.'
        ),
    ] = None,
    nodes: Annotated[
        Path | None,
        typer.Option(
            help="Node positions: lines with number, x, y, z; or an input file that "
            "contains them."
        ),
    ] = None,
    mass: Annotated[
        Path | None,
        typer.Option(help="Mass matrix for the same degrees of freedom."),
    ] = None,
    unit: Annotated[
        str,
        typer.Option(
            help="Length unit of the matrices: m, cm, mm, um, inch; forces are in N, "
            "angles in rad."
        ),
    ] = "m",
    order: Annotated[
        str | None,
        typer.Option(
            help="Order of the degrees of freedom at each node, if the file does not "
            "name them: translations-first (default), rotations-first."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Read and write K_E in the formats of other programs.

    The matrix is condensed onto the base and tip interfaces, and K_E is printed.  With
    --to and --output, K_E is also written as a stiffness matrix with one node at the
    base and one at the tip.
    """
    if (to is None) != (output is None):
        raise BadInput(
            "stiffness convert: found only one of --to and --output, expected both"
        )
    if file.suffix.lower() == ".json":
        options = {"--base": base, "--tip": tip, "--nodes": nodes, "--mass": mass,
                   "--order": order, "--json": json}  # fmt: skip
        _write(*_saved(file, to, options), to, unit, output)
        return
    link = _imported(file, mass, nodes, base or "1", tip or "2", unit, order)
    _write(link.stiffness, link.base - link.tip, to, unit, output)
    _report(link, json)


def _saved(
    file: Path, to: str | None, options: dict[str, Any]
) -> "tuple[NDArray, NDArray]":
    """Return K_E and the vector from tip to base [m] from a results file."""
    from forcefit.stiffness.exchange.export_link import read_link_results

    for name, value in options.items():
        if value is not None:
            raise BadInput(
                f"{name}: found together with the results {file}; remove the option, "
                "which applies only to matrices from other programs"
            )
    if to is None:
        raise BadInput("--to: missing; expected the format of the output file")
    return read_link_results(file)


def _imported(
    file: Path, mass: Path | None, nodes: Path | None, base: str, tip: str, unit: str,
    order: str | None,
) -> "LinkStiffness":  # fmt: skip
    """Return the link condensed from a matrix of another program."""
    from forcefit.stiffness.exchange.import_link import import_link

    return import_link(
        file, mass=mass, nodes=nodes, base=base, tip=tip, unit=unit,
        order=order or "translations-first",
    )  # fmt: skip


def _report(link: "LinkStiffness", json: str | None) -> None:
    """Print K_E of a link, and write it as JSON if requested."""
    from forcefit.stiffness.report.results import link_results, link_text

    write_json(link_results(link), json)
    if json != "-":
        print(link_text(link))


def _write(
    stiffness: "NDArray", offset: "NDArray", to: str | None, unit: str,
    output: Path | None,
) -> None:  # fmt: skip
    """Write K_E as a matrix for another program, if an output file is given."""
    from forcefit.stiffness.exchange.export_link import link_file

    if to is None or output is None:
        return
    content = link_file(stiffness, offset, to, unit)
    if (to == "numpy") != (output.suffix.lower() == ".npy"):
        expected = ".npy" if to == "numpy" else "other than .npy"
        raise BadInput(
            f"--output: found {quoted(output.name)}, expected a file extension "
            f"{expected} for --to {to}, so that forcefit can read the file back"
        )
    # an existing file is replaced only if it contains a matrix in the same format
    endings, begins = (output.suffix.lower(),), (content[:8].lower(),)
    check_writable(output, Kind(f"a matrix for {to}", endings, begins))
    write_bytes(content, output)
