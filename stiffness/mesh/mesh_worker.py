"""Process in which pytetwild meshes a stored surface.

``python stiffness/mesh/mesh_worker.py SURFACE.npz MESH.npz [LIBRARY]``

LIBRARY is built from ``same_random_numbers.cpp``.
"""

import ctypes
import sys
from pathlib import Path
from types import ModuleType

import numpy as np

# largest number of passes of the mesher's optimisation; simple parts need fewer, and
# where walls meet at acute angles twelve passes are as good as eighty
_PASSES = 12


def main(given: Path, made: Path, library: str | None = None) -> None:
    """Read a surface and its settings, write points and cells.

    Args:
        given: file with ``points`` (n, 3) [m], ``triangles`` (m, 3) and ``settings``:
            edge length [m], and envelope as a share of the diagonal.
        made: file with ``points`` (n, 3) [m] and ``cells`` (t, 4).
        library: library with which the same surface and settings give the same mesh.
    """
    # loaded before the mesher, because the first definition is used
    if library is not None:
        ctypes.CDLL(library, mode=ctypes.RTLD_GLOBAL)
    # pytetwild imports pyvista, which takes half a second, only to add a method to its
    # classes; an empty module replaces it here
    sys.modules["pyvista"] = ModuleType("pyvista")
    import pytetwild

    with np.load(given) as stored:
        points, triangles = stored["points"], stored["triangles"]
        edge, envelope = stored["settings"]
    points, cells = pytetwild.tetrahedralize(
        np.ascontiguousarray(points, dtype=float),
        np.ascontiguousarray(triangles, dtype=np.int32),
        edge_length_abs=float(edge),
        epsilon=float(envelope),
        stop_energy=8.0,
        num_opt_iter=_PASSES,
        quiet=True,
    )
    np.savez(made, points=np.asarray(points, dtype=float), cells=np.asarray(cells))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
