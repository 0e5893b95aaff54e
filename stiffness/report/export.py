"""Export of link stiffnesses as text for other programs."""

import csv
import io
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.table import BadInput, nearest
from forcefit.stiffness.report.library import Entry
from forcefit.stiffness.screws import SCREW

# programs whose order is translations before rotations
PROGRAMS = ("exudyn", "adams", "mapdl")
_SWAPPED = [3, 4, 5, 0, 1, 2]


def translations_first(matrix: ArrayLike) -> NDArray:
    """Reorder a matrix to translations before rotations.

    Args:
        matrix: (6, 6) stiffness or compliance in the order [R T].

    Returns:
        (6, 6) matrix in the order [T R].
    """
    return np.asarray(matrix, dtype=float)[np.ix_(_SWAPPED, _SWAPPED)]


def stiffness_for(program: str, stiffness: ArrayLike, name: str = "link") -> str:
    """Format a stiffness as text for another program, in SI units.

    Args:
        program: ``"exudyn"`` for the ``stiffness`` of a RigidBodySpringDamper,
            ``"adams"`` for the K matrix of a FIELD statement, or ``"mapdl"`` for a
            MATRIX27 element between two coincident nodes.
        stiffness: (6, 6) stiffness in the order [R T].
        name: name of the link, for comments in the text.

    Returns:
        The text.

    Raises:
        BadInput: the program is unknown.
    """
    if program not in PROGRAMS:
        raise BadInput(f'program: unknown "{program}"{nearest(program, PROGRAMS)}')
    K = translations_first(stiffness)
    rows = [", ".join(f"{v:.12e}" for v in row) for row in K]
    if program == "exudyn":
        body = ",\n    ".join(f"[{row}]" for row in rows)
        return f"# {name}: order [TX TY TZ RX RY RZ]\nstiffness = [\n    {body}]\n"
    if program == "adams":
        # column by column, as required by FIELD
        columns = ",\n, ".join(", ".join(f"{v:.12e}" for v in column) for column in K.T)
        return f"! {name}: order X Y Z AX AY AZ\n, KMATRIX = {columns}\n"
    both = np.block([[K, -K], [-K, K]])
    lower = both[np.tril_indices(12)]
    lines = [f"! {name}: MATRIX27, KEYOPT(3)=4, order UX UY UZ ROTX ROTY ROTZ"]
    for start in range(0, 78, 6):
        values = ",".join(f"{v:.12e}" for v in lower[start : start + 6])
        command = "R,1" if start == 0 else "RMORE"
        lines.append(f"{command},{values}")
    return "\n".join(lines) + "\n"


def library_csv(entries: Sequence[Entry]) -> str:
    """Format a library as CSV text.

    Args:
        entries: entries of a library.

    Returns:
        A header line, and for each entry its parameters and the upper triangle of K.
    """
    names = sorted({name for e in entries for name in e.parameters})
    upper = [(i, j) for i in range(6) for j in range(i, 6)]
    out = io.StringIO()
    table = csv.writer(out, lineterminator="\n")
    heads = [f"K_{SCREW[i]}_{SCREW[j]}" for i, j in upper]
    table.writerow(["key", *names, *heads, "relative_error_estimate"])
    for e in entries:
        values = [repr(float(e.stiffness[i, j])) for i, j in upper]
        given = [e.parameters.get(name, "") for name in names]
        table.writerow([e.key, *given, *values, e.about["relative_error_estimate"]])
    return out.getvalue()
