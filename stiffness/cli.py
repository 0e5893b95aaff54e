"""The commands ``forcefit stiffness ...``: parse, call, print or save."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from stiffness.interface import parse_interface
from stiffness.options import BeamOptions, checked, direction
from stiffness.results import (
    comparison_results,
    comparison_text,
    link_results,
    link_text,
)
from stiffness.writing import check_writable, write_json

app = typer.Typer(no_args_is_help=True)

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
Kind = Annotated[str, typer.Option(help="Interfaces: rigid or distributing.")]
Density = Annotated[float, typer.Option(help="[kg/m^3] for mass and inertia.")]
Seconds = Annotated[float, typer.Option(help="Budget of time [s].")]
Json = Annotated[
    str | None, typer.Option("--json", help="Write results as JSON; - is stdout.")
]
Figure = Annotated[Path | None, typer.Option(help="Draw the comparison (png, svg).")]


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
