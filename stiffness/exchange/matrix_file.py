"""Reader of stiffness and mass matrices from other programs.

=================  ===============================================================
file               written by
=================  ===============================================================
Matrix Market      Ansys (``*EXPORT,..,MMF``), SciPy, Exudyn scripts: ``.mtx``;
                   see :mod:`forcefit.stiffness.exchange.matrix_market`
Harwell-Boeing     Ansys (``HBMAT``): ``.matrix``; see
                   :mod:`forcefit.stiffness.exchange.ansys_files` for its ``.mapping``
user element       Abaqus and CalculiX, ``*SUBSTRUCTURE MATRIX OUTPUT``: ``.mtx``
five columns       Abaqus ``*MATRIX OUTPUT``: node and direction, twice, and value
three columns      Abaqus ``FORMAT=COORDINATE``: row, column, value; CalculiX
                   ``SOLVER=MATRIXSTORAGE``: ``.sti`` or ``.mas``, and ``.dof``
DMIG               Nastran: ``.pch``, ``.dmig``; see
                   :mod:`forcefit.stiffness.exchange.nastran_files`
NumPy              ``.npy``, SciPy's sparse ``.npz``
=================  ===============================================================

Sources:
    CalculiX 2.21 manual, SUBSTRUCTURE MATRIX OUTPUT.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from forcefit.inputs.errors import BadInput, describe, one_line
from forcefit.inputs.table import read_text
from forcefit.stiffness.exchange.ansys_files import (
    LARGEST,
    harwell_boeing,
    read_mapping,
)
from forcefit.stiffness.exchange.matrix_market import matrix_market
from forcefit.stiffness.exchange.nastran_files import DMIG, Freedom, dmig_entries
from forcefit.stiffness.exchange.real_numbers import real, whole

_ENDINGS = (
    ".mtx", ".sti", ".mas", ".pch", ".dmig", ".bdf", ".dat", ".txt", ".npy", ".npz",
    ".mmf", ".matrix",
)  # fmt: skip
_HARWELL_BOEING = re.compile(r"[^\n]*\n[\d ]+\n[RCP][A-Z]{2}\s", re.I)
_KINDS = {"STIFFNESS": "stiffness", "MASS": "mass"}


@dataclass(frozen=True, eq=False)
class FileMatrix:
    """A symmetric matrix from a file.

    Attributes:
        file: name of the file, for error messages.
        matrix: (n, n) complete matrix.
        freedoms: node and direction of each row. Directions 1 to 3 are translations,
            and directions 4 to 6 are rotations.
        named: True if the file names the degree of freedom of each row.
    """

    file: str
    matrix: csr_array
    freedoms: tuple[Freedom, ...]
    named: bool


def read_matrix(
    path: Path | str,
    which: str = "stiffness",
    nodes: Sequence[int] | None = None,
    mapped: Path | str | None = None,
) -> FileMatrix:
    """Read a matrix from a file in one of several formats.

    Args:
        path: file with the matrix.
        which: ``"stiffness"`` or ``"mass"``, for files that contain both matrices.
        nodes: order of the nodes if the file does not name its rows. None stands for 1,
            2, 3 and so on.
        mapped: file of another matrix with the same rows, whose mapping file is used if
            this matrix has no mapping file.

    Returns:
        The matrix. If rows are not named, each node has three or six consecutive rows.

    Raises:
        BadInput: the format is unknown, the matrix is not square, finite and symmetric,
            or the degrees of freedom of its rows are unknown.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in _ENDINGS:
        raise BadInput(
            f"{path}: found the ending {ending or 'none'}, expected one of "
            f"{', '.join(_ENDINGS)}"
        )
    if ending in {".npy", ".npz"}:
        matrix, freedoms = _numpy(path), None
    else:
        text = read_text(path)
        if text.lower().startswith("%%matrixmarket"):
            matrix, freedoms = matrix_market(path, text), None
        elif _HARWELL_BOEING.match(text):
            matrix, freedoms = harwell_boeing(path, text), None
        elif re.search(r"^\s*\*USER ELEMENT", text, re.M | re.I):
            matrix, freedoms = _user_element(path, text, which)
        elif DMIG.search(text):
            entries = dmig_entries(path, text, which)
            matrix, freedoms = _from_entries(path, entries)
        else:
            matrix, freedoms = _columns(path, text)
    for file in (path, mapped):
        mapping = None if file is None else Path(file).with_suffix(".mapping")
        if freedoms is None and mapping is not None and mapping.exists():
            freedoms = _mapped(mapping, matrix.shape[0])
    return _checked(path, matrix, freedoms, nodes)


