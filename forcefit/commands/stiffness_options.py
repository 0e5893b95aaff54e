"""Arguments and options that the stiffness commands share."""

from pathlib import Path
from typing import Annotated

import typer

Surface = Annotated[
    Path, typer.Argument(metavar="SURFACE", help="STL, OBJ, PLY, VTK, MSH, STEP.")
]
Young = Annotated[float, typer.Option(help="Young's modulus [Pa].")]
Poisson = Annotated[float, typer.Option(help="Poisson's ratio.")]
YoungOfRest = Annotated[
    float | None,
    typer.Option("--young", help="Young's modulus [Pa]; of what no --part names."),
]
PoissonOfRest = Annotated[
    float | None, typer.Option("--poisson", help="Poisson's ratio, likewise.")
]
Radius = Annotated[float | None, typer.Option(help="Outer radius [m].")]
InnerRadius = Annotated[float | None, typer.Option(help="Of a tube's hole [m].")]
Width = Annotated[float | None, typer.Option(help="Across `up` [m].")]
Height = Annotated[float | None, typer.Option(help="Along `up` [m].")]
SectionText = Annotated[
    str | None,
    typer.Option(
        "--section",
        help="Any section, in its place: width=0.06,height=0.04,wall=0.003 (a box); "
        "...,web=0.004,flange=0.006 (an I); area=..,I_y=..,I_z=..,J=..,shear_y=..,"
        "shear_z=.. [m].",
    ),
]
Up = Annotated[str | None, typer.Option(help="The section's z: x, y, z or 0,0,1.")]
Theory = Annotated[str, typer.Option(help="timoshenko or euler.")]
Base = Annotated[
    str, typer.Option(help='Held: "z=0", "bore=0,0,0/0,1,0/0.01", "disc=..." [m].')
]
Tip = Annotated[str, typer.Option(help="Where the screw is read, like --base [m].")]
Unit = Annotated[
    str, typer.Option(help="Of the file: m, cm, mm, um, inch; STEP has its own.")
]
Accuracy = Annotated[float, typer.Option(help="Asked largest relative error of K.")]
Kind = Annotated[str, typer.Option(help="rigid, distributing, distributing-both.")]
Density = Annotated[float, typer.Option(help="[kg/m^3] for mass and inertia.")]
Parts = Annotated[
    list[str] | None,
    typer.Option(
        "--part",
        help='Of another material: "z=0.2..0.4/young=2e11,poisson=0.3,density=7800", '
        'a box along the mesh\'s axes [m], or "solid=one+other/young=...", of a STEP '
        "file (fea: list prints its solids). May be repeated; the last counts.",
    ),
]
Masses = Annotated[
    list[str] | None,
    typer.Option("--mass", help='Added: "1.5/0,0,0.452" [kg, m]. May be repeated.'),
]
OptionalBase = Annotated[
    str | None,
    typer.Option(
        help='Held, required: "z=0", "bore=0,0,0/0,1,0/0.01", "disc=..." [m].'
    ),
]
OptionalTip = Annotated[
    str | None,
    typer.Option(help="Where the screw is read, required, like --base [m]."),
]
TimeLimit = Annotated[float, typer.Option(help="Budget of time [s].")]
