"""How arrays lie in memory that are handed to compiled functions: in C order."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Layout(NamedTuple):
    """An annotation, from which :mod:`assembly.solvers.compiled` makes a numba type.

    Attributes:
        kind: of its numbers, by numba's name.
        dimensions: of the array.
        writable: whether it may be changed.
    """

    kind: str
    dimensions: int
    writable: bool = True


Vector = Annotated[NDArray[np.float64], Layout("float64", 1)]
Matrix = Annotated[NDArray[np.float64], Layout("float64", 2)]
Matrices = Annotated[NDArray[np.float64], Layout("float64", 3)]
Indices = Annotated[NDArray[np.int64], Layout("int64", 1)]
IndexRows = Annotated[NDArray[np.int64], Layout("int64", 2)]
Mask = Annotated[NDArray[np.bool_], Layout("boolean", 1)]
GivenVector = Annotated[NDArray[np.float64], Layout("float64", 1, writable=False)]
GivenMatrix = Annotated[NDArray[np.float64], Layout("float64", 2, writable=False)]
GivenMatrices = Annotated[NDArray[np.float64], Layout("float64", 3, writable=False)]
GivenIndices = Annotated[NDArray[np.int64], Layout("int64", 1, writable=False)]