def _mapped(path: Path, n: int) -> list[Freedom]:
    """Read the degrees of freedom of all rows from a mapping file."""
    given = read_mapping(path)
    freedoms: list[Freedom] = []
    each = n // len(given)
    for item in given:
        if isinstance(item, tuple):
            freedoms.append(item)
        else:
            freedoms += [(item, direction) for direction in range(1, each + 1)]
    if len(freedoms) != n or each > 6:
        raise BadInput(
            f"{path}: found {len(given)} rows or nodes, but the matrix has {n} rows; "
            "expected a node and direction for each row of the matrix"
        )
    return freedoms


def _checked(
    path: Path,
    matrix: csr_array,
    freedoms: list[Freedom] | None,
    nodes: Sequence[int] | None,
) -> FileMatrix:
    """Check that a matrix is square, finite and symmetric, and symmetrise it."""
    n = matrix.shape[0]
    if matrix.shape != (n, n) or not n:
        raise BadInput(
            f"{path}: found an array of shape {matrix.shape}, expected a square matrix"
        )
    # larger numbers could overflow in products
    if not (np.abs(matrix.data) < 1e100).all():
        raise BadInput(f"{path}: found a number that is not finite, or above 1e100")
    given = freedoms or _in_order(path, n, nodes)
    size = np.sqrt(np.abs(matrix.diagonal()))
    gap = abs(matrix - matrix.T).tocoo()
    scale = size[gap.row] * size[gap.col]
    wrong = gap.data > 1e-6 * scale
    if wrong.any():
        k = int(np.argmax(np.where(wrong, gap.data, -1.0)))
        i, j = int(gap.row[k]), int(gap.col[k])
        raise BadInput(
            f"{path}: the matrix is not symmetric: [{i + 1}, {j + 1}] = "
            f"{matrix[i, j]:.6e} but [{j + 1}, {i + 1}] = {matrix[j, i]:.6e}"
        )
    both = csr_array((matrix + matrix.T) / 2)
    return FileMatrix(str(path), both, tuple(given), freedoms is not None)


