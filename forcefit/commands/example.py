"""Command ``forcefit example``: write the files of the examples."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from forcefit.inputs.errors import BadInput, nearest, quoted
from forcefit.inputs.writing import check_writable, write_bytes


class _Example(NamedTuple):
    """Example that the command can write.

    Attributes:
        about: short description of the example.
        files: files and folders, relative to the parent folder of ``examples``.
        first: command to run first.
    """

    about: str
    files: tuple[str, ...]
    first: str


_MESH = "meshes/distal_plain.stl"
EXAMPLES = {
    "irsbot2": _Example(
        "the paper's robot: a study, and errors for other commands",
        ("examples/irsbot2.toml", "examples/irsbot2_errors.toml", _MESH),
        "forcefit study examples/irsbot2.toml",
    ),
    "tolerance_allocation": _Example(
        "allocation of the tolerances of the paper's robot",
        ("examples/tolerance_allocation",),
        'forcefit assembly tolerances irsbot2 --grid "tx=-0.2:0.2:0.2,tz=-0.5" '
        "--plan examples/tolerance_allocation/mostly.toml",
    ),
    "assembly_steps": _Example(
        "the order in which the legs of a hexapod are joined",
        ("examples/assembly_steps.toml",),
        "forcefit assembly steps hexapod examples/assembly_steps.toml --best force",
    ),
    "drawn": _Example(
        "robots described by bodies and joints, such as a Tricept and an Agile Eye",
        ("examples/drawn",),
        "forcefit assembly solve examples/drawn/tricept.toml --load fx=100",
    ),
    "notebooks": _Example(
        "notebooks for Jupyter: robot, CAD link, campaign, tolerances, maps, paper",
        ("examples/notebooks",),
        "jupyter lab examples/notebooks/own_robot.ipynb",
    ),
    "extension": _Example(
        "a package that adds a reader, an effect and a link model",
        ("examples/extension",),
        "pip install ./examples/extension",
    ),
    "campaign": _Example(
        "measurements of an arm with an effect that its model neglects",
        ("examples/campaign",),
        "forcefit validation diagnose examples/campaign",
    ),
    "figure5": _Example(
        "the paper's figure 5, in Python",
        ("examples/paper_figure5.py",),
        "python examples/paper_figure5.py",
    ),
    "hexapod": _Example(
        "accuracy gained in a hexapod by halving the clearance, in Python",
        ("examples/hexapod_accuracy.py", "examples/hexapod_errors.toml"),
        "python examples/hexapod_accuracy.py",
    ),
    "path": _Example(
        "a path for the hexapod, to compute its errors under acceleration",
        ("examples/hexapod_path.csv",),
        "forcefit assembly path hexapod --path examples/hexapod_path.csv",
    ),
    "link_library": _Example(
        "stiffness of links for a grid of dimensions",
        ("examples/link_library.toml",),
        "forcefit stiffness library examples/link_library.toml",
    ),
    "part_library": _Example(
        "stiffness of parts given by their surfaces",
        ("examples/part_library.toml", _MESH, "meshes/l_bracket.stl"),
        "forcefit stiffness library examples/part_library.toml",
    ),
    "stiffness_library": _Example(
        "bars, tubes, boxes and cones by finite elements",
        ("examples/stiffness_library",),
        "forcefit stiffness library examples/stiffness_library/tube --at length=0.37",
    ),
    "surfaces": _Example(
        "surfaces of parts for finite elements",
        ("meshes",),
        'forcefit stiffness fea meshes/distal_plain.stl --base "z=0" --tip "z=0.452" '
        "--young 6e10 --poisson 0.3",
    ),
    **{
        name: _Example(
            f"campaign of measured data: {about}",
            (f"examples/{name}", "examples/campaign_folder.py", "examples/data.toml"),
            f"python examples/{name}/convert.py --help",
        )
        for name, about in (
            ("hangprinter", "a cable-driven printer, from its motor forces"),
            ("hilti", "a construction robot"),
            ("ipa_ur10", "a UR10, from a laser tracker"),
            ("serial_robots", "a UR5 and a WAM"),
            ("voron", "a printer's gantry"),
        )
    },
}


def example(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="Names of examples; if omitted, all examples are listed.",
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Existing folder to write into.")
    ] = Path(),
) -> None:
    """Write the files of examples, as in the repository.

    The commands in the README and in the documentation can then be run in the output
    folder.  Nothing is written if a file with the same name but different content
    exists.
    """
    if not names:
        for name, one in EXAMPLES.items():
            print(f"{name:<22}{one.about}")
        return
    for name in names:
        if name not in EXAMPLES:
            raise BadInput(f"example: found {quoted(name)}{nearest(name, EXAMPLES)}")
    if not output.is_dir():
        raise BadInput(f"{output}: folder not found; expected an existing folder")
    root = _root()
    files = dict.fromkeys(
        path for name in names for part in EXAMPLES[name].files
        for path in _files(root, part)
    )  # fmt: skip
    absent = [path for path in files if _is_absent(output / path, root / path)]
    for path in absent:
        (output / path).parent.mkdir(parents=True, exist_ok=True)
        write_bytes((root / path).read_bytes(), output / path)
    print(
        f"{len(absent)} files written to {output.resolve()}; start in that folder with"
    )
    for name in names:
        print(f"  {EXAMPLES[name].first}")


def _root() -> Path:
    """Return the parent folder of the examples, in the package or in a checkout."""
    package = Path(__file__).parents[1]
    for folder in (package, package.parent):
        if (folder / "examples" / "irsbot2.toml").is_file():
            return folder
    raise BadInput(f"{package}: found no examples; expected them to be installed")


def _files(root: Path, part: str) -> Iterator[Path]:
    """Yield the paths of a file, or of all files in a folder, relative to the root."""
    if (root / part).is_file():
        yield Path(part)
        return
    for path in sorted((root / part).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            yield path.relative_to(root)


def _is_absent(target: Path, source: Path) -> bool:
    """Return whether the target is absent; raise BadInput if its content differs."""
    if not target.exists():
        check_writable(next(p for p in target.parents if p.exists()) / target.name)
        return True
    if not target.is_file() or target.read_bytes() != source.read_bytes():
        raise BadInput(
            f"{target}: found a file whose content differs from the example; it is not "
            "overwritten, choose a different folder"
        )
    return False
