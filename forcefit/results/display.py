"""Short representations of objects: a title and a few figures with their units.

A dataclass uses them with one line in its body::

    __repr__, _repr_html_ = short_repr, html_table

The figures come from the object's method ``_figures``, or are its fields, abbreviated.
The text is for a console, the table for a notebook; both are a few lines long.
"""

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Figures = dict[str, str]

_LONGEST = 72  # largest number of characters of a value
_FEW = 6  # largest number of elements shown; of a longer array only its shape


def short_repr(self: Any) -> str:
    """Return a title and one line for each figure.

    Args:
        self: a dataclass, perhaps with a method ``_figures``.

    Returns:
        Lines of text.
    """
    return listing(title(self), _figures(self))


def show(self: Any, **options: Any) -> Any:
    """Return a picture: interactive in a notebook, a figure of matplotlib elsewhere.

    Args:
        self: what is drawn.
        options: of ``forcefit.show``.

    Returns:
        The picture of ``forcefit.show``.
    """
    import forcefit  # whose public names are imported at their first use

    return forcefit.show(self, **options)


def listing(title: str, lines: Mapping[str, str], notes: Sequence[str] = ()) -> str:
    """Return a title and lines of words and values, aligned, then notes."""
    width = max(map(len, lines), default=0)
    rows = [f"  {words:{width}}  {value}" for words, value in lines.items()]
    return "\n".join([title, *rows, *(f"note: {note}" for note in notes)])


def html_table(self: Any) -> str:
    """Return a title and a table of the figures in HTML, for notebooks.

    Args:
        self: a dataclass, perhaps with a method ``_figures``.

    Returns:
        HTML, in which names from files are escaped.
    """
    rows = "".join(
        f'<tr><th style="text-align:left">{html.escape(name)}</th>'
        f'<td style="text-align:left">{html.escape(value)}</td></tr>'
        for name, value in _figures(self).items()
    )
    caption = f'<caption style="text-align:left">{html.escape(title(self))}</caption>'
    return f"<table>{caption}{rows}</table>"


def title(thing: object) -> str:
    """Return the kind of an object, and its name or its robot's name if it has one."""
    kind = type(thing).__name__
    posture = getattr(thing, "posture", None)
    owner = getattr(thing, "robot", None) or getattr(posture, "robot", None)
    name = getattr(thing, "name", None)
    if isinstance(name, str):
        return f"{kind} {_cut(name)}"
    name = getattr(owner, "name", None)
    return f"{kind} of {_cut(name)}" if isinstance(name, str) else kind


def brief(value: object) -> str:
    """Return a short line for any value; only its kind if the value is too long."""
    if isinstance(value, np.ndarray):
        if 0 < value.size <= _FEW and value.dtype.kind in "fiu":
            return "[" + " ".join(f"{v:.4g}" for v in value.ravel()) + "]"
        return f"{value.dtype} array {value.shape}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if is_dataclass(value) and not isinstance(value, type):
        return title(value)
    if isinstance(value, Mapping | list | tuple | set | frozenset):
        parts = value.values() if isinstance(value, Mapping) else value
        if not value:
            return "none"
        plain = all(isinstance(v, int | float | str) for v in parts)
        if len(value) > _FEW or not plain:
            return f"{type(value).__name__} of {len(value)}"
    return _cut(value if isinstance(value, str) else repr(value))


def numbers(values: Iterable[float]) -> str:
    """Return the numbers in brackets, rounded by :func:`rounded`."""
    return "[" + " ".join(f"{rounded(v):.4g}" for v in values) + "]"


def rounded(value: float) -> float:
    """Return a number for display; below 1e-9, a rounding error, it is zero."""
    return 0.0 if abs(value) < 1e-9 else float(value)


def screw_text(screw: ArrayLike) -> str:
    """Return the text of a platform screw (6,) [rad, m]."""
    s = 1e3 * np.asarray(screw, dtype=float)
    return f"{numbers(s[:3])} mrad, {numbers(s[3:])} mm"


def largest(screws: ArrayLike) -> str:
    """Return the largest rotation and translation of screws (..., 6) [rad, m]."""
    parts = np.asarray(screws, dtype=float).reshape(-1, 2, 3)
    turn, shift = 1e3 * np.linalg.norm(parts, axis=-1).max(axis=0, initial=0.0)
    return f"{turn:.4g} mrad, {shift:.4g} mm" if turn or shift else "none"


def largest_row(sizes: ArrayLike) -> int:
    """Return row of the largest number; of numbers equal within 1e-9, the first.

    Args:
        sizes: (k,) >= 0, k > 0.

    Returns:
        The row, the same on every processor.
    """
    values = np.asarray(sizes, dtype=float)
    return int(np.argmax(values >= (1 - 1e-9) * np.nanmax(values)))


def bracket(bounds: Sequence[float] | NDArray, unit: str) -> str:
    """Return two bounds [rad or m] in thousandths; the unit is mrad or mm."""
    low, high = 1e3 * bounds[0], 1e3 * bounds[1]
    return f"{low:.6g} to {high:.6g} {unit}" if low < float("inf") else "without bound"


def _figures(thing: Any) -> Figures:
    """Return the figures of an object by its own method, or its fields."""
    if hasattr(thing, "_figures"):
        return thing._figures()
    shown = [one.name for one in fields(thing) if one.repr and one.name != "name"]
    return {name: brief(getattr(thing, name)) for name in shown}


def _cut(text: str) -> str:
    """Return a text on one line, abbreviated to the longest line allowed."""
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 4]} ..."
