"""The commands ``forcefit stiffness ...``: parse, call, print or save."""

import logging
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forcefit.commands.help import Commands
from forcefit.commands.library import library
from forcefit.commands.link_exchange import export, import_
from forcefit.commands.options import FigureOption, JsonOption
from forcefit.commands.progress import progress_bars
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
)
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import PICTURE, check_writable, save_figure, write_json

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from forcefit.commands.beam_options import BeamOptions
    from stiffness.fem.material import Material
    from stiffness.link import LinkStiffness
    from stiffness.surface.interface import Interface

app = Commands(no_args_is_help=True)
app.add_typer(library, name="library", help="Link stiffnesses kept on disk.")
app.command("import")(import_)
app.command()(export)

CurveFile = Annotated[
    Path | None, typer.Option("--curve", help="A beam along a curve (TOML).")
]


def _tell_progress() -> None:
    """Each mesh's unknowns, error and expected cost, on stderr, as they come."""
    log = logging.getLogger("stiffness.fem.fea")
    log.setLevel(logging.INFO)
    log.handlers = [logging.StreamHandler()]


def _interfaces(base: str | None, tip: str | None) -> "tuple[Interface, Interface]":
    """Both interfaces of the options."""
    from stiffness.surface.interface import parse_interface

    if base is None or tip is None:
        option = "--base" if base is None else "--tip"
        raise BadInput(f'{option}: missing; expected an interface, such as "z=0"')
    return parse_interface(base, "--base"), parse_interface(tip, "--tip")


def _up(text: str | None) -> "NDArray | None":
    """The section's z, if it was given."""
    from forcefit.commands.options import parse_axis

    return None if text is None else parse_axis("--up", text)


def _materials(
    young: float | None, poisson: float | None, density: float, parts: list[str] | None
) -> "list[Material]":
    """The link's materials: one that fills it, then those of its parts."""
    from forcefit.commands.beam_options import BeamOptions
    from forcefit.inputs.errors import checked
    from stiffness.fem.material import Material
    from stiffness.fem.part_text import parse_part

    others = [parse_part("--part", text) for text in parts or ()]
    if (young is None) != (poisson is None):
        raise BadInput("--young, --poisson: found one of them, expected both")
    if young is None or poisson is None:
        if not (others and others[0].solid):
            raise BadInput(
                "--young: missing; expected a modulus [Pa], or --part "
                '"solid=.../young=...,poisson=..." for every solid'
            )
        return others
    E, nu = BeamOptions(young, poisson).material()
    density = checked("--density", density, "kg/m^3", least=0)
    return [Material(E, nu, density), *others]


def _accuracy(value: float) -> float:
    """An accuracy that can be asked for."""
    from forcefit.inputs.errors import checked

    return checked("--accuracy", value, "1", least=1e-5, below=0.5)


def _curve_link(
    path: Path, options: "BeamOptions"
) -> "tuple[LinkStiffness, float, float]":
    """A beam along a curve, its section's size and its length [m]."""
    from forcefit.commands.beam_options import beam_name
    from stiffness.beam.curve import curve_compliance, curve_length
    from stiffness.beam.curve_file import read_curve
    from stiffness.link import LinkStiffness

    E, nu = options.material()
    theory = options.checked_theory()
    pieces = read_curve(path, nu)
    C = curve_compliance(pieces, E, nu, theory=theory)
    name = f"{beam_name(theory)} along a curve"
    link = LinkStiffness(name, C, tip=pieces[-1].place(1.0), base=pieces[0].place(0.0))
    return link, pieces[0].section(0.0).size, curve_length(pieces)


@app.command()
def beam(
    young: Young,
    poisson: Poisson,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="Pieces of a curved beam (TOML)."),
    ] = None,
    length: Annotated[
        float | None, typer.Option(help="Of a straight beam, base to tip [m].")
    ] = None,
    radius: Radius = None,
    inner_radius: InnerRadius = None,
    width: Width = None,
    height: Height = None,
    section: SectionText = None,
    along: Annotated[
        str | None, typer.Option(help="Base to tip: x (the default), y, z or 1,0,2.")
    ] = None,
    up: Up = None,
    theory: Theory = "timoshenko",
    json: JsonOption = None,
) -> None:
    """K_E of a beam: straight in closed form, or along a curve.

    A straight beam has a length and a constant section.  A FILE describes a tapered,
    bent or L-shaped one by its pieces.
    """
    from forcefit.commands.beam_options import BeamOptions
    from stiffness.report.results import link_results, link_text

    options = BeamOptions(
        young, poisson, radius, inner_radius, width, height, section, theory
    )
    if file is None:
        link = _straight_link(options, length, along or "x", up)
    elif options.has_section() or not length is along is up is None:
        raise BadInput(f"{file}: a curve's file has all lengths, sections and axes")
    else:
        link, _, _ = _curve_link(file, options)
    write_json(link_results(link), json)
    if json != "-":
        print(link_text(link))


