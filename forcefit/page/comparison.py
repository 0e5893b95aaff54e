"""Comparison of two results: all values that differ, largest change first."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from forcefit.page.markup import piece
from forcefit.page.page import Page, Provenance, Tile, page, section
from forcefit.page.tables import Cell, Value, table
from forcefit.results.quantities import in_words, unit_of

SAME = 1e-9  # largest relative difference attributed to rounding
_LISTED = 60  # maximum number of changes in the table that is not folded
# keys of values that describe accuracy or computing time, which are not compared
_MEASURES = {"certificate", "seconds", "cuts"}
_NAMES = ("name", "part", "what", "error", "term", "frame", "component")
_HEADLINES = {"worst_clearance", "within_limits", "error", "allocation"}
_FIGURES = {("solution", "energy"), ("zone", "margin"), ("zone", "margin_free")}


@dataclass(frozen=True)
class Change:
    """Number or text that differs between two results.

    Attributes:
        place: keys that lead to the value.
        before: value in the first result, or None if it is missing.
        after: value in the second result, or None if it is missing.
    """

    place: tuple[str, ...]
    before: Any
    after: Any

    @property
    def relative(self) -> float:
        """Relative change; infinite if the first value is 0, NaN if one is missing."""
        a, b = self.before, self.after
        if not (_is_number(a) and _is_number(b)):
            return math.nan
        return (b - a) / abs(a) if a else math.copysign(math.inf, b)

    @property
    def name(self) -> str:
        """Place of the value in words."""
        return ", ".join(map(in_words, self.place))

    @property
    def unit(self) -> str:
        """SI unit of the last key with a known unit, or empty if there is none."""
        units = (unit_of(key) for key in reversed(self.place))
        return next(filter(None, units), "")


@dataclass(frozen=True)
class Comparison:
    """Differences between two results.

    Attributes:
        names: names of both results.
        titles: subject of each result, for example the name of the robot.
        changes: changed numbers, sorted by decreasing relative change, followed by
            changed texts.
        same: number of equal values.
        only: values that exist in only one of the results.
    """

    names: tuple[str, str]
    titles: tuple[str, str]
    changes: tuple[Change, ...]
    same: int
    only: tuple[Change, ...]

    def table(self) -> dict[str, Any]:
        """Return the comparison as plain values."""
        return {
            "compared": list(self.names), "same": self.same,
            "changes": [_plain(one) for one in self.changes],
            "only_in_one": [_plain(one) for one in self.only],
        }  # fmt: skip


def compare(
    first: Mapping[str, Any], second: Mapping[str, Any], names: tuple[str, str]
) -> Comparison:
    """Compare two results of the same command.

    Args:
        first: plain values of a report or a JSON file.
        second: plain values of another run of the command.
        names: names of both results.

    Returns:
        All differences.  Certificates are not compared, because they are only bounds on
        the errors of the results.
    """
    a, b = (dict(_leaves(one, ())) for one in (first, second))
    both = [place for place in a if place in b]
    sizes = _sizes(a) | _sizes(b)
    changes = [
        Change(p, a[p], b[p])
        for p in both
        if not _same(a[p], b[p], sizes.get(_vector(p), 0.0))
    ]
    only = [Change(p, v, None) for p, v in a.items() if p not in b]
    only += [Change(p, None, v) for p, v in b.items() if p not in a]
    titles = (_title(first), _title(second))
    return Comparison(
        names, titles, tuple(sorted(changes, key=_size)), len(both) - len(changes),
        tuple(only),
    )  # fmt: skip


def _leaves(value: Any, place: tuple[str, ...]) -> Any:
    """Yield each number and text in a result, with the keys that lead to it."""
    if isinstance(value, Mapping):
        for key, one in value.items():
            if key not in _MEASURES:
                yield from _leaves(one, (*place, str(key)))
    elif isinstance(value, list):
        for k, one in enumerate(value):
            yield from _leaves(one, (*place, _named(one) or str(k + 1)))
    else:
        yield place, value


def _named(row: Any) -> str:
    """Return the name used to match a list item, or an empty string."""
    if not isinstance(row, Mapping):
        return ""
    names = (row.get(key) for key in _NAMES)
    return " ".join(name for name in names if isinstance(name, str))


def _is_number(value: Any) -> bool:
    """Return whether a value is a number, excluding booleans."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _vector(place: tuple[str, ...]) -> tuple[str, ...]:
    """Return the place of the vector or matrix that contains a component."""
    while len(place) > 1 and place[-1].isdigit():
        place = place[:-1]
    return place


def _sizes(leaves: Mapping[tuple[str, ...], Any]) -> dict[tuple[str, ...], float]:
    """Return the largest component of each vector, which scales its rounding errors."""
    sizes: dict[tuple[str, ...], float] = {}
    for place, value in leaves.items():
        if _is_number(value) and math.isfinite(value):
            vector = _vector(place)
            sizes[vector] = max(sizes.get(vector, 0.0), abs(value))
    return sizes


