"""Matrices as other programs write them, each with the freedoms of its rows.

=================  ===============================================================
file               written by
=================  ===============================================================
Matrix Market      Ansys (HBMAT's successor), SciPy, Exudyn scripts: ``.mtx``
user element       Abaqus and CalculiX, ``*SUBSTRUCTURE MATRIX OUTPUT``: ``.mtx``
five columns       Abaqus ``*MATRIX OUTPUT``, CalculiX ``OUTPUT FILE=MATRIX``
DMIG               Nastran, small, large or free fields: ``.pch``, ``.dmig``
NumPy              ``.npy``, SciPy's sparse ``.npz``
=================  ===============================================================

Sources:
    NIST Matrix Market exchange formats; CalculiX 2.21 manual, SUBSTRUCTURE MATRIX
    OUTPUT; Nastran Quick Reference Guide, DMIG (form 6 gives one half).
"""

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array, csr_array

from forcefit.inputs.errors import BadInput, describe, one_line
from forcefit.inputs.table import read_text

Freedom = tuple[int, int]
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[EeDd]?([+-]?\d+))?")
_ENDINGS = (".mtx", ".pch", ".dmig", ".bdf", ".dat", ".txt", ".npy", ".npz")
_KINDS = {"STIFFNESS": "stiffness", "MASS": "mass"}
_LARGEST = 2_000_000  # rows


@dataclass(frozen=True, eq=False)
class FileMatrix:
    """A symmetric matrix of a file.

    Attributes:
        file: its name, for messages.
        matrix: (n, n) both halves.
        freedoms: node and direction, 1 to 3 shifts and 4 to 6 turns, of each row.
        named: whether the file says the freedoms itself.
    """

    file: str
    matrix: csr_array
    freedoms: tuple[Freedom, ...]
    named: bool