def _straight_link(
    options: "BeamOptions", length: float | None, along: str, up: str | None
) -> "LinkStiffness":
    """A straight beam of constant section."""
    import numpy as np

    from forcefit.commands.options import parse_axis
    from forcefit.inputs.errors import checked

    if length is None:
        raise BadInput("--length: missing; expected [m], or a FILE of a curve's pieces")
    axis = parse_axis("--along", along)
    tip = checked("--length", length, "m", above=0) * axis / np.linalg.norm(axis)
    return options.link(np.zeros(3), tip, _up(up))


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
    json: JsonOption = None,
) -> None:
    """K_E by finite elements, refined to the required accuracy.

    --part list prints the solids of a STEP file: name, volume, bounding box.
    """
    from forcefit.inputs.errors import checked
    from stiffness.fem.fea import Budget, FemOptions, solve_link
    from stiffness.fem.part_text import parse_mass
    from stiffness.report.results import link_results, link_text
    from stiffness.surface.surface import read_surface

    if part == ["list"]:
        _list_solids(surface, json)
        return
    held, moved = _interfaces(base, tip)
    budget = Budget(seconds=checked("--time-limit", time_limit, "s", above=0))
    options = FemOptions(_accuracy(accuracy), interface, budget)
    materials = _materials(young, poisson, density, part)
    masses = [parse_mass("--mass", text) for text in mass or ()]
    _tell_progress()
    link = solve_link(
        read_surface(surface, unit), held, moved, materials,
        options=options, point_masses=masses,
    ).link  # fmt: skip
    write_json(link_results(link), json)
    if json != "-":
        print(link_text(link))


def _list_solids(file: Path, json: str | None) -> None:
    """The solids of a STEP file: name, volume, bounding box."""
    from dataclasses import asdict

    from stiffness.surface.surface_files import step_solids

    found = step_solids(file)
    write_json({"solids": [asdict(solid) for solid in found]}, json)
    if json != "-":
        for solid in found:
            box = ", ".join(
                f"{k} = {a:.5g} .. {b:.5g}"
                for k, a, b in zip("xyz", solid.low, solid.high, strict=True)
            )
            print(f"{solid.name}: {solid.volume:.5g} m^3, {box} m")


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
    section: SectionText = None,
    curve: CurveFile = None,
    up: Up = None,
    theory: Theory = "timoshenko",
    unit: Unit = "m",
    accuracy: Accuracy = 0.005,
    interface: Kind = "rigid",
    figure: FigureOption = None,
    json: JsonOption = None,
) -> None:
    """K_E by finite elements beside a beam, entry by entry.

    The beam is straight, of the section given, or along a curve.
    """
    from forcefit.commands.beam_options import BeamOptions
    from stiffness.fem.fea import FemOptions, mesh_link
    from stiffness.fem.material import Material
    from stiffness.report.compare import compare_link
    from stiffness.report.results import comparison_results, comparison_text

    options = BeamOptions(
        young, poisson, radius, inner_radius, width, height, section, theory
    )
    (E, nu), roll = options.material(), _up(up)
    if curve is not None:
        if options.has_section() or up is not None:
            raise BadInput("--curve: its file has the sections and their axes")
        bent = _curve_link(curve, options)
    else:
        bent, size = None, options.section().size
    held, moved = _interfaces(base, tip)
    accuracy = _accuracy(accuracy)
    if figure is not None:
        check_writable(figure, PICTURE)
    _tell_progress()
    meshed = mesh_link(
        surface, held, moved, Material(E, nu), unit=unit,
        options=FemOptions(accuracy, interface),
    )  # fmt: skip
    if bent is None:
        straight = options.link(meshed.base, meshed.tip, roll)
        comparison = compare_link(straight, meshed, size)
    else:
        comparison = compare_link(bent[0], meshed, *bent[1:])
    if figure is not None:
        from stiffness.report.plot import plot_comparison

        save_figure(plot_comparison(comparison), figure)
    write_json(comparison_results(comparison), json)
    if json != "-":
        print(comparison_text(comparison))


