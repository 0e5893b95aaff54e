"""The commands ``forcefit stiffness import`` and ``forcefit stiffness export``."""

from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.options import JsonOption
from forcefit.inputs.errors import BadInput, quoted
from forcefit.inputs.writing import Kind, check_writable, write_bytes, write_json

Length = Annotated[
    str,
    typer.Option(
        help="Unit of lengths: m, cm, mm, um, inch; forces are in N, angles in rad."
    ),
]


def import_(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="K_E or a full stiffness matrix: .mtx, .pch, .dmig, .npy, .npz.",
        ),
    ],
    base: Annotated[
        str, typer.Option(help='Held interface: a node, or "z=0" [m] with --nodes.')
    ] = "1",
    tip: Annotated[
        str,
        typer.Option(
            help='Interface at which the screw is read: a node, or "z=0.4" [m] with '
            "--nodes."
        ),
    ] = "2",
    nodes: Annotated[
        Path | None,
        typer.Option(
            help="Positions of nodes: lines of number, x, y, z; or an input "
            "file with them."
        ),
    ] = None,
    mass: Annotated[
        Path | None, typer.Option(help="Mass matrix of the same degrees of freedom.")
    ] = None,
    unit: Length = "m",
    order: Annotated[
        str,
        typer.Option(
            help="Order of a node's degrees of freedom if the file does not name them: "
            "translations-first, rotations-first."
        ),
    ] = "translations-first",
    json: JsonOption = None,
) -> None:
    """Import K_E from a stiffness matrix of another program.

    The matrix is condensed onto the base and tip interfaces.
    """
    from forcefit.stiffness.exchange.import_link import import_link
    from forcefit.stiffness.report.results import link_results, link_text

    link = import_link(
        file, mass=mass, nodes=nodes, base=base, tip=tip, unit=unit, order=order
    )
    write_json(link_results(link), json)
    if json != "-":
        print(link_text(link))


def export(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="LINK.json", help="Results of a link, written with --json."
        ),
    ],
    to: Annotated[
        str,
        typer.Option(
            help="Format: matrix-market, abaqus, calculix, nastran, numpy, exudyn, "
            "adams, mapdl."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")],
    unit: Length = "m",
) -> None:
    """Write K_E of a link as a stiffness matrix for another program.

    The matrix contains the degrees of freedom of two nodes, at the base and at the tip.
    """
    from forcefit.stiffness.exchange.export_link import link_file, read_link_results

    stiffness, offset = read_link_results(file)
    content = link_file(stiffness, offset, to, unit)
    if (to == "numpy") != (output.suffix.lower() == ".npy"):
        expected = ".npy" if to == "numpy" else "another than .npy"
        raise BadInput(
            f"--output: found {quoted(output.name)}, expected the ending {expected} "
            f"for --to {to}, so that forcefit can read the file again"
        )
    # an existing file may be replaced only if it contains a matrix of the same format
    endings, begins = (output.suffix.lower(),), (content[:8].lower(),)
    check_writable(output, Kind(f"a matrix for {to}", endings, begins))
    write_bytes(content, output)
