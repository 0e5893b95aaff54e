"""Reader of Harwell-Boeing matrices and mapping files from Ansys.

Ansys writes the rows of a matrix in an internal order. This order is read from a
mapping file, which has the name of the matrix file and the suffix ``.mapping``. Ansys
writes this file

- with the command ``HBMAT,name,,,ASCII,STIFF,NO,YES``, as lines with row, node and
  label such as ``UX``,
- or with the commands ``*VEC,map,I,IMPORT,FULL,file.full,BACK`` and
  ``*EXPORT,map,MMF,name.mapping``, as a Matrix Market vector of nodes. All rows of a
  node are then consecutive.

Sources:
    Ansys Command Reference, HBMAT, *EXPORT, *VEC; Duff, Grimes, Lewis (1992), Users'
    guide for the Harwell-Boeing sparse matrix collection.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from forcefit.inputs.errors import BadInput, describe, nearest
from forcefit.inputs.table import read_text

LARGEST = 2_000_000  # largest accepted number of rows
LABELS = ("UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ")
_FORMAT = re.compile(r"\(\s*(?:1P,?)?\s*(\d*)\s*([IEDFG])(\d+)(?:\.\d+\S*)?\s*\)", re.I)
_NUMBER = re.compile(r"[+-]?\d+(?:\.\d*)?(?:[ED][+-]?\d+)?|[+-]?\.\d+(?:[ED][+-]?\d+)?")


def harwell_boeing(path: Path, text: str) -> csr_array:
    """Read a real assembled matrix from the text of a Harwell-Boeing file.

    The reader of SciPy 1.17 is not used, because it does not support type RSA,
    right-hand sides, or exponents with the letter D.

    Args:
        path: path of the file, for error messages.
        text: text of the file.

    Returns:
        (n, n) complete matrix.

    Raises:
        BadInput: the matrix has a different type, or the length of the file is
            inconsistent with its header.
    """
    lines = text.split("\n")
    try:
        counts = [int(word) for word in lines[1].split()]
        kind, *sizes = lines[2].split()
        rows, columns, entries = (int(size) for size in sizes[:3])
        formats = _FORMAT.findall(lines[3])
        widths = [int(width) for *_, width in formats]
    except (IndexError, ValueError):
        raise BadInput(
            f"{path}: found an incomplete header, expected a Harwell-Boeing file"
        ) from None
    if kind.upper() not in {"RSA", "RUA"} or len(counts) < 4 or len(formats) < 3:
        raise BadInput(
            f"{path}: found the matrix type {describe(kind)}, expected RSA or RUA (a "
            "real assembled matrix)"
        )
    if not 0 < rows == columns <= LARGEST:
        raise BadInput(
            f"{path}: found {rows} by {columns} numbers, expected a square matrix"
        )
    begin = 5 if len(counts) > 4 and counts[4] > 0 else 4
    parts = []
    for count, width in zip(counts[1:4], widths, strict=False):
        parts.append(_fields(path, lines[begin : begin + count], width))
        begin += count
    starts, places, values = parts
    expected = (columns + 1, entries, entries)
    found = tuple(len(part) for part in parts)
    if (
        found != expected
        or np.any(np.diff(starts) < 0)
        or (starts[0], starts[-1]) != (1, entries + 1)
    ):
        raise BadInput(
            f"{path}: found {found[1]} row indices and {found[2]} values in {columns} "
            f"columns, expected {entries} row indices and {entries} values"
        )
    i = places.astype(int) - 1
    j = np.repeat(np.arange(columns), np.diff(starts).astype(int))
    if i.min(initial=0) < 0 or i.max(initial=0) >= rows:
        raise BadInput(f"{path}: found a row number above {rows}, expected 1 to {rows}")
    half = csr_array(coo_array((values, (i, j)), shape=(rows, columns)))
    return both_halves(half) if kind.upper() == "RSA" else half


def both_halves(matrix: csr_array) -> csr_array:
    """Complete a symmetric matrix from its upper or lower triangle."""
    return csr_array(matrix + matrix.T - diags_array(matrix.diagonal()))


def _fields(path: Path, lines: list[str], width: int) -> NDArray:
    """Parse numbers in fields of a fixed width."""
    words = [
        line[k : k + width].strip()
        for line in lines
        for k in range(0, len(line.rstrip()), max(width, 1))
    ]
    for word in words:
        if not _NUMBER.fullmatch(word.upper()):
            raise BadInput(f"{path}: found {describe(word)}, expected a number")
    return np.array([float(word.upper().replace("D", "E")) for word in words])


def read_mapping(path: Path) -> list[int] | list[tuple[int, int]]:
    """Read the degree of freedom of each matrix row from a mapping file.

    Args:
        path: mapping file.

    Returns:
        Either node and direction (1 to 6) of each row, or the nodes in the order of
        their rows.

    Raises:
        BadInput: the file is invalid.
    """
    text = read_text(path)
    lines = [line for line in text.split("\n") if line.strip()]
    if text.startswith("%%MatrixMarket"):
        words = [word for line in lines if line[0] != "%" for word in line.split()]
        if len(words) < 3:
            raise BadInput(f"{path}: found no vector of nodes")
        rows, columns, *nodes = (_whole(path, word) for word in words)
        if columns != 1 or len(nodes) != rows or len(set(nodes)) != rows:
            raise BadInput(
                f"{path}: found {len(set(nodes))} different nodes, expected one column "
                f"with {rows} different nodes"
            )
        return nodes
    freedoms: dict[int, tuple[int, int]] = {}
    for line in lines:
        words = line.split()
        if not words[0].isdecimal():
            continue  # this line is a heading
        if len(words) != 3:
            raise BadInput(
                f"{path}: found {describe(line.strip())}, expected a row number, a "
                "node number and a label such as UX"
            )
        label = words[2].upper()
        if label not in LABELS:
            hint = nearest(label, LABELS)
            raise BadInput(f"{path}: found the label {describe(words[2])}{hint}")
        row, node = (_whole(path, word) for word in words[:2])
        freedoms[row] = node, LABELS.index(label) + 1
    if sorted(freedoms) != list(range(1, len(freedoms) + 1)) or not freedoms:
        raise BadInput(
            f"{path}: found rows with gaps or repeated numbers, expected rows "
            "numbered from 1 without gaps"
        )
    return [freedoms[row] for row in sorted(freedoms)]


def _whole(path: Path, word: str) -> int:
    """Parse a row number or a node number."""
    if not re.fullmatch("[0-9]{1,12}", word):
        raise BadInput(f"{path}: found {describe(word)}, expected a node number")
    return int(word)