@app.command()
def slenderness(
    young: Young,
    poisson: Poisson,
    radius: Radius = None,
    inner_radius: InnerRadius = None,
    width: Width = None,
    height: Height = None,
    section: SectionText = None,
    ratios: Annotated[str, typer.Option(help="L / r, two or more.")] = "5,10,20,40",
    accuracy: Accuracy = 0.002,
    interface: Kind = "rigid",
    figure: FigureOption = None,
    json: JsonOption = None,
) -> None:
    """Beam beside finite elements over L / r: the end effect.

    r is twice the section's larger radius of gyration, a round bar's radius.
    """
    from forcefit.commands.beam_options import BeamOptions
    from forcefit.commands.options import parse_sizes
    from stiffness.report.results import sweep_results, sweep_text
    from stiffness.report.slenderness import sweep_slenderness

    options = BeamOptions(young, poisson, radius, inner_radius, width, height, section)
    (E, nu), declared = options.material(), options.declared()
    wanted = parse_sizes("--ratios", ratios, "1")
    accuracy = _accuracy(accuracy)
    if figure is not None:
        check_writable(figure, PICTURE)
    with progress_bars() as update:
        update("lengths", 0, len(wanted))
        sweep = sweep_slenderness(
            declared, E, nu, wanted, accuracy=accuracy, interface=interface,
            update=partial(update, "lengths"),
        )  # fmt: skip
    if figure is not None:
        from stiffness.report.plot import plot_slenderness

        save_figure(plot_slenderness(sweep), figure)
    write_json(sweep_results(sweep), json)
    if json != "-":
        print(sweep_text(sweep))


@app.command()
def stress(
    surface: Surface,
    base: Base,
    tip: Tip,
    wrench: Annotated[
        list[str] | None, typer.Option(help="At the tip: fx=10,mz=1 [N, N m].")
    ] = None,
    young: YoungOfRest = None,
    poisson: PoissonOfRest = None,
    density: Density = 0.0,
    part: Parts = None,
    gravity: Annotated[
        list[str] | None,
        typer.Option(help="In the file's axes: z=-9.81 [m/s^2], for its own weight."),
    ] = None,
    away: Annotated[
        float | None,
        typer.Option(help="From the interfaces [m]; one interface radius if absent."),
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
    """Peak von Mises stress, away from the clamped edges.

    With a section, the beam formula stands beside it.
    """
    import numpy as np

    from forcefit.commands.beam_options import BeamOptions
    from forcefit.commands.options import parse_gravity, parse_load
    from forcefit.inputs.errors import checked
    from stiffness.fem.fea import FemOptions, solve_link
    from stiffness.fem.stress import peak_stress, stress_influence
    from stiffness.report.results import stress_results, stress_text
    from stiffness.surface.surface import read_surface

    materials, roll = _materials(young, poisson, density, part), _up(up)
    options = BeamOptions(
        materials[0].E, materials[0].nu, radius, inner_radius, width, height, section
    )
    if not wrench and not gravity:
        raise BadInput("--wrench: missing; expected one, or --gravity")
    if part and options.has_section():
        raise BadInput("--part: found with a section, whose beam has one material")
    if gravity and figure is not None:
        raise BadInput("--figure: found with --gravity, expected one of the two")
    load = np.array(parse_load(wrench or ["fx=0"], "--wrench"))
    g = parse_gravity(gravity)
    declared = options.declared() if options.has_section() else None
    held, moved = _interfaces(base, tip)
    accuracy = _accuracy(accuracy)
    if away is not None:
        checked("--away", away, "m", above=0)
    if figure is not None:
        check_writable(figure, PICTURE)
    _tell_progress()
    solved = solve_link(
        read_surface(surface, unit), held, moved, materials,
        options=FemOptions(accuracy, interface),
    )  # fmt: skip
    peak = peak_stress(solved, load, section=declared, up=roll, away=away, gravity=g)
    if figure is not None:
        from stiffness.report.plot import plot_stress

        everywhere = stress_influence(solved, away=0.0)
        ends = solved.link.base, solved.link.tip
        figure_of_stress = plot_stress(everywhere, peak, *ends, declared, roll)
        save_figure(figure_of_stress, figure)
    write_json(stress_results(peak), json)
    if json != "-":
        print(stress_text(peak))
