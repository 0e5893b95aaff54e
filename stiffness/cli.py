"""The commands ``forcefit stiffness ...``: parse, call, print or save."""

import logging
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from stiffness.interface import parse_interface
from stiffness.options import BeamOptions, checked, direction
from stiffness.reading import BadInput
from stiffness.results import (
    comparison_results,
    comparison_text,
    link_results,
    link_text,
)
from stiffness.writing import check_writable, write_json

app = typer.Typer(no_args_is_help=True)
library = typer.Typer(no_args_is_help=True)
app.add_typer(library, name="library", help="Link stiffnesses kept on disk.")

Surface = Annotated[Path, typer.Argument(metavar="SURFACE", help="STL, OBJ, PLY, ...")]
Young = Annotated[float, typer.Option(help="Young's modulus [Pa].")]
Poisson = Annotated[float, typer.Option(help="Poisson's ratio.")]
Radius = Annotated[float | None, typer.Option(help="Outer radius [m].")]
InnerRadius = Annotated[float | None, typer.Option(help="Of a tube's hole [m].")]
Width = Annotated[float | None, typer.Option(help="Across `up` [m].")]
Height = Annotated[float | None, typer.Option(help="Along `up` [m].")]
Up = Annotated[str | None, typer.Option(help="The section's z: x, y, z or 0,0,1.")]
Theory = Annotated[str, typer.Option(help="timoshenko or euler.")]
Base = Annotated[
    str, typer.Option(help='Held: "z=0", "bore=0,0,0/0,1,0/0.01", "disc=..." [m].')
]
Tip = Annotated[str, typer.Option(help="Where the screw is read, like --base [m].")]
Unit = Annotated[str, typer.Option(help="Of the file: m, cm, mm, um, inch.")]
Accuracy = Annotated[float, typer.Option(help="Asked largest relative error of K.")]
Kind = Annotated[str, typer.Option(help="rigid, distributing, distributing-both.")]
Density = Annotated[float, typer.Option(help="[kg/m^3] for mass and inertia.")]
Seconds = Annotated[float, typer.Option(help="Budget of time [s].")]
Json = Annotated[
    str | None, typer.Option("--json", help="Write results as JSON; - is stdout.")
]
Figure = Annotated[Path | None, typer.Option(help="Draw the comparison (png, svg).")]


def _tell_progress() -> None:
    """Each mesh's unknowns, error and expected cost, on stderr, as they come."""
    log = logging.getLogger("stiffness.fea")
    log.setLevel(logging.INFO)
    log.handlers = [logging.StreamHandler()]


@app.command()
def beam(
    length: Annotated[float, typer.Option(help="Base to tip [m].")],
    young: Young,
    poisson: Poisson,
    radius: Radius = None,
    inner_radius: InnerRadius = None,
    width: Width = None,
    height: Height = None,
    axis: Annotated[str, typer.Option(help="Base to tip: x, y, z or 1,0,2.")] = "x",
    up: Up = None,
    theory: Theory = "timoshenko",
    json: Json = None,
) -> None:
    """K_E of a straight beam of constant section, in closed form."""
    options = BeamOptions(young, poisson, radius, inner_radius, width, height, theory)
    along = direction("--axis", axis)
    tip = checked("--length", length, "m", above=0) * along / np.linalg.norm(along)
    link = options.link(np.zeros(3), tip, None if up is None else direction("--up", up))
    write_json(link_results(link), json)
    if json != "-":
        print(link_text(link))


@app.command()
def fea(
    surface: Surface,
    base: Base,
    tip: Tip,
    young: Young,
    poisson: Poisson,
    unit: Unit = "m",
    accuracy: Accuracy = 0.005,
    interface: Kind = "rigid",
    density: Density = 0.0,
    seconds: Seconds = 300.0,
    json: Json = None,
) -> None:
    """K_E of a link by finite elements, refined to the asked accuracy."""
    from stiffness.fea import Budget, mesh_link

    E, nu = BeamOptions(young, poisson).material()
    held, moved = parse_interface(base, "--base"), parse_interface(tip, "--tip")
    accuracy = checked("--accuracy", accuracy, "1", least=1e-5, below=0.5)
    density = checked("--density", density, "kg/m^3", least=0)
    budget = Budget(seconds=checked("--seconds", seconds, "s", above=0))
    if json not in {None, "-"}:
        check_writable(Path(str(json)))
    _tell_progress()
    link = mesh_link(
        surface, held, moved, E, nu,
        unit=unit, accuracy=accuracy, interface=interface, density=density,
        budget=budget,
    )  # fmt: skip
    write_json(link_results(link), json)
    if json != "-":
        print(link_text(link))


