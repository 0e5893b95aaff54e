"""Process of the mesher: pytetwild on a stored surface.

``python stiffness/mesh/mesh_worker.py SURFACE.npz MESH.npz [LIBRARY]``

The library is built from ``same_random_numbers.cpp``.
"""

import ctypes
import sys
from pathlib import Path
from types import ModuleType

import numpy as np

# of the mesher's optimisation.  Simple parts need fewer; where walls meet at acute
# angles its goal is never reached, while ten passes are as good as eighty
_PASSES = 12


def main(given: Path, made: Path, library: str | None = None) -> None:
    """Read a surface and its settings, write points and cells.

    Args:
        given: ``points`` (n, 3) [m], ``triangles`` (m, 3), ``settings``: edge length
            [m] and envelope as a share of the diagonal.
        made: ``points`` (n, 3) [m] and ``cells`` (t, 4).
        library: if given, the same surface and settings yield the same mesh.
    """
    if library is not None:  # before the mesher: the first definition is used
        ctypes.CDLL(library, mode=ctypes.RTLD_GLOBAL)
    # pytetwild imports pyvista, half a second, to add a method to its classes: here it
    # finds an empty module
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
