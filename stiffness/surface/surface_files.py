"""Readers of surface files.

STL files are read by forcefit, and other formats by VTK, meshio or gmsh. A damaged file
can crash these packages. They therefore run in a separate process
(:mod:`forcefit.stiffness.surface.surface_worker`).
"""

import io
import os
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from forcefit.stiffness.surface.filled_solids import FilledSolids
from forcefit.stiffness.surface.stl_file import read_stl

STEP = (".step", ".stp")
_TIME_LIMIT = 300.0  # [s] time limit of a reader; gmsh needs 1 s for 35 000 triangles


def named_solid(path: Path | str) -> tuple[Path, str]:
    """Split a text into a path and the name of a solid in a STEP file.

    Args:
        path: path of a file, optionally with the name of a solid, such as
            ``part.step#name``.

    Returns:
        The path and the name of the solid, or an empty name.
    """
    file, mark, name = str(path).rpartition("#")
    if mark and Path(file).suffix.lower() in STEP:
        return Path(file), name
    return Path(path), ""


def read_triangles(
    path: Path | str, solid: str = ""
) -> tuple[NDArray, NDArray, FilledSolids | None]:
    """Read the points and the triangles of a surface file.

    Args:
        path: path of an existing file with a known suffix.
        solid: name of one of several solids in a STEP file.

    Returns:
        Points, (n, 3), in the unit of the file, or in metres for a STEP file;
        triangles, (m, 3); and the solids of a STEP file with several solids.

    Raises:
        BadInput: the file cannot be read, or the package that reads this format is not
            installed.
    """
    path = Path(path)
    if path.suffix.lower() == ".stl":
        return *read_stl(path), None
    read = _in_own_process("triangles", path, solid)
    points, faces, solids = read["points"], read["faces"], None
    if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        kind = path.suffix[1:].upper()
        raise BadInput(f"{path}: the file contains no triangles, or is not {kind}")
    faces = faces.astype(np.int64)
    if len(read.get("names", ())) > 1:
        names, overlaps = (
            tuple(str(text) for text in read[k]) for k in ("names", "overlaps")
        )
        solids = FilledSolids(names, points, faces, read["sides"], overlaps)
        faces = faces[(read["sides"] < 0).any(axis=1)]
    return points, faces, solids


@dataclass(frozen=True)
class StepSolid:
    """A solid in a STEP file.

    Attributes:
        name: name of the solid.
        volume: [m^3] volume.
        low: (3,) [m] lower corner of the bounding box.
        high: (3,) [m] upper corner of the bounding box.
    """

    name: str
    volume: float
    low: tuple[float, float, float]
    high: tuple[float, float, float]


def step_solids(path: Path | str) -> list[StepSolid]:
    """List the solids in a STEP file.

    Args:
        path: path of the file.

    Returns:
        The solids in the order of the file.

    Raises:
        BadInput: the file cannot be read or contains no solid, or gmsh is not
            installed.
    """
    read = _in_own_process("solids", Path(path))
    if not len(read["names"]):
        raise BadInput(f"{path}: found no solid, expected one or more")
    return [
        StepSolid(str(name), float(volume), tuple(box[:3]), tuple(box[3:]))
        for name, volume, box in zip(
            read["names"], read["volumes"], read["boxes"].tolist(), strict=True
        )
    ]


def _in_own_process(wanted: str, path: Path, solid: str = "") -> dict[str, NDArray]:
    """Run a reader in a separate process, and return its arrays."""
    kind = path.suffix[1:].upper()
    with tempfile.TemporaryDirectory(prefix="forcefit-") as folder:
        made = Path(folder, "read.npz")
        # with -P, modules are not imported from the current folder
        module = "forcefit.stiffness.surface.surface_worker"
        command = [sys.executable, "-P", "-m", module, wanted, str(path), str(made)]
        search = {"PYTHONPATH": os.pathsep.join(sys.path)}
        try:
            subprocess.run(
                [*command, solid],
                timeout=_TIME_LIMIT,
                capture_output=True,
                stdin=subprocess.DEVNULL,
                check=False,
                env=os.environ | search,
            )
        except subprocess.TimeoutExpired:
            raise BadInput(
                f"{path}: the file was not read as {kind} within {_TIME_LIMIT:g} s"
            ) from None
        try:
            with np.load(io.BytesIO(made.read_bytes()), allow_pickle=False) as stored:
                arrays = dict(stored)
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):
            versions = "; expected a complete file of MSH 2.2 or 4.1"
            raise BadInput(
                f"{path}: not a readable {kind} file{versions if kind == 'MSH' else ''}"
            ) from None
        if "refused" in arrays:
            raise BadInput(str(arrays["refused"]))
        return arrays
