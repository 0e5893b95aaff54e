"""Command group ``forcefit stiffness``: stiffness and stress of links."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forcefit.commands.compare_link import compare
from forcefit.commands.help import Commands
from forcefit.commands.library import library
from forcefit.commands.link_exchange import convert
from forcefit.commands.options import FigureOption, JsonOption
from forcefit.commands.report import ReportOption, provenance
from forcefit.commands.stiffness_options import (
    Accuracy,
    Base,
    Density,
    Height,
    InnerRadius,
    Kind,
    Masses,
    OptionalBase,
    OptionalTip,
    Parts,
    Poisson,
    PoissonOfRest,
    Radius,
    SectionText,
    Surface,
    Theory,
    TimeLimit,
    Tip,
    Unit,
    Up,
    Width,
    Young,
    YoungOfRest,
    curve_link,
    parse_accuracy,
    parse_interfaces,
    parse_materials,
    parse_up,
    tell_progress,
)
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import (
    PICTURE,
    check_writable,
    save_figure,
    write_json,
    write_text,
)

if TYPE_CHECKING:
    from forcefit.commands.beam_options import BeamOptions
    from forcefit.stiffness.link import LinkStiffness

app = Commands(no_args_is_help=True)
app.command()(convert)
app.command()(library)


@app.command()
def beam(
    young: Young,
    poisson: Poisson,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="Segments of a curved beam (TOML)."),
    ] = None,
    length: Annotated[
        float | None,
        typer.Option(help="Length of a straight beam from base to tip [m]."),
    ] = None,
    radius: Radius = None,
    inner_radius: InnerRadius = None,
    width: Width = None,
    height: Height = None,
    section: SectionText = None,
    along: Annotated[
        str | None,
        typer.Option(
            help="Direction from base to tip: x (the default), y, z, or a vector, for "
            "example 1,0,2."
        ),
    ] = None,
    up: Up = None,
    theory: Theory = "timoshenko",
    json: JsonOption = None,
) -> None:
    """Compute K_E of a straight or curved beam.

    A straight beam is defined by its length and a constant cross section.  For a
    tapered, curved or L-shaped beam, FILE defines the segments.
    """
    from forcefit.commands.beam_options import BeamOptions
    from forcefit.stiffness.report.results import link_results, link_text

    options = BeamOptions(
        young, poisson, radius, inner_radius, width, height, section, theory
    )
    if file is None:
        link = _straight_link(options, length, along or "x", up)
    elif options.has_section() or not length is along is up is None:
        raise BadInput(
            f"{file}: found together with --length, --along, --up or cross section "
            "options; remove these options, because the file defines them"
        )
    else:
        link, _, _ = curve_link(file, options)
    write_json(link_results(link), json)
    if json != "-":
        print(link_text(link))


def _straight_link(
    options: "BeamOptions", length: float | None, along: str, up: str | None
) -> "LinkStiffness":
    """Return the stiffness of a straight beam of constant cross section."""
    import numpy as np

    from forcefit.commands.options import parse_axis
    from forcefit.inputs.errors import checked

    if length is None:
        raise BadInput(
            "--length: missing; expected the length of a straight beam [m], or a "
            "FILE with the segments of a curved beam"
        )
    axis = parse_axis("--along", along)
    tip = checked("--length", length, "m", above=0) * axis / np.linalg.norm(axis)
    return options.link(np.zeros(3), tip, parse_up(up))


@app.command()
def fea(
    surface: Surface,
    base: OptionalBase = None,
    tip: OptionalTip = None,
    young: YoungOfRest = None,
    poisson: PoissonOfRest = None,
    unit: Unit = "m",
    accuracy: Accuracy = 0.005,
    interface: Kind = "rigid",
    density: Density = 0.0,
    part: Parts = None,
    mass: Masses = None,
    time_limit: TimeLimit = 300.0,
    report: ReportOption = None,
    json: JsonOption = None,
) -> None:
    """Compute K_E by finite elements.

    The mesh is refined until the required accuracy is reached.  --part list prints the
    name, volume and bounding box of each solid in a STEP file.
    """
    from forcefit.inputs.errors import checked
    from forcefit.stiffness.fem.fea import Budget, FemOptions, solve_link
    from forcefit.stiffness.fem.part_text import parse_mass
    from forcefit.stiffness.report.results import link_results, link_text
    from forcefit.stiffness.surface.surface import read_surface

    if part and "list" in part:
        if part != ["list"] or base or tip or mass or young or poisson or report:
            raise BadInput(
                "--part list: found together with other options; remove them, because "
                "the command only lists the solids of a STEP file"
            )
        _list_solids(surface, json)
        return
    held, moved = parse_interfaces(base, tip)
    budget = Budget(seconds=checked("--time-limit", time_limit, "s", above=0))
    options = FemOptions(parse_accuracy(accuracy), interface, budget)
    materials = parse_materials(young, poisson, density, part)
    masses = [parse_mass("--mass", text) for text in mass or ()]
    tell_progress()
    link = solve_link(
        read_surface(surface, unit), held, moved, materials,
        options=options, point_masses=masses,
    ).link  # fmt: skip
    if report is not None:
        from forcefit.stiffness.report.link_page import link_page

        write_text(link_page(link, provenance(surface)), report)
    write_json(link_results(link), json)
    if json != "-":
        print(link_text(link))


def _list_solids(file: Path, json: str | None) -> None:
    """Print the name, volume and bounding box of each solid in a STEP file."""
    from dataclasses import asdict

    from forcefit.stiffness.surface.surface_files import step_solids

    found = step_solids(file)
    write_json({"solids": [asdict(solid) for solid in found]}, json)
    if json != "-":
        for solid in found:
            box = ", ".join(
                f"{k} = {a:.5g} .. {b:.5g}"
                for k, a, b in zip("xyz", solid.low, solid.high, strict=True)
            )
            print(f"{solid.name}: {solid.volume:.5g} m^3, {box} m")


app.command()(compare)


@app.command()
def stress(
    surface: Surface,
    base: Base,
    tip: Tip,
    load: Annotated[
        list[str] | None,
        typer.Option(help="Load at the tip [N, N m], for example fx=10,mz=1."),
    ] = None,
    young: YoungOfRest = None,
    poisson: PoissonOfRest = None,
    density: Density = 0.0,
    part: Parts = None,
    gravity: Annotated[
        list[str] | None,
        typer.Option(
            help="Gravity in the axes of the file [m/s^2], for example z=-9.81, for "
            "stresses due to the weight of the link."
        ),
    ] = None,
    away: Annotated[
        float | None,
        typer.Option(
            help="Minimum distance from the interfaces [m]. Default: one interface "
            "radius."
        ),
    ] = None,
    radius: Radius = None,
    inner_radius: InnerRadius = None,
    width: Width = None,
    height: Height = None,
    section: SectionText = None,
    up: Up = None,
    unit: Unit = "m",
    accuracy: Accuracy = 0.005,
    interface: Kind = "rigid",
    figure: FigureOption = None,
    json: JsonOption = None,
) -> None:
    """Compute the peak von Mises stress away from clamped edges.

    If a cross section is given, the stress from beam theory is computed as well.
    """
    import numpy as np

    from forcefit.commands.beam_options import BeamOptions
    from forcefit.commands.options import parse_gravity, parse_load
    from forcefit.inputs.errors import checked
    from forcefit.stiffness.fem.fea import FemOptions, solve_link
    from forcefit.stiffness.fem.stress import peak_stress, stress_influence
    from forcefit.stiffness.report.results import stress_results, stress_text
    from forcefit.stiffness.surface.surface import read_surface

    materials, roll = parse_materials(young, poisson, density, part), parse_up(up)
    options = BeamOptions(
        materials[0].E, materials[0].nu, radius, inner_radius, width, height, section
    )
    if not load and not gravity:
        raise BadInput(
            "--load: missing; expected a load [N, N m], for example fx=10, or --gravity"
        )
    if part and options.has_section():
        raise BadInput(
            "--part: found together with a cross section; remove one of the two, "
            "because beam theory supports only one material"
        )
    if gravity and figure is not None:
        raise BadInput(
            "--figure: found together with --gravity, expected only one of the two"
        )
    wrench = np.array(parse_load(load or ["fx=0"]))
    g = parse_gravity(gravity)
    declared = options.declared() if options.has_section() else None
    held, moved = parse_interfaces(base, tip)
    accuracy = parse_accuracy(accuracy)
    if away is not None:
        checked("--away", away, "m", above=0)
    if figure is not None:
        check_writable(figure, PICTURE)
    tell_progress()
    solved = solve_link(
        read_surface(surface, unit), held, moved, materials,
        options=FemOptions(accuracy, interface),
    )  # fmt: skip
    peak = peak_stress(solved, wrench, section=declared, up=roll, away=away, gravity=g)
    if figure is not None:
        from forcefit.stiffness.report.plot import plot_stress

        everywhere = stress_influence(solved, away=0.0)
        ends = solved.link.base, solved.link.tip
        figure_of_stress = plot_stress(everywhere, peak, *ends, declared, roll)
        save_figure(figure_of_stress, figure)
    write_json(stress_results(peak), json)
    if json != "-":
        print(stress_text(peak))
