"""Beams along a curve from a file: straight pieces, tapered pieces and arcs."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.table import BadInput, Table, read_toml
from forcefit.stiffness.beam.curve import Piece, arc_piece, straight_piece
from forcefit.stiffness.beam.sections import Section, check_section, declared_section

_LARGEST = 1e6  # largest absolute value in SI units; no beam has a larger one


def read_curve(path: Path | str, nu: float) -> list[Piece]:
    """Return the pieces of a beam.

    Args:
        path: TOML file with tables ``[[piece]]``.  Each has a ``section``, as in a
            robot file or with ``wall`` (a box), ``web`` and ``flange`` (an I); if
            absent, the section of the piece before it is used.  A straight piece has
            ``end``, optionally ``up``, and ``tip_section`` if it is tapered (its
            lengths change linearly).  An arc has ``center`` and ``turn``, a rotation
            vector.  ``start`` [m] belongs to the first piece and is the origin if
            absent.
        nu: [-] Poisson's ratio, on which shear factors depend.

    Returns:
        The pieces from base to tip.

    Raises:
        BadInput: the file, a name or a value is invalid.
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
    """Return the pieces of a beam from their tables.

    Args:
        tables: at least one table, with the keys of :func:`read_curve`.
        start: (3,) [m] start of the first piece.
        nu: [-] Poisson's ratio, on which shear factors depend.

    Returns:
        The pieces from base to tip.

    Raises:
        BadInput: a name or a value is invalid.
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
    """Return the lengths or constants of a section by name."""
    inner = part.table(key)
    given = {
        name: inner.number(name, "m", largest=_LARGEST) for name in list(inner.content)
    }
    check_section(f"{part.file}: {part.place}.{key}", given)
    return given


def _piece(
    part: Table, start: NDArray, section: Mapping[str, float], nu: float
) -> Piece:
    """Return one piece of the curve."""
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
    """Return a constant section, or a section whose lengths change linearly."""
    constant = declared_section(section, nu)
    if not part.has("tip_section"):
        return constant
    tip = _section(part, "tip_section")
    if set(tip) != set(section) or "area" in tip:
        raise part.bad(
            "tip_section",
            "found different lengths at both ends of a tapered piece, "
            "expected the same names",
        )
    declared_section(tip, nu)

    def between(t: float) -> Section:
        return declared_section(
            {k: (1 - t) * v + t * tip[k] for k, v in section.items()}, nu
        )

    return between
