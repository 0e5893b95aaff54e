"""Readers of surface files.

STL is read here.  The other kinds need VTK, meshio or gmsh, which a damaged file can
end together with their process: they run in a process of their own
(:mod:`stiffness.surface.surface_worker`).
"""

import io
import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput
from stiffness.surface.stl_file import read_stl

STEP = (".step", ".stp")
_TIME_LIMIT = 300.0  # [s] of one reader; gmsh takes 1 s for 35 000 triangles


def named_solid(path: Path | str) -> tuple[Path, str]:
    """A surface file, and which of the solids of a STEP file is meant.

    Args:
        path: of a file, or ``part.step#name``.

    Returns:
        The file, and the name; empty where none is given.
    """
    file, mark, name = str(path).rpartition("#")
    if mark and Path(file).suffix.lower() in STEP:
        return Path(file), name
    return Path(path), ""


def read_triangles(path: Path | str, solid: str = "") -> tuple[NDArray, NDArray]:
    """Points and triangles of a surface file, in the file's unit; STEP in metres.

    Args:
        path: an existing file of a known kind.
        solid: of a STEP file with several, by its name.

    Returns:
        (n, 3) points and (m, 3) indices of points.

    Raises:
        BadInput: the content is not what the name says, or the package that reads it
            is not installed.
    """
    path = Path(path)
    if path.suffix.lower() == ".stl":
        return read_stl(path)
    points, faces = _in_own_process(path, solid)
    if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        kind = path.suffix[1:].upper()
        raise BadInput(f"{path}: holds no triangles, or is not {kind}")
    return points, faces.astype(np.int64)


def _in_own_process(path: Path, solid: str) -> tuple[NDArray, NDArray]:
    """Points and faces by a reader that may crash, hang or want all memory."""
    kind = path.suffix[1:].upper()
    with tempfile.TemporaryDirectory(prefix="forcefit-") as folder:
        made = Path(folder, "read.npz")
        # -P: modules of the folder it runs in are not to be taken for others'
        module = "stiffness.surface.surface_worker"
        command = [sys.executable, "-P", "-m", module, str(path), str(made), solid]
        search = {"PYTHONPATH": os.pathsep.join(sys.path)}
        try:
            subprocess.run(
                command,
                timeout=_TIME_LIMIT,
                capture_output=True,
                stdin=subprocess.DEVNULL,
                check=False,
                env=os.environ | search,
            )
        except subprocess.TimeoutExpired:
            raise BadInput(
                f"{path}: not read after {_TIME_LIMIT:g} s as {kind}"
            ) from None
        try:
            stored = np.load(io.BytesIO(made.read_bytes()), allow_pickle=False)
        except (OSError, ValueError, EOFError, zipfile.BadZipFile):
            raise BadInput(f"{path}: not a readable {kind} file") from None
        if "refused" in stored:
            raise BadInput(str(stored["refused"]))
        return stored["points"], stored["faces"]
