"""Short representations of objects: a title and a few values with their units.

To use them, a dataclass contains the line::

    __repr__, _repr_html_ = short_repr, html_table

The values are taken from the method ``_figures`` of the object or, without such a
method, from its abbreviated fields.  Consoles show the text, and notebooks show the
HTML table.
"""

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Figures = dict[str, str]

_LONGEST = 72  # [characters] maximum length of the text of a value
# Largest number of array elements that are shown. For a longer array, the shape is
# shown.
_FEW = 6


def short_repr(self: Any) -> str:
    """Return a title followed by one line per value.

    Args:
        self: dataclass instance, with an optional method ``_figures``.

    Returns:
        Text of several lines.
    """
    return listing(title(self), _figures(self))


def show(self: Any, **options: Any) -> Any:
    """Draw an object: interactively in a notebook, otherwise as a matplotlib figure.

    Args:
        self: object to draw.
        options: options of ``forcefit.show``.

    Returns:
        Result of ``forcefit.show``.
    """
    import forcefit  # public names are imported on first use

    return forcefit.show(self, **options)


def listing(title: str, lines: Mapping[str, str], notes: Sequence[str] = ()) -> str:
    """Format a title, aligned names and values, and notes as text."""
    width = max(map(len, lines), default=0)
    rows = [f"  {words:{width}}  {value}" for words, value in lines.items()]
    return "\n".join([title, *rows, *(f"note: {note}" for note in notes)])


def html_table(self: Any) -> str:
    """Return an HTML table with a title and one row per value, for notebooks.

    Args:
        self: dataclass instance, with an optional method ``_figures``.

    Returns:
        HTML in which special characters are escaped.
    """
    rows = "".join(
        f'<tr><th style="text-align:left">{html.escape(name)}</th>'
        f'<td style="text-align:left">{html.escape(value)}</td></tr>'
        for name, value in _figures(self).items()
    )
    caption = f'<caption style="text-align:left">{html.escape(title(self))}</caption>'
    return f"<table>{caption}{rows}</table>"


def title(thing: object) -> str:
    """Return the type of an object with its name or the name of its robot."""
    kind = type(thing).__name__
    posture = getattr(thing, "posture", None)
    owner = getattr(thing, "robot", None) or getattr(posture, "robot", None)
    name = getattr(thing, "name", None)
    if isinstance(name, str):
        return f"{kind} {_cut(name)}"
    name = getattr(owner, "name", None)
    return f"{kind} of {_cut(name)}" if isinstance(name, str) else kind


def brief(value: object) -> str:
    """Format a value briefly, or return only its type and size if it is too long."""
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
    """Format numbers in brackets, after applying :func:`rounded`."""
    return "[" + " ".join(f"{rounded(v):.4g}" for v in values) + "]"


def rounded(value: float) -> float:
    """Replace a number by 0 for display if its magnitude is below 1e-9."""
    return 0.0 if abs(value) < 1e-9 else float(value)


def pose_text(pose: Mapping[str, float]) -> str:
    """Format a pose as text, with rotations first as in a screw.

    Args:
        pose: some or all of the components ``rx .. tz`` [rad, m].

    Returns:
        Text such as ``[0 0 0] rad, [0.1 0 -0.5] m``.
    """
    halves = {"rad": "r", "m": "t"}
    parts = {unit: [v for k, v in pose.items() if k[0] == kind]
             for unit, kind in halves.items()}  # fmt: skip
    return ", ".join(f"{numbers(v)} {unit}" for unit, v in parts.items() if v)


def screw_text(screw: ArrayLike) -> str:
    """Format a platform screw (6,) [rad, m] as text."""
    s = 1e3 * np.asarray(screw, dtype=float)
    return f"{numbers(s[:3])} mrad, {numbers(s[3:])} mm"


def largest(screws: ArrayLike) -> str:
    """Format the largest rotation and largest translation among screws (..., 6)."""
    parts = np.asarray(screws, dtype=float).reshape(-1, 2, 3)
    turn, shift = 1e3 * np.linalg.norm(parts, axis=-1).max(axis=0, initial=0.0)
    return f"{turn:.4g} mrad, {shift:.4g} mm" if turn or shift else "none"


def largest_row(sizes: ArrayLike) -> int:
    """Return the index of the largest number.

    Among numbers that agree within a relative tolerance of 1e-9, the first number is
    chosen. The result therefore does not depend on round-off errors.

    Args:
        sizes: nonnegative numbers (k,), with k > 0.

    Returns:
        Index of the number.
    """
    values = np.asarray(sizes, dtype=float)
    return int(np.argmax(values >= (1 - 1e-9) * np.nanmax(values)))


def bracket(bounds: Sequence[float] | NDArray, unit: str) -> str:
    """Format a lower and an upper bound [rad or m] as text in mrad or mm."""
    low, high = 1e3 * bounds[0], 1e3 * bounds[1]
    return f"{low:.6g} to {high:.6g} {unit}" if low < float("inf") else "without bound"


def _figures(thing: Any) -> Figures:
    """Return the displayed values of an object, from ``_figures`` or its fields."""
    if hasattr(thing, "_figures"):
        return thing._figures()
    shown = [one.name for one in fields(thing) if one.repr and one.name != "name"]
    return {name: brief(getattr(thing, name)) for name in shown}


def _cut(text: str) -> str:
    """Put a text on one line and shorten it to the maximum length."""
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 4]} ..."