def read_matrix(path: Path | str, which: str = "stiffness") -> FileMatrix:
    """A matrix of a file, its kind told by its content.

    Args:
        path: the file.
        which: ``"stiffness"`` or ``"mass"``, where the file holds both.

    Returns:
        The matrix; rows that the file does not name are six a node, from node 1.

    Raises:
        BadInput: the file is none of these, its matrix is not square, not finite or
            not symmetric, or of no freedoms.
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
        if text.startswith("%%MatrixMarket"):
            matrix, freedoms = _matrix_market(path, text), None
        elif re.search(r"^\s*\*USER ELEMENT", text, re.M | re.I):
            matrix, freedoms = _user_element(path, text, which)
        elif re.search(r"^DMIG", text, re.M):
            matrix, freedoms = _dmig(path, text)
        else:
            matrix, freedoms = _five_columns(path, text)
    return _checked(path, matrix, freedoms)


def _checked(
    path: Path, matrix: csr_array, freedoms: list[Freedom] | None
) -> FileMatrix:
    """The matrix, if it is square, finite and symmetric."""
    n = matrix.shape[0]
    if matrix.shape != (n, n) or not n:
        raise BadInput(f"{path}: found {matrix.shape} numbers, expected a square")
    if not (np.abs(matrix.data) < 1e100).all():  # products of them are numbers
        raise BadInput(f"{path}: found a number that is not finite, or above 1e100")
    if freedoms is None and n % 6:
        raise BadInput(
            f"{path}: found {n} rows without names, expected six for each node, or a "
            "format that names them"
        )
    size = np.sqrt(np.abs(matrix.diagonal()))
    gap = abs(matrix - matrix.T).tocoo()
    scale = size[gap.row] * size[gap.col]
    wrong = gap.data > 1e-6 * scale
    if wrong.any():
        k = int(np.argmax(np.where(wrong, gap.data, -1.0)))
        i, j = int(gap.row[k]), int(gap.col[k])
        raise BadInput(
            f"{path}: not symmetric: found [{i + 1}, {j + 1}] = {matrix[i, j]:.6e} but "
            f"[{j + 1}, {i + 1}] = {matrix[j, i]:.6e}"
        )
    given = freedoms or [(k // 6 + 1, k % 6 + 1) for k in range(n)]
    both = csr_array((matrix + matrix.T) / 2)
    return FileMatrix(str(path), both, tuple(given), freedoms is not None)


def _numpy(path: Path) -> csr_array:
    """``.npy``, or a sparse ``.npz``; never a pickle."""
    from scipy.sparse import load_npz

    try:
        if path.suffix.lower() == ".npz":
            return csr_array(load_npz(path).astype(float))
        dense = np.load(path, allow_pickle=False)
        if dense.ndim != 2 or dense.dtype.kind not in "fiu":
            raise BadInput(f"{path}: found {dense.shape}, expected a square of numbers")
        return csr_array(dense.astype(float))
    except OSError as error:
        reason = error.strerror or one_line(str(error), 100)
        raise BadInput(f"{path}: cannot be read: {reason}") from None
    except BadInput:
        raise
    except Exception as error:  # of many kinds: a damaged archive
        raise BadInput(
            f"{path}: no matrix of NumPy or SciPy: {one_line(str(error), 100)}"
        ) from None


def _matrix_market(path: Path, text: str) -> csr_array:
    """``%%MatrixMarket matrix ...``."""
    from scipy.io import mmread

    try:
        matrix = mmread(io.BytesIO(text.encode()))
        return csr_array(matrix, dtype=float)
    except (ValueError, TypeError, OverflowError, MemoryError) as error:
        reason = one_line(str(error), 200)
        raise BadInput(f"{path}: no Matrix Market file: {reason}") from None


def _user_element(path: Path, text: str, which: str) -> tuple[csr_array, list[Freedom]]:
    """``*USER ELEMENT``: nodes in comments, their freedoms, lower halves by rows."""
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
            lines.append([_whole(path, word) for word in upper.split(",") if word])
        elif part in values and upper:
            words = re.split(r"[,\s]+", upper.strip(" ,"))
            values[part] += [_real(path, word) for word in words]
    if not nodes or not lines or not lines[0]:
        raise BadInput(f"{path}: found no ** ELEMENT NODES and their freedoms")
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
            f"{n * (n + 1) // 2}: "
            f"the lower half of {n} freedoms at {len(set(nodes))} nodes"
        )
    K = np.zeros((n, n))
    K[np.tril_indices(n)] = given
    return csr_array(K + np.tril(K, -1).T), freedoms


def _five_columns(path: Path, text: str) -> tuple[csr_array, list[Freedom]]:
    """Lines of node, direction, node, direction, value; one half or both."""
    entries: dict[tuple[Freedom, Freedom], float] = {}
    for number, line in enumerate(text.split("\n"), 1):
        if not line.strip() or line.lstrip().startswith(("*", "#")):
            continue
        words = re.split(r"[,\s]+", line.strip(" ,\t"))
        if len(words) != 5:
            raise BadInput(
                f"{path}: line {number}: found {len(words)} words, expected node, "
                "direction, node, direction, value; or another format that is known"
            )
        a, b, c, d = (_whole(path, word) for word in words[:4])
        entries[(a, b), (c, d)] = _real(path, words[4])
    return _from_entries(path, entries)


def _dmig(path: Path, text: str) -> tuple[csr_array, list[Freedom]]:
    """``DMIG`` of one name, in any of its three widths of fields."""
    entries: dict[tuple[Freedom, Freedom], float] = {}
    names: set[str] = set()
    column: Freedom | None = None
    for line in text.split("\n"):
        if not line.strip() or line.startswith("$"):
            continue
        head, fields = _fields(line)
        if head.startswith("DMIG"):
            names.add(fields[0])
            if fields[1] in {"0", ""}:  # the header: form, types
                if fields[2] not in {"1", "6", ""}:
                    form = describe(fields[2])
                    raise BadInput(f"{path}: form {form}, expected 6 or 1, real")
                column = None
                continue
            column = _whole(path, fields[1]), max(1, _whole(path, fields[2] or "0"))
            fields = fields[4:]
        elif column is None or not head.startswith(("*", "+", " ")) and head:
            column = None
            continue
        for start in range(0, len(fields) - 2, 4):
            node, direction, value = fields[start : start + 3]
            if node:
                row = _whole(path, node), max(1, _whole(path, direction or "0"))
                entries[row, column] = _real(path, value)
    if len(names) != 1:
        matrices = ", ".join(sorted(names)) or "none"
        raise BadInput(f"{path}: found the matrices {matrices}, expected exactly one")
    return _from_entries(path, entries)


def _fields(line: str) -> tuple[str, list[str]]:
    """The first field of a bulk data line, and its others, all eight or four."""
    if "," in line:
        head, *fields = [word.strip() for word in line.split(",")]
        count = 4 if head.endswith("*") else 8
    else:
        head, rest = line[:8].strip(), line[8:72]
        count = 4 if "*" in head else 8
        width = 64 // count
        fields = [rest[k : k + width].strip() for k in range(0, 64, width)]
    return head.upper().rstrip("*") or " ", (fields + [""] * count)[:count]


def _from_entries(
    path: Path, entries: dict[tuple[Freedom, Freedom], float]
) -> tuple[csr_array, list[Freedom]]:
    """A matrix from entries of one half or both."""
    freedoms = sorted({freedom for pair in entries for freedom in pair})
    if not freedoms or len(freedoms) > _LARGEST:
        raise BadInput(f"{path}: found no entries of a matrix")
    row = {freedom: k for k, freedom in enumerate(freedoms)}
    # a half that is not there is the other one's
    whole = entries | {
        (b, a): v for (a, b), v in entries.items() if (b, a) not in entries
    }
    i = [row[a] for a, _ in whole]
    j = [row[b] for _, b in whole]
    shape = (len(freedoms), len(freedoms))
    return csr_array(coo_array((list(whole.values()), (i, j)), shape=shape)), freedoms


def _whole(path: Path, word: str) -> int:
    """A whole number."""
    try:
        return int(word)
    except ValueError:
        raise BadInput(
            f"{path}: found {describe(word.strip())}, expected a whole number"
        ) from None


def _real(path: Path, word: str) -> float:
    """A number, its exponent perhaps without a letter or with a D (Fortran)."""
    match = _REAL.fullmatch(word.strip())
    if not match:
        raise BadInput(f"{path}: found {describe(word.strip())}, expected a number")
    mantissa, exponent = match.groups()
    return float(f"{mantissa}e{exponent or 0}")
