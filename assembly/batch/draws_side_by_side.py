"""Problem (22) for several draws side by side at one posture, by ``draws.cpp``.

The same equations and thresholds as :mod:`assembly.batch.compiled_draws`; draws that
need the interior point are collected first, so that no lane waits for another.
"""

import ctypes
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forcefit.native.libraries import address, load_library

if TYPE_CHECKING:
    from assembly.batch.compiled_draws import Energies, Reduced

SOURCE = "assembly/batch/draws.cpp"


class _Reduced(ctypes.Structure):
    """``Reduced`` of draws.cpp."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("nu", "r", "cones")),
        *(
            (name, ctypes.c_void_p)
            for name in ("Gt", "starts", "inverse", "forces", "gram", "d")
        ),
        *((name, ctypes.c_double) for name in ("slip", "slack", "stored")),
    )


def least_energies_side_by_side(
    reduced: "Reduced", h: NDArray, out: "Energies"
) -> bool:
    """Minimise |G u + h|^2 / 2 for every row of h.

    Args:
        reduced: of the posture.
        h: (k, r) [sqrt(2 J)].
        out: arrays to fill.

    Returns:
        Whether it did; not where there is no compiler.
    """
    library = load_library(SOURCE)
    if library is None:
        return False
    shared = (
        reduced.Gt, reduced.starts, reduced.inverse, reduced.cones, reduced.gram,
        reduced.d,
    )  # fmt: skip
    arrays = [np.ascontiguousarray(array) for array in (*shared, h)]
    *fields, d, rows = map(address, arrays)
    nu, r = reduced.Gt.shape
    given = _Reduced(
        nu, r, len(reduced.starts) - 1, *fields, d if reduced.loaded else None,
        reduced.slip, reduced.slack, reduced.stored,
    )  # fmt: skip
    filled = (ctypes.c_void_p * len(out))(*map(address, out))
    count = ctypes.c_int64(len(h))
    library.least_energies(
        ctypes.byref(given), ctypes.c_void_p(rows), ctypes.byref(count),
        ctypes.byref(filled),
    )  # fmt: skip
    return True
