"""Reader of files that describe curved and tapered beams."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, Table, read_toml
from forcefit.stiffness.beam.curve import Piece, arc_piece, straight_piece
from forcefit.stiffness.beam.sections import Section, check_section, declared_section

_LARGEST = 1e6  # largest accepted absolute value in SI units


def read_curve(path: Path | str, nu: float) -> list[Piece]:
    """Read the segments of a beam from a file.

    Args:
        path: TOML file with one table ``[[piece]]`` for each segment. The key
            ``section`` contains the dimensions of the section. The default is the
            section of the previous segment. A straight segment has the key ``end`` and
            optionally ``up``. With the key ``tip_section``, a straight segment is
            tapered linearly. An arc has the keys ``center`` and ``turn``, a rotation
            vector. The first segment may have the key ``start`` [m], whose default is
            the origin.
        nu: [-] Poisson's ratio, which determines the shear factors.

    Returns:
        The segments from base to tip.

    Raises:
        BadInput: the file, a key or a value is invalid.
    """
    table = read_toml(path)
    tables = table.tables("piece")
    table.finish()
    if not tables:
        raise table.bad("piece", "missing; expected at least one [[piece]]")
    start = np.zeros(3)
    if tables[0].has("start"):
        start = tables[0].array("start", (3,), "m", largest=_LARGEST)
    return read_pieces(tables, start, nu)


def read_pieces(tables: Sequence[Table], start: NDArray, nu: float) -> list[Piece]:
    """Read the segments of a beam from TOML tables.

    Args:
        tables: one or more tables with the keys described in :func:`read_curve`.
        start: (3,) [m] start of the first segment.
        nu: [-] Poisson's ratio, which determines the shear factors.

    Returns:
        The segments from base to tip.

    Raises:
        BadInput: a key or a value is invalid.
    """
    pieces: list[Piece] = []
    section: dict[str, float] | None = None
    for part in tables:
        start = pieces[-1].place(1.0) if pieces else start
        section = _section(part, "section") if part.has("section") else section
        if section is None:
            raise part.bad("section", "missing; the first piece needs one")
        pieces.append(_piece(part, start, section, nu))
        section = _section(part, "tip_section") if part.has("tip_section") else section
        part.finish()
    return pieces


def _section(part: Table, key: str) -> dict[str, float]:
    """Read the dimensions or constants of a section."""
    inner = part.table(key)
    given = {
        name: inner.number(name, "m", largest=_LARGEST) for name in list(inner.content)
    }
    check_section(f"{part.file}: {part.place}.{key}", given)
    return given


def _piece(
    part: Table, start: NDArray, section: Mapping[str, float], nu: float
) -> Piece:
    """Read a segment from a TOML table."""
    try:
        shape = _tapered(part, section, nu)
        if part.has("turn"):
            return arc_piece(
                start,
                part.array("center", (3,), "m", largest=_LARGEST),
                part.array("turn", (3,), "rad", largest=_LARGEST),
                shape,
            )
        up = part.array("up", (3,), "1", largest=_LARGEST) if part.has("up") else None
        end = part.array("end", (3,), "m", largest=_LARGEST)
        return straight_piece(start, end, shape, up)
    except BadInput as error:
        if str(error).startswith(part.file):
            raise
        raise part.bad("", str(error)) from None


def _tapered(
    part: Table, section: Mapping[str, float], nu: float
) -> Section | Callable[[float], Section]:
    """Return a constant section, or a section whose dimensions vary linearly with t."""
    constant = declared_section(section, nu)
    if not part.has("tip_section"):
        return constant
    tip = _section(part, "tip_section")
    if set(tip) != set(section) or "area" in tip:
        raise part.bad(
            "tip_section",
            "found different dimensions at the two ends of a tapered piece, "
            'expected the keys of "section"',
        )
    declared_section(tip, nu)

    def between(t: float) -> Section:
        return declared_section(
            {k: (1 - t) * v + t * tip[k] for k, v in section.items()}, nu
        )

    return between
