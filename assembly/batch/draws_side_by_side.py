"""Problem (22) for several draws side by side at one posture, compiled.

The same equations and thresholds as :mod:`assembly.batch.compiled_draws`; draws that
need the interior point are collected first, so that no lane waits for another.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.kernels.choice import kernels
from forcefit.native.libraries import numba_alone

if TYPE_CHECKING:
    from assembly.batch.compiled_draws import Energies, Reduced


def least_energies_side_by_side(
    reduced: "Reduced", h: NDArray, out: "Energies"
) -> bool:
    """Minimise |G u + h|^2 / 2 for every row of h.

    Args:
        reduced: of the posture.
        h: (k, r) [sqrt(2 J)].
        out: arrays to fill.

    Returns:
        Whether it did; not where callers asked for numba.
    """
    if numba_alone():
        return False
    s = reduced
    arrays = s.Gt, s.starts, s.inverse, s.cones, s.gram, s.d, h
    *shared, d, rows = map(np.ascontiguousarray, arrays)
    loads = d if s.loaded else None
    kernels.least_energies(*shared, loads, s.slip, s.slack, s.stored, rows, *out)
    return True
