"""Reader of Matrix Market files with real square matrices.

Sources:
    Boisvert, Pozo, Remington (1996), The Matrix Market exchange formats, NISTIR 5935.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, tril, triu

from forcefit.inputs.errors import BadInput, describe
from forcefit.stiffness.exchange.ansys_files import LARGEST, both_halves
from forcefit.stiffness.exchange.real_numbers import real

_MARKET = (
    {"matrix"}, {"coordinate", "array"}, {"real", "integer", "double"},
    {"general", "symmetric"},
)  # fmt: skip


def matrix_market(path: Path, text: str) -> csr_array:
    """Read a square matrix from the text of a Matrix Market file.

    The reader of SciPy 1.17 is not used, because it misreads some invalid lines and
    exponents with the letter D without an error.

    Args:
        path: path of the file, for error messages.
        text: text of the file.

    Returns:
        (n, n) matrix. A missing triangle is the transpose of the given triangle.

    Raises:
        BadInput: the matrix has a different type, or the length of the file is
            inconsistent with its header.
    """
    head, *lines = text.split("\n")
    words = tuple(head.lower().split()[1:])
    if len(words) != 4 or any(w not in k for w, k in zip(words, _MARKET, strict=True)):
        raise BadInput(
            f"{path}: found {describe(head)}, expected a header with matrix, "
            "coordinate or array, real or integer, and general or symmetric"
        )
    numbers = _numbers(path, [line for line in lines if not line.startswith("%")])
    sizes, rest = np.split(numbers, [3 if words[1] == "coordinate" else 2])
    n = _size(path, sizes)
    if words[1] == "coordinate":
        if len(sizes) < 3 or len(rest) != 3 * sizes[2]:
            raise BadInput(
                f"{path}: the number of entries differs from that in the line of "
                f"matrix sizes: found {len(rest)} numbers, expected row, column and "
                "value for each entry; the file may be truncated"
            )
        places = rest.reshape(-1, 3)[:, :2]
        if np.any((places != places.round()) | (places < 1) | (places > n)):
            raise BadInput(
                f"{path}: found an invalid row or column number, expected whole "
                f"numbers from 1 to {n}"
            )
        i, j = places.astype(int).T - 1
        matrix = csr_array(coo_array((rest[2::3], (i, j)), shape=(n, n)))
    else:
        whole = words[3] == "general"
        expected = n * n if whole else n * (n + 1) // 2
        if len(rest) != expected:
            raise BadInput(f"{path}: found {len(rest)} numbers, expected {expected}")
        j, i = np.indices((n, n)) if whole else np.triu_indices(n)  # in column order
        matrix = csr_array(coo_array((rest, (i.ravel(), j.ravel())), shape=(n, n)))
    # Ansys writes only one triangle, although the header declares a general matrix
    half = not triu(matrix, 1).nnz or not tril(matrix, -1).nnz
    by_ansys = re.search(r"^%.*ANSYS", text, re.M | re.I)
    return (
        both_halves(matrix) if words[3] == "symmetric" or (by_ansys and half)
        else matrix
    )  # fmt: skip


def _numbers(path: Path, lines: list[str]) -> NDArray:
    """Parse the numbers in all lines."""
    words = [word for line in lines for word in line.split()]
    try:
        return np.array(words, dtype=float)
    except ValueError:
        return np.array([real(path, word) for word in words])


def _size(path: Path, sizes: NDArray) -> int:
    """Parse the number of rows from the line with the matrix sizes."""
    rows, columns = (*sizes.tolist(), 0.0, 0.0)[:2]
    if not rows == columns == round(min(rows, 2.0 * LARGEST)) > 0 or rows > LARGEST:
        raise BadInput(
            f"{path}: found {rows:g} by {columns:g} numbers, expected a square matrix"
        )
    return int(rows)
