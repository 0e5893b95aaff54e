"""Command ``forcefit stiffness library``: build and query stored link stiffnesses."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from forcefit.commands.options import JsonOption
from forcefit.commands.progress import progress_bars
from forcefit.inputs.errors import BadInput
from forcefit.inputs.writing import write_json


def library(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="SPEC|LIBRARY",
            help="Build file (TOML) whose missing entries are computed, or the folder "
            "of a library.",
        ),
    ],
    workers: Annotated[
        int | None,
        typer.Option(help="Number of processes for a build file.", min=1, max=1024),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="Interpolate K_E at these parameters [SI units] and estimate the "
            "error, for example radius=0.02,length=0.4."
        ),
    ] = None,
    family: Annotated[
        str, typer.Option(help="With --at: part family given by its surfaces.")
    ] = "",
    to: Annotated[
        str | None,
        typer.Option(
            help="Print the library as csv, or K_E of one entry for exudyn, adams or "
            "mapdl."
        ),
    ] = None,
    key: Annotated[
        str | None,
        typer.Option(
            help="With --to: key of the entry to print. Default for csv: all entries."
        ),
    ] = None,
    json: JsonOption = None,
) -> None:
    """Build a library of link stiffnesses, or read one.

    For a build file, the missing entries are computed.  For a library, the entries are
    listed; --at interpolates between them, and --to exports them.
    """
    named = path.suffix.lower() == ".toml" and not path.is_dir()
    is_spec = path.is_file() or named
    given = {"--at": at, "--family": family, "--to": to, "--key": key}
    for name, value in (given if is_spec else {"--workers": workers}).items():
        if value:
            kind = "the folder of a library" if is_spec else "a build file (.toml)"
            raise BadInput(f"{name}: found with {path}, expected {kind}")
    if is_spec:
        _build(path, workers or 1, json)
        return
    if at and to:
        raise BadInput("library: found both --at and --to, expected only one of them")
    for name, value, other in (("--family", family, at), ("--key", key, to)):
        if value and not other:
            needed = "--at" if name == "--family" else "--to"
            raise BadInput(
                f"{name}: found without {needed}; add {needed} or remove {name}"
            )
    if at:
        _look_up(path, at, family, json)
    elif to is not None:
        _export(path, to, key, json)
    else:
        _list(path, json)


def _build(spec: Path, workers: int, json: str | None) -> None:
    """Compute the missing entries of a build file."""
    from forcefit.stiffness.report.library_build import build_library, read_spec

    wanted = read_spec(spec)
    with progress_bars() as update:
        files = build_library(wanted, workers, partial(update, "entries"))
    write_json({"library": str(wanted.folder), "keys": [f.stem for f in files]}, json)
    if json != "-":
        print(f"{len(files)} entries in {wanted.folder}")


def _list(folder: Path, json: str | None) -> None:
    """Print the library entries and their estimated errors."""
    from forcefit.stiffness.report.library import read_library

    entries = read_library(folder)
    write_json({"entries": [e.about for e in entries]}, json)
    if json != "-":
        for entry in entries:
            error = entry.about["relative_error_estimate"]
            print(f"{entry.key}  relative error {error:.2g}")


def _look_up(folder: Path, at: list[str], family: str, json: str | None) -> None:
    """Print the interpolated K_E and its estimated error."""
    from forcefit.commands.options import parse_assignments
    from forcefit.stiffness.link import scaled
    from forcefit.stiffness.report.library import look_up, read_library
    from forcefit.stiffness.report.results import matrix_text

    wanted = parse_assignments(at, "--at")
    K, error = look_up(read_library(folder), wanted, family)
    worst = float(scaled(error, K).max())
    results = {"parameters": wanted, "stiffness": K, "relative_error_estimate": worst}
    write_json(results, json)
    if json != "-":
        print(matrix_text(K))
        print(f"largest relative error: {worst:.2g} (estimate)")


def _export(folder: Path, to: str, key: str | None, json: str | None) -> None:
    """Print a library as CSV, or K_E of one entry in the format ``to``."""
    from forcefit.stiffness.report.export import library_csv, stiffness_for
    from forcefit.stiffness.report.library import read_entry, read_library

    if json is not None and to != "json":
        raise BadInput(
            f"--json: found together with --to {to}; expected only one of the two, or "
            "--to json"
        )
    if to in {"csv", "json"}:
        entries = read_library(folder) if key is None else [read_entry(folder, key)]
        if to == "json":
            write_json({"entries": [entry.about for entry in entries]}, json or "-")
        else:
            print(library_csv(entries), end="")
        return
    if key is None:
        raise BadInput(
            f"--key: missing; expected the key of one entry, because {to} reads one "
            "entry at a time"
        )
    print(stiffness_for(to, read_entry(folder, key).stiffness, key), end="")
