"""Moments of inertia in robot files: six entries of the matrix."""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.inertia import inertia_fault, inertia_matrix
from forcefit.inputs.table import Table

_LARGEST = 1e40  # [kg m^2] upper limit, numerically equal to the limit of masses


def read_inertia(table: Table) -> NDArray:
    """Return the moments of inertia of a frame or a body; zero if absent.

    Args:
        table: table with or without ``inertia``: Ixx, Iyy, Izz, Ixy, Ixz, Iyz, where
            the last three are the entries of the matrix.

    Returns:
        (3, 3) [kg m^2] matrix.

    Raises:
        BadInput: the value is not six numbers, or no body has these moments of inertia.
    """
    if not table.has("inertia"):
        return np.zeros((3, 3))
    six = table.array("inertia", (6,), "kg m^2", largest=_LARGEST)
    J = inertia_matrix(six)
    fault = inertia_fault(J) if J.any() else ""
    if fault:
        raise table.bad("inertia", fault)
    return J