def _same(a: Any, b: Any, size: float) -> bool:
    """Return whether two values agree, up to rounding errors relative to ``size``."""
    if _is_number(a) and _is_number(b):
        return math.isclose(a, b, rel_tol=SAME, abs_tol=max(1e-15, 1e-3 * SAME * size))
    return bool(a == b)


def _is_headline(place: tuple[str, ...]) -> bool:
    """Return whether a place refers to a headline number."""
    if any(key.isdigit() for key in place):
        return False
    return place[0] in _HEADLINES or place[-2:] in _FIGURES


def _size(change: Change) -> tuple[int, float, tuple[str, ...]]:
    """Return a sort key: headline numbers, then other numbers, then texts.

    Numbers within a group are sorted by decreasing relative change.
    """
    relative = change.relative
    group = 2 if math.isnan(relative) else int(not _is_headline(change.place))
    return (group, 0.0 if group == 2 else -abs(relative), change.place)


def _title(results: Mapping[str, Any]) -> str:
    """Return the title, campaign or robot described by a result."""
    keys = [key for key in ("title", "campaign", "robot") if key in results]
    return str(results[keys[0]]) if keys else "results"


def _plain(change: Change) -> dict[str, Any]:
    """Return a change as plain values."""
    relative = change.relative
    return {
        "place": list(change.place), "before": change.before, "after": change.after,
        "relative": relative if math.isfinite(relative) else None,
    }  # fmt: skip


def comparison_text(comparison: Comparison, most: int = 20) -> str:
    """Format a comparison as text.

    Args:
        comparison: comparison of two results.
        most: maximum number of changes to list.

    Returns:
        A sentence with the number of changes, followed by one line per change.
    """
    lines = [_sentence(comparison)]
    for one in comparison.changes[:most]:
        values = " to ".join(map(_brief, (one.before, one.after)))
        change = f" ({_percent(one)})" if math.isfinite(one.relative) else ""
        lines.append(f"  {one.name}: {values} {one.unit}".rstrip() + change)
    if len(comparison.changes) > most:
        lines.append(f"  and {len(comparison.changes) - most} more")
    return "\n".join(lines)


def _brief(value: Any) -> str:
    """Format a value briefly."""
    return f"{value:.6g}" if _is_number(value) else str(value)[:60]


def _sentence(comparison: Comparison) -> str:
    """Return a sentence that states the number of changes."""
    changed, same = len(comparison.changes), comparison.same
    text = f"{changed} of {changed + same} values differ"
    if comparison.only:
        text += f"; {len(comparison.only)} are only in one of the two"
    return text + "."


def comparison_page(comparison: Comparison, provenance: Provenance) -> str:
    """Return a comparison as a page.

    Args:
        comparison: comparison of two results.
        provenance: command, and the paths of both files.

    Returns:
        Self-contained HTML.
    """
    numbers = [c for c in comparison.changes if not math.isnan(c.relative)]
    tiles = [
        Tile(
            one.name,
            [Value(one.before, one.unit), " to ", Value(one.after, one.unit)],
            [_percent(one)],
        )
        for one in numbers
        if one.place[0] in _HEADLINES
    ][:4]
    a, b = comparison.names
    body = [section("Every change", *_listed(comparison.changes, (a, b), "changes"))]
    if comparison.only:
        own = _listed(comparison.only, (a, b), "values only in one")
        body.append(section("Only in one of the two", *own))
    return page(
        Page(
            title=" and ".join(dict.fromkeys(comparison.titles)) + ": two runs",
            verdict=_sentence(comparison),
            good=None if comparison.changes or comparison.only else True,
            tiles=tiles,
            about=f"{a} and {b}.",
            body=body,
            assumed=[
                f"Numbers that differ by less than {SAME:g} of their value are equal.",
                "Certificates, which bound the errors of results, are not compared.",
            ],
            provenance=provenance,
            results=comparison.table(),
        )
    )


def _listed(
    changes: Sequence[Change], names: tuple[str, str], what: str
) -> Iterator[str]:
    """Yield a table of the first changes, and a folded table of the remaining ones."""
    head = ["quantity", *names, "change"]
    yield table(head, [_row(one) for one in changes[:_LISTED]], what)
    more = [_row(one) for one in changes[_LISTED:]]
    if more:
        count = f"{len(more)} more {what}"
        yield piece("folded", count, table(head, more, count))


def _row(change: Change) -> list[Cell]:
    """Return the table row of a change."""
    cells = [
        Value(v, change.unit, 6) if _is_number(v) else "-" if v is None else str(v)
        for v in (change.before, change.after)
    ]
    return [change.name, *cells, _percent(change)]


def _percent(change: Change) -> str:
    """Format the relative change in per cent."""
    relative = change.relative
    return f"{100 * relative:+.3g} %" if math.isfinite(relative) else "-"
