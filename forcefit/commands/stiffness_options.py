"""Arguments and options shared by several stiffness commands, and their parsers."""

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forcefit.inputs.errors import BadInput

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from forcefit.commands.beam_options import BeamOptions
    from forcefit.stiffness.fem.material import Material
    from forcefit.stiffness.link import LinkStiffness
    from forcefit.stiffness.surface.interface import Interface

Surface = Annotated[
    Path,
    typer.Argument(
        metavar="SURFACE", help="Surface file: STL, OBJ, PLY, VTK, MSH, STEP."
    ),
]
Young = Annotated[float, typer.Option(help="Young's modulus [Pa].")]
Poisson = Annotated[float, typer.Option(help="Poisson's ratio.")]
YoungOfRest = Annotated[
    float | None,
    typer.Option(
        "--young", help="Young's modulus [Pa] of the material outside all --part parts."
    ),
]
PoissonOfRest = Annotated[
    float | None,
    typer.Option(
        "--poisson", help="Poisson's ratio of the material outside all --part parts."
    ),
]
Radius = Annotated[float | None, typer.Option(help="Outer radius [m].")]
InnerRadius = Annotated[float | None, typer.Option(help="Inner radius of a tube [m].")]
Width = Annotated[
    float | None, typer.Option(help="Width of the cross section, normal to --up [m].")
]
Height = Annotated[
    float | None, typer.Option(help="Height of the cross section, along --up [m].")
]
SectionText = Annotated[
    str | None,
    typer.Option(
        "--section",
        help="General cross section in SI units, instead of radius, width and height: "
        "width=0.06,height=0.04,wall=0.003 (a box); ...,web=0.004,flange=0.006 (an "
        "I); area=..,I_y=..,I_z=..,J=..,shear_y=..,shear_z=...",
    ),
]
Up = Annotated[
    str | None,
    typer.Option(help="Direction of the cross section's z axis: x, y, z or 0,0,1."),
]
Theory = Annotated[str, typer.Option(help="Beam theory: timoshenko or euler.")]
Base = Annotated[
    str,
    typer.Option(
        help='Fixed interface: "z=0", "bore=0,0,0/0,1,0/0.01", "disc=..." [m].'
    ),
]
Tip = Annotated[
    str,
    typer.Option(
        help="Interface at which the screw is evaluated, in the form of --base [m]."
    ),
]
Unit = Annotated[
    str,
    typer.Option(
        help="Length unit of the file: m, cm, mm, um, inch; a STEP file states its own "
        "unit."
    ),
]
Accuracy = Annotated[float, typer.Option(help="Required relative accuracy of K.")]
Kind = Annotated[
    str,
    typer.Option(
        help="Coupling of the interfaces: rigid, distributing, distributing-both."
    ),
]
Density = Annotated[float, typer.Option(help="Density [kg/m^3], for mass and inertia.")]
Parts = Annotated[
    list[str] | None,
    typer.Option(
        "--part",
        help="Part with a different material: "
        '"z=0.2..0.4/young=2e11,poisson=0.3,density=7800" for a box aligned with the '
        'axes [m], or "solid=one+other/young=..." for solids of a STEP file, which '
        "are listed by fea --part list. May be repeated; the last part takes "
        "precedence.",
    ),
]
Masses = Annotated[
    list[str] | None,
    typer.Option(
        "--mass", help='Point mass: "1.5/0,0,0.452" [kg, m]. May be repeated.'
    ),
]
OptionalSurface = Annotated[
    Path | None,
    typer.Argument(
        metavar="SURFACE", help="Surface file: STL, OBJ, PLY, VTK, MSH, STEP."
    ),
]
OptionalBase = Annotated[
    str | None,
    typer.Option(
        help='Fixed interface: "z=0", "bore=0,0,0/0,1,0/0.01", "disc=..." [m]; '
        "required for a mesh."
    ),
]
OptionalTip = Annotated[
    str | None,
    typer.Option(
        help="Interface at which the screw is evaluated, in the form of --base [m]; "
        "required for a mesh."
    ),
]
TimeLimit = Annotated[float, typer.Option(help="Time limit of the solution [s].")]


def tell_progress() -> None:
    """Print the number of unknowns, the error and the expected time for each mesh."""
    log = logging.getLogger("forcefit.finite_elements")
    log.setLevel(logging.INFO)
    log.handlers = [logging.StreamHandler()]


def parse_interfaces(
    base: str | None, tip: str | None
) -> "tuple[Interface, Interface]":
    """Parse the interfaces given by ``--base`` and ``--tip``."""
    from forcefit.stiffness.surface.interface import parse_interface

    if base is None or tip is None:
        option = "--base" if base is None else "--tip"
        raise BadInput(f'{option}: missing; expected an interface such as "z=0"')
    return parse_interface(base, "--base"), parse_interface(tip, "--tip")


def parse_up(text: str | None) -> "NDArray | None":
    """Parse the direction of the cross section's z axis; None if it is absent."""
    from forcefit.commands.options import parse_axis

    return None if text is None else parse_axis("--up", text)


def parse_materials(
    young: float | None, poisson: float | None, density: float, parts: list[str] | None
) -> "list[Material]":
    """Return the materials of a link: the main material followed by those of parts."""
    from forcefit.commands.beam_options import BeamOptions
    from forcefit.inputs.errors import checked
    from forcefit.stiffness.fem.material import Material
    from forcefit.stiffness.fem.part_text import parse_part

    others = [parse_part("--part", text) for text in parts or ()]
    if (young is None) != (poisson is None):
        raise BadInput("--young, --poisson: found only one of them, expected both")
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


def parse_accuracy(value: float) -> float:
    """Return the required accuracy; raise BadInput if it is out of range."""
    from forcefit.inputs.errors import checked

    return checked("--accuracy", value, "1", least=1e-5, below=0.5)


def curve_link(
    path: Path, options: "BeamOptions"
) -> "tuple[LinkStiffness, float, float]":
    """Return a curved beam, the size of its cross section [m], and its length [m]."""
    from forcefit.commands.beam_options import beam_name
    from forcefit.stiffness.beam.curve import curve_compliance, curve_length
    from forcefit.stiffness.beam.curve_file import read_curve
    from forcefit.stiffness.link import LinkStiffness

    E, nu = options.material()
    theory = options.checked_theory()
    pieces = read_curve(path, nu)
    C = curve_compliance(pieces, E, nu, theory=theory)
    name = f"{beam_name(theory)} along a curve"
    link = LinkStiffness(name, C, tip=pieces[-1].place(1.0), base=pieces[0].place(0.0))
    return link, pieces[0].section(0.0).size, curve_length(pieces)
