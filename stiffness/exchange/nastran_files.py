"""Reader of Nastran bulk data lines and ``DMIG`` matrices.

Fields are separated by commas or blanks, or have a fixed width of eight characters. The
width is sixteen if the first field ends with ``*``.

Sources:
    MSC Nastran Quick Reference Guide: Bulk Data, DMIG, EXTSEOUT.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from forcefit.inputs.errors import BadInput, describe
from forcefit.stiffness.exchange.real_numbers import real, whole

Freedom = tuple[int, int]
Entries = dict[tuple[Freedom, Freedom], float]
DMIG = re.compile(r"^DMIG[*\s,]", re.M | re.I)
# matrix names used by Nastran
_OWN_NAME = re.compile(r"(K4|K|B|M)2?(AAX?|GG|PP|LL|FF)")
_WHAT = {"K": "stiffness", "M": "mass", "K4": "structural damping",
         "B": "viscous damping"}  # fmt: skip


def bulk_fields(line: str) -> tuple[str, list[str]]:
    """Split a line of bulk data into fields.

    Args:
        line: line of bulk data.

    Returns:
        The first field in capitals, and the other fields.
    """
    if "," in line:
        head, *fields = [word.strip() for word in line.split(",")]
        return head.upper(), fields
    head = line[:8].strip()
    width = 16 if "*" in head else 8
    fields = [line[k : k + width].strip() for k in range(8, 72, width)]
    if any(re.search(r"\s", field) for field in (head, *fields)):
        # fields of fixed width do not contain inner blanks
        head, *fields = line.split()
    return head.upper(), fields


def dmig_entries(path: Path | str, text: str, which: str) -> Entries:
    """Read the entries of the stiffness or mass matrix from the text of a file.

    Args:
        path: path of the file, for error messages.
        text: text of the file.
        which: ``"stiffness"`` or ``"mass"``.

    Returns:
        Dictionary from pairs of degrees of freedom (row, column) to values.

    Raises:
        BadInput: the file does not contain exactly one such matrix, or the matrix is
            not square and real.
    """
    matrices: dict[str, Entries] = {}
    forms: dict[str, str] = {}
    entries: Entries | None = None
    for line in text.split("\n"):
        if not line.strip() or line.startswith("$"):
            continue
        head, fields = bulk_fields(line)
        packed = "," not in line and "" not in fields
        if head.rstrip("*") == "DMIG":
            name, node, direction = (fields + [""] * 3)[:3]
            entries = matrices.setdefault(name.upper(), {})
            if node in {"0", ""}:  # this line is the header
                forms[name.upper()], entries = direction, None
                continue
            column = whole(path, node), max(1, whole(path, direction or "0"))
            fields = fields[3:]
        elif entries is None or (head and head[0] not in "*+"):
            entries = None
            continue
        for row, value in _terms(path, fields, packed):
            if entries.setdefault((row, column), value) != value:
                raise BadInput(
                    f"{path}: {name.upper()}: row {row[0]} {row[1]}, column "
                    f"{column[0]} {column[1]}: found {entries[row, column]:g} and "
                    f"{value:g}, expected one value"
                )
    return matrices[_chosen(path, matrices, forms, which)]


def _terms(
    path: Path | str, fields: list[str], packed: bool
) -> list[tuple[Freedom, float]]:
    """Parse the terms in a line of a matrix column.

    A term consists of node, direction, real part and imaginary part of an entry.

    Args:
        path: path of the file, for error messages.
        fields: fields of the line without those that name the column.
        packed: True if fields are separated by blanks, so that terms have no imaginary
            part.

    Returns:
        Row and value of each term.

    Raises:
        BadInput: a term is incomplete or complex, or a number is invalid.
    """
    terms, waiting = [], list(fields)
    while waiting:
        if not waiting[0] or waiting[0].startswith(("+", "*")):  # continuation field
            waiting.pop(0)
            continue
        if len(waiting) < 3:
            found = describe(" ".join(waiting).strip())
            raise BadInput(
                f"{path}: found {found} at the end of a line, expected a complete term "
                "of node, direction and value"
            )
        node, direction, value = waiting[:3]
        row = whole(path, node), max(1, whole(path, direction or "0"))
        terms.append((row, real(path, value)))
        imaginary = "" if packed else "".join(waiting[3:4])
        if imaginary and imaginary[0] not in "+*" and real(path, imaginary):
            raise BadInput(
                f"{path}: row {row[0]} {row[1]}: found the real part {describe(value)} "
                f"and the imaginary part {describe(imaginary)}, expected a real matrix"
            )
        del waiting[: 3 if packed else 4]
    return terms


def _chosen(
    path: Path | str, names: Iterable[str], forms: Mapping[str, str], which: str
) -> str:
    """Return the name of the stiffness or mass matrix in a file."""
    names = list(names)
    initial = {kind: letter for letter, kind in _WHAT.items()}[which]
    found = [name for name in names if forms.get(name, "") in {"1", "6", ""}]
    found = [name for name in found or names if _kind(name) in {which, None}]
    if len(found) > 1:
        found = [name for name in found if name.startswith(initial)]
    if len(found) != 1:
        listed = [f"{n} ({k})" if (k := _kind(n)) else n for n in sorted(names)]
        raise BadInput(
            f"{path}: found the matrices {', '.join(listed) or 'none'}, expected one "
            f"{which} matrix, or one matrix whose name begins with {initial}"
        )
    form = forms.get(found[0], "")
    if form not in {"1", "6", ""}:
        raise BadInput(
            f"{path}: found the form {describe(form)}, expected a real matrix of form "
            "6 or 1"
        )
    return found[0]


def _kind(name: str) -> str | None:
    """Return the kind of a matrix from its name in Nastran, or None if unknown."""
    match = _OWN_NAME.fullmatch(name)
    return _WHAT[match[1]] if match else None