@app.command()
def compare(
    surface: Surface,
    base: Base,
    tip: Tip,
    young: Young,
    poisson: Poisson,
    radius: Radius = None,
    inner_radius: InnerRadius = None,
    width: Width = None,
    height: Height = None,
    up: Up = None,
    theory: Theory = "timoshenko",
    unit: Unit = "m",
    accuracy: Accuracy = 0.005,
    interface: Kind = "rigid",
    figure: Figure = None,
    json: Json = None,
) -> None:
    """K_E by finite elements beside a straight beam, entry by entry."""
    from stiffness.compare import compare_link
    from stiffness.fea import mesh_link

    options = BeamOptions(young, poisson, radius, inner_radius, width, height, theory)
    section, (E, nu) = options.section(), options.material()
    held, moved = parse_interface(base, "--base"), parse_interface(tip, "--tip")
    accuracy = checked("--accuracy", accuracy, "1", least=1e-5, below=0.5)
    roll = None if up is None else direction("--up", up)
    for path in (figure, None if json in {None, "-"} else Path(str(json))):
        if path is not None:
            check_writable(path)
    _tell_progress()
    meshed = mesh_link(
        surface, held, moved, E, nu, unit=unit, accuracy=accuracy, interface=interface
    )
    straight = options.link(meshed.base, meshed.tip, roll)
    comparison = compare_link(straight, meshed, section.size)
    if figure is not None:
        from stiffness.plot import plot_comparison

        plot_comparison(comparison).savefig(figure)
    write_json(comparison_results(comparison), json)
    if json != "-":
        print(comparison_text(comparison))


Folder = Annotated[Path, typer.Argument(metavar="LIBRARY", help="Its folder.")]


@library.command()
def build(
    spec: Annotated[Path, typer.Argument(metavar="SPEC", help="Build file (TOML).")],
    workers: Annotated[int, typer.Option(help="Processes.")] = 1,
    json: Json = None,
) -> None:
    """Compute the entries a build file asks for; those already there are kept."""
    from rich.console import Console
    from rich.progress import Progress

    from stiffness.library import build_library, read_spec

    wanted = read_spec(spec)
    count = int(checked("--workers", workers, "1", least=1))
    with Progress(console=Console(stderr=True)) as bars:
        task = bars.add_task("entries")
        files = build_library(
            wanted,
            count,
            lambda done, total: bars.update(task, completed=done, total=total),
        )
    write_json({"library": str(wanted.folder), "keys": [f.stem for f in files]}, json)
    if json != "-":
        print(f"{len(files)} entries in {wanted.folder}")


@library.command(name="list")
def list_entries(folder: Folder, json: Json = None) -> None:
    """The entries of a library and how good they are."""
    from stiffness.library import read_library

    entries = read_library(folder)
    write_json({"entries": [e.about for e in entries]}, json)
    if json != "-":
        for entry in entries:
            error = entry.about["relative_error_estimate"]
            print(f"{entry.key}  error {error:.2g}")


@library.command(name="look-up")
def look_up_entry(
    folder: Folder,
    at: Annotated[list[str], typer.Option(help="Such as radius=0.02,length=0.4.")],
    json: Json = None,
) -> None:
    """K_E at parameters inside the library's grid, interpolated, with its error."""
    from stiffness.library import look_up, read_library
    from stiffness.link import scaled
    from stiffness.options import assignments
    from stiffness.results import matrix_text

    wanted = assignments("--at", at)
    K, error = look_up(read_library(folder), wanted)
    worst = float(scaled(error, K).max())
    results = {"parameters": wanted, "stiffness": K, "relative_error_estimate": worst}
    write_json(results, json)
    if json != "-":
        print(matrix_text(K))
        print(f"largest relative error: {worst:.2g} (estimate)")


@library.command()
def export(
    folder: Folder,
    to: Annotated[str, typer.Option(help="csv, exudyn, adams or mapdl.")] = "csv",
    key: Annotated[str | None, typer.Option(help="One entry; all for csv.")] = None,
) -> None:
    """Print a library as CSV, or one entry's K_E for another program."""
    from stiffness.export import library_csv, stiffness_for
    from stiffness.library import read_entry, read_library

    if to == "csv":
        entries = read_library(folder) if key is None else [read_entry(folder, key)]
        print(library_csv(entries), end="")
        return
    if key is None:
        raise BadInput("--key: missing; another program reads one entry at a time")
    print(stiffness_for(to, read_entry(folder, key).stiffness, key), end="")
