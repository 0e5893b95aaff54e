"""Export of a link as a stiffness matrix of two nodes."""

import io
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import BadInput, nearest, one_line, quoted
from forcefit.inputs.table import read_text
from forcefit.stiffness.exchange.import_link import LENGTHS
from forcefit.stiffness.exchange.two_interfaces import both_ends
from forcefit.stiffness.report.export import PROGRAMS, stiffness_for

FORMATS = ("matrix-market", "abaqus", "calculix", "nastran", "numpy", *PROGRAMS)
# indices that reorder rows to translations before rotations at each node
_FEM = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]


def read_link_results(path: Path | str) -> tuple[NDArray, NDArray]:
    """Read the stiffness of a link from a file written with ``--json``.

    Args:
        path: the JSON file.

    Returns:
        Stiffness K_E in SI units, (6, 6), and the vector from tip to base, (3,) [m].

    Raises:
        BadInput: the file does not contain the stiffness of a link.
    """
    try:
        content = json.loads(read_text(path))
        K = np.array(content["stiffness"], dtype=float)
        offset = np.array(content["base"], dtype=float) - np.array(content["tip"])
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        reason = one_line(str(error), 80)
        raise BadInput(
            f"{path}: found no stiffness, base and tip of a link ({reason}); expected "
            "a file that forcefit stiffness beam, fea or convert wrote with --json"
        ) from None
    if K.shape != (6, 6) or offset.shape != (3,) or not np.isfinite(K).all():
        raise BadInput(f"{path}: stiffness: expected 6 rows of 6 finite numbers")
    # larger numbers could overflow in products
    if not max(np.abs(K).max(), np.abs(offset).max()) < 1e100:
        raise BadInput(
            f"{path}: found numbers above 1e100, expected the stiffness of a "
            "link in SI units"
        )
    return K, offset


def link_file(
    stiffness: NDArray, base_from_tip: NDArray, to: str, unit: str = "m"
) -> bytes:
    """Format the stiffness of a link as the text of a file for another program.

    Args:
        stiffness: (6, 6) stiffness at the tip, in SI units, rotations first.
        base_from_tip: (3,) [m] vector from tip to base.
        to: name of the format, one of ``FORMATS``.
        unit: unit of length in the file. Forces are in N, and rotations in rad.

    Returns:
        The text. For ``exudyn``, ``adams`` and ``mapdl``, it is the result of
        :func:`forcefit.stiffness.report.export.stiffness_for`.

    Raises:
        BadInput: the format or the unit is unknown, or the format requires metres.
    """
    for option, value, valid in (("--to", to, FORMATS), ("--unit", unit, LENGTHS)):
        if value not in valid:
            raise BadInput(f"{option}: found {quoted(value)}{nearest(value, valid)}")
    if to in PROGRAMS:
        if unit != "m":
            raise BadInput(
                f"--unit: found {quoted(unit)}, expected m, because --to {to} "
                "is written in SI units"
            )
        return stiffness_for(to, stiffness).encode()
    length = LENGTHS[unit]
    scale = np.tile(np.repeat([length, 1.0], 3), 2)
    K = both_ends(stiffness, base_from_tip)[np.ix_(_FEM, _FEM)]
    K = K * np.outer(scale, scale) / length
    if to == "numpy":
        content = io.BytesIO()
        np.save(content, K)
        return content.getvalue()
    writers = {"matrix-market": _matrix_market, "abaqus": _user_element,
               "calculix": _five_columns, "nastran": _dmig}  # fmt: skip
    return writers[to](K).encode()


def _lower(K: NDArray) -> list[tuple[int, int, float]]:
    """Return row, column and value of the entries in the lower triangle."""
    return [(i, j, float(K[i, j])) for j in range(12) for i in range(j, 12)]


def _matrix_market(K: NDArray) -> str:
    """Format a symmetric matrix as a Matrix Market file."""
    rows = [f"{i + 1} {j + 1} {v!r}" for i, j, v in _lower(K)]
    head = "%%MatrixMarket matrix coordinate real symmetric\n% X Y Z RX RY RZ, twice"
    return "\n".join([head, f"12 12 {len(rows)}", *rows]) + "\n"


def _user_element(K: NDArray) -> str:
    """Format a matrix as an Abaqus ``*USER ELEMENT``."""
    lines = ["*USER ELEMENT,NODES=2,LINEAR", "** ELEMENT NODES", "** 1, 2",
             "1, 2, 3, 4, 5, 6", "*MATRIX,TYPE=STIFFNESS"]  # fmt: skip
    for i in range(12):
        row = [f"{v!r}" for v in K[i, : i + 1].tolist()]
        lines += [", ".join(row[k : k + 4]) + "," for k in range(0, i + 1, 4)]
    return "\n".join(lines) + "\n"


def _five_columns(K: NDArray) -> str:
    """Format a matrix as lines with node, direction, node, direction and value."""
    return "".join(
        f"{i // 6 + 1},{i % 6 + 1},{j // 6 + 1},{j % 6 + 1},{v!r}\n"
        for i, j, v in _lower(K)
    )


def _dmig(K: NDArray) -> str:
    """Format a symmetric matrix as a Nastran DMIG entry with wide fields."""
    lines = ["DMIG    K2GG           0       6       2       0"]
    for j in range(12):
        lines.append(f"DMIG*   {'K2GG':16}{j // 6 + 1:16}{j % 6 + 1:16}")
        for i in range(j, 12):
            lines.append(f"*       {i // 6 + 1:16}{i % 6 + 1:16}{K[i, j]:16.9E}")
    return "\n".join(lines) + "\n"
