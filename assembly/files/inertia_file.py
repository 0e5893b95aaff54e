"""Moments of inertia in robot files: six entries of the matrix."""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.inertia import inertia_fault, inertia_matrix
from forcefit.inputs.table import Table

_LARGEST = 1e40  # [kg m^2] as of masses


def read_inertia(table: Table) -> NDArray:
    """Return the moments of inertia of a frame or a body, zero where absent.

    Args:
        table: with or without ``inertia``: Ixx, Iyy, Izz, Ixy, Ixz, Iyz, the last three
            as they are in the matrix.

    Returns:
        (3, 3) [kg m^2].

    Raises:
        BadInput: they are not six numbers, or no body has them.
    """
    if not table.has("inertia"):
        return np.zeros((3, 3))
    six = table.array("inertia", (6,), "kg m^2", largest=_LARGEST)
    J = inertia_matrix(six)
    fault = inertia_fault(J) if J.any() else ""
    if fault:
        raise table.bad("inertia", fault)
    return J