def _in_order(path: Path, n: int, nodes: Sequence[int] | None) -> list[Freedom]:
    """Assign three or six unnamed rows to each node."""
    numbers = range(1, n // 6 + 1) if nodes is None else nodes
    for each in (3, 6):
        if n == each * len(numbers):
            return [(node, d) for node in numbers for d in range(1, each + 1)]
    expected = "six for each node" if nodes is None else (
        f"three or six for each of the {len(nodes)} nodes"
    )  # fmt: skip
    raise BadInput(
        f"{path}: found {n} rows without names, expected {expected}, or a file with "
        "names of the rows"
    )


def _numpy(path: Path) -> csr_array:
    """Read a matrix from a NumPy file or a sparse SciPy file."""
    from scipy.sparse import load_npz

    try:
        if path.suffix.lower() == ".npz":
            return csr_array(load_npz(path).astype(float))
        dense = np.load(path, allow_pickle=False)
        if dense.ndim != 2 or dense.dtype.kind not in "fiu":
            raise BadInput(
                f"{path}: found an array of shape {dense.shape}, expected a square "
                "matrix of numbers"
            )
        return csr_array(dense.astype(float))
    except OSError as error:
        reason = error.strerror or one_line(str(error), 100)
        raise BadInput(f"{path}: cannot be read: {reason}") from None
    except BadInput:
        raise
    except Exception as error:  # a damaged archive may raise any exception
        raise BadInput(
            f"{path}: not a NumPy or SciPy matrix: {one_line(str(error), 100)}"
        ) from None


def _user_element(path: Path, text: str, which: str) -> tuple[csr_array, list[Freedom]]:
    """Read the degrees of freedom and the matrix of a ``*USER ELEMENT``."""
    nodes: list[int] = []
    lines: list[list[int]] = []
    values: dict[str, list[float]] = {"stiffness": [], "mass": []}
    part = ""
    for line in text.split("\n"):
        upper = line.strip().upper()
        if upper.startswith("**"):
            listed = re.fullmatch(r"[\d,\s]+", upper[2:])
            if "ELEMENT NODES" in upper:
                part = "nodes"
            elif part == "nodes" and listed:
                nodes += [int(word) for word in re.findall(r"\d+", upper)]
        elif upper.startswith("*MATRIX"):
            kind = re.search(r"TYPE\s*=\s*(\w+)", upper)
            part = _KINDS.get(kind[1] if kind else "", "other")
        elif upper.startswith("*"):
            part = "nodes" if part == "nodes" else ""
        elif part == "nodes" and upper:
            lines.append([whole(path, word) for word in upper.split(",") if word])
        elif part in values and upper:
            words = re.split(r"[,\s]+", upper.strip(" ,"))
            values[part] += [real(path, word) for word in words]
    if not nodes or not lines or not lines[0]:
        raise BadInput(
            f"{path}: found no nodes and degrees of freedom, expected ** ELEMENT NODES "
            "in *USER ELEMENT"
        )
    changes = {1: lines[0], **{row[0]: row[1:] for row in lines[1:]}}
    freedoms: list[Freedom] = []
    now: list[int] = []
    for place, node in enumerate(nodes, 1):
        now = changes.get(place, now)
        freedoms += [(node, direction) for direction in now]
    n, given = len(freedoms), values[which]
    if len(given) != n * (n + 1) // 2:
        raise BadInput(
            f"{path}: {which}: found {len(given)} numbers, expected "
            f"{n * (n + 1) // 2}: the lower triangle for {n} degrees of freedom of "
            f"{len(set(nodes))} nodes"
        )
    K = np.zeros((n, n))
    K[np.tril_indices(n)] = given
    return csr_array(K + np.tril(K, -1).T), freedoms


def _columns(path: Path, text: str) -> tuple[csr_array, list[Freedom] | None]:
    """Read a matrix from lines with five or three columns."""
    named: dict[tuple[Freedom, Freedom], float] = {}
    unnamed: dict[tuple[int, int], float] = {}
    for number, line in enumerate(text.split("\n"), 1):
        if not line.strip() or line.lstrip().startswith(("*", "#")):
            continue
        words = re.split(r"[,\s]+", line.strip(" ,\t\r"))
        if len(words) not in ({3} if unnamed else {5} if named else {3, 5}):
            raise BadInput(
                f"{path}: line {number}: found {len(words)} words, expected "
                f"{'' if unnamed else 'node, direction, node, direction, value'}"
                f"{'' if unnamed or named else ', or '}"
                f"{'' if named else 'row, column, value'}"
            )
        *places, value = words
        where = [whole(path, word) for word in places]
        if len(where) == 4:
            a, b, c, d = where
            named[(a, b), (c, d)] = real(path, value)
        elif min(where) < 1 or max(where) > LARGEST:
            raise BadInput(
                f"{path}: line {number}: found row {where[0]}, column {where[1]}, "
                f"expected 1 to {LARGEST}"
            )
        else:
            unnamed[where[0], where[1]] = real(path, value)
    if not unnamed:
        return _from_entries(path, named)
    last = max(map(max, unnamed))
    matrix = _of_rows(unnamed, {row: row - 1 for row in range(1, last + 1)})
    names = path.with_suffix(".dof")
    if path.suffix.lower() in {".sti", ".mas"} and names.exists():
        return matrix, _named_by(names, last)
    return matrix, None


def _named_by(path: Path, n: int) -> list[Freedom]:
    """Read the degrees of freedom of the rows from a ``.dof`` file of CalculiX."""
    words = read_text(path).split()
    freedoms: list[Freedom] = []
    for word in words:
        node, point, direction = word.partition(".")
        if not point:
            raise BadInput(f"{path}: found {describe(word)}, expected node.direction")
        freedoms.append((whole(path, node), whole(path, direction)))
    if len(set(freedoms)) != n:
        raise BadInput(
            f"{path}: found {len(set(freedoms))} degrees of freedom, expected {n}, the "
            "number of rows of the matrix"
        )
    return freedoms


def _from_entries(
    path: Path, entries: dict[tuple[Freedom, Freedom], float]
) -> tuple[csr_array, list[Freedom]]:
    """Build a symmetric matrix from the entries of one or both triangles."""
    freedoms = sorted({freedom for pair in entries for freedom in pair})
    if not freedoms or len(freedoms) > LARGEST:
        raise BadInput(f"{path}: found no matrix entries")
    row = {freedom: k for k, freedom in enumerate(freedoms)}
    return _of_rows(entries, row), freedoms


def _of_rows(
    entries: Mapping[tuple[Any, Any], float], row: Mapping[Any, int]
) -> csr_array:
    """Build a symmetric matrix from entries with named rows and columns."""
    # a missing triangle is the transpose of the given triangle
    whole = {**{(b, a): v for (a, b), v in entries.items()}, **entries}
    i, j = [row[a] for a, _ in whole], [row[b] for _, b in whole]
    shape = (len(row), len(row))
    return csr_array(coo_array((list(whole.values()), (i, j)), shape=shape))
