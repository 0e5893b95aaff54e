"""Program that meshes a surface with pytetwild.

``python stiffness/mesh/mesh_worker.py SURFACE.npz MESH.npz [LIBRARY]``

LIBRARY is compiled from ``same_random_numbers.cpp``.
"""

import ctypes
import sys
from pathlib import Path
from types import ModuleType

import numpy as np

# maximum number of optimisation passes of the mesher; more passes do not improve the
# meshes of the tested parts
_PASSES = 12


def main(given: Path, made: Path, library: str | None = None) -> None:
    """Read a surface from a file, and write its mesh to a file.

    Args:
        given: input file with ``points``, (n, 3) [m], ``triangles``, (m, 3), and
            ``settings``: edge length [m] and relative envelope.
        made: output file with ``points``, (n, 3) [m], and ``cells``, (t, 4).
        library: compiled library that makes the mesher reproducible, or None.
    """
    # loaded before the mesher, because the first loaded definition of a function is
    # used
    if library is not None:
        ctypes.CDLL(library, mode=ctypes.RTLD_GLOBAL)
    # pytetwild imports pyvista, which is slow and not needed here
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
