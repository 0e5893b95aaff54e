"""Reading of moments of inertia in robot files."""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.inertia import inertia_fault, inertia_matrix
from forcefit.inputs.table import Table

_LARGEST = 1e40  # [kg m^2] upper limit of the entries


def read_inertia(table: Table) -> NDArray:
    """Return the inertia matrix of a frame or a body.

    Args:
        table: table with an optional key ``inertia``, which contains the matrix entries
            Ixx, Iyy, Izz, Ixy, Ixz, Iyz.

    Returns:
        Inertia matrix, (3, 3) [kg m^2]; zero if the key is absent.

    Raises:
        BadInput: the value is not a list of six numbers, or the matrix is physically
            impossible.
    """
    if not table.has("inertia"):
        return np.zeros((3, 3))
    six = table.array("inertia", (6,), "kg m^2", largest=_LARGEST)
    J = inertia_matrix(six)
    fault = inertia_fault(J) if J.any() else ""
    if fault:
        raise table.bad("inertia", fault)
    return J
