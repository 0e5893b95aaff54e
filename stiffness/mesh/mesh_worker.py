"""The mesher's own process: pytetwild on a stored surface.

``python stiffness/mesh/mesh_worker.py SURFACE.npz MESH.npz [LIBRARY]``

The library is of ``same_random_numbers.cpp``.
"""

import ctypes
import sys
from pathlib import Path
from types import ModuleType

import numpy as np

# of the mesher's optimisation: simple parts need fewer, and where walls meet at acute
# angles its goal is never reached, while ten passes are as good as eighty
_PASSES = 12


def main(given: Path, made: Path, library: str | None = None) -> None:
    """Read a surface and its settings, write points and cells.

    Args:
        given: ``points`` (n, 3) [m], ``triangles`` (m, 3), ``settings``: edge length
            [m] and envelope as a share of the diagonal.
        made: ``points`` (n, 3) [m] and ``cells`` (t, 4).
        library: with it the same surface and settings give the same mesh.
    """
    if library is not None:  # before the mesher is: the first definition counts
        ctypes.CDLL(library, mode=ctypes.RTLD_GLOBAL)
    # pytetwild loads pyvista, half a second, to give its classes a method: here it
    # finds an empty one instead
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
