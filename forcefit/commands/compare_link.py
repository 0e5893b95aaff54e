"""Command ``forcefit stiffness compare``: compare finite elements with beam theory."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forcefit.commands.options import FigureOption, JsonOption
from forcefit.commands.progress import progress_bars
from forcefit.commands.stiffness_options import (
    Height,
    InnerRadius,
    Kind,
    OptionalBase,
    OptionalSurface,
    OptionalTip,
    Poisson,
    Radius,
    SectionText,
    Up,
    Width,
    Young,
    curve_link,
    parse_accuracy,
    parse_interfaces,
    parse_up,
    tell_progress,
)
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import PICTURE, check_writable, save_figure, write_json

if TYPE_CHECKING:
    from forcefit.commands.beam_options import BeamOptions

CurveFile = Annotated[
    Path | None,
    typer.Option("--curve", help="File with the segments of a curved beam (TOML)."),
]


def compare(
    young: Young,
    poisson: Poisson,
    surface: OptionalSurface = None,
    base: OptionalBase = None,
    tip: OptionalTip = None,
    ratios: Annotated[
        str | None,
        typer.Option(
            help="Instead of a SURFACE: compare straight bars with the given cross "
            "section and these slenderness ratios L / r, for example 5,10,20,40."
        ),
    ] = None,
    radius: Radius = None,
    inner_radius: InnerRadius = None,
    width: Width = None,
    height: Height = None,
    section: SectionText = None,
    curve: CurveFile = None,
    up: Up = None,
    theory: Annotated[
        str | None, typer.Option(help="timoshenko (the default) or euler.")
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            help="Length unit of the file: m (the default), cm, mm, um, inch; a STEP "
            "file states its own unit."
        ),
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(
            help="Required relative accuracy of K. Default: 0.005, or 0.002 with "
            "--ratios."
        ),
    ] = None,
    interface: Kind = "rigid",
    figure: FigureOption = None,
    json: JsonOption = None,
) -> None:
    """Compare K_E from finite elements with K_E of a beam.

    A SURFACE is compared with a straight beam of the given cross section, or with the
    curved beam defined by --curve.  With --ratios, bars with several slenderness ratios
    L / r are compared and the end effect is fitted.  Here r is twice the larger radius
    of gyration of the cross section, which equals the radius of a round bar.
    """
    from forcefit.commands.beam_options import BeamOptions

    options = BeamOptions(
        young, poisson, radius, inner_radius, width, height, section,
        theory or "timoshenko",
    )  # fmt: skip
    if ratios is not None:
        _check_no_surface(
            SURFACE=surface, base=base, tip=tip, curve=curve, up=up, theory=theory,
            unit=unit,
        )  # fmt: skip
        accuracy = 0.002 if accuracy is None else accuracy
        _compare_bars(options, ratios, accuracy, interface, figure, json)
        return
    if surface is None:
        raise BadInput(
            "SURFACE: missing; expected a file of the surface, or a section and "
            "--ratios"
        )
    if curve is not None and (options.has_section() or up is not None):
        raise BadInput(
            "--curve: found together with cross section options or --up; remove these "
            "options, because the file defines the cross sections and their axes"
        )
    accuracy = 0.005 if accuracy is None else accuracy
    mesh = (surface, base, tip, unit or "m", accuracy, interface)
    _compare_surface(options, mesh, curve, up, figure, json)


def _check_no_surface(**values: object) -> None:
    """Raise BadInput if --ratios is combined with options that apply to a SURFACE."""
    for name, value in values.items():
        if value is not None:
            option = name if name == "SURFACE" else f"--{name}"
            raise BadInput(
                f"{option}: found together with --ratios, which compares straight "
                "bars without a surface file; remove one of the two"
            )


def _compare_surface(
    options: "BeamOptions", mesh: tuple[Path, str | None, str | None, str, float, str],
    curve: Path | None, up: str | None, figure: Path | None, json: str | None,
) -> None:  # fmt: skip
    """Compare the stiffness of a meshed surface with that of a beam."""
    from forcefit.stiffness.fem.fea import FemOptions, mesh_link
    from forcefit.stiffness.report.compare import compare_link
    from forcefit.stiffness.report.results import comparison_results, comparison_text

    surface, base, tip, unit, accuracy, interface = mesh
    (E, nu), roll = options.material(), parse_up(up)
    if curve is not None:
        bent = curve_link(curve, options)
    else:
        bent, size = None, options.section().size
    held, moved = parse_interfaces(base, tip)
    accuracy = parse_accuracy(accuracy)
    if figure is not None:
        check_writable(figure, PICTURE)
    tell_progress()
    meshed = mesh_link(
        surface, held, moved, E=E, nu=nu, unit=unit,
        options=FemOptions(accuracy, interface),
    )  # fmt: skip
    if bent is None:
        straight = options.link(meshed.base, meshed.tip, roll)
        comparison = compare_link(straight, meshed, size)
    else:
        comparison = compare_link(bent[0], meshed, *bent[1:])
    if figure is not None:
        from forcefit.stiffness.report.plot import plot_comparison

        save_figure(plot_comparison(comparison), figure)
    write_json(comparison_results(comparison), json)
    if json != "-":
        print(comparison_text(comparison))


def _compare_bars(
    options: "BeamOptions", ratios: str, accuracy: float, interface: str,
    figure: Path | None, json: str | None,
) -> None:  # fmt: skip
    """Compare meshed bars of several lengths with beams of the same cross section."""
    from forcefit.commands.options import parse_sizes
    from forcefit.stiffness.report.results import sweep_results, sweep_text
    from forcefit.stiffness.report.slenderness import sweep_slenderness

    (E, nu), declared = options.material(), options.declared()
    wanted = parse_sizes("--ratios", ratios, "1")
    accuracy = parse_accuracy(accuracy)
    if figure is not None:
        check_writable(figure, PICTURE)
    with progress_bars() as update:
        update("lengths", 0, len(wanted))
        sweep = sweep_slenderness(
            declared, E, nu, wanted, accuracy=accuracy, interface=interface,
            update=partial(update, "lengths"),
        )  # fmt: skip
    if figure is not None:
        from forcefit.stiffness.report.plot import plot_slenderness

        save_figure(plot_slenderness(sweep), figure)
    write_json(sweep_results(sweep), json)
    if json != "-":
        print(sweep_text(sweep))
