"""Charts and maps of a page: data in SI, drawn by plotly.js with values under a click.

A chart is a list of plotly traces; every axis has its SI unit and the one shown.  A map
holds several quantities over one or two axes and all numbers of each point; a scene is
a robot, :mod:`assembly.report.scene`.
"""

import html
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcefit.inputs.writing import plain
from forcefit.page.markup import piece
from forcefit.page.tables import Value
from forcefit.results.units import shown_in

BLUE, RED, GREY = "#1f6fb4", "#c0392b", "#9aa3ab"


@dataclass(frozen=True)
class Axis:
    """An axis of a chart.

    Attributes:
        title: in words.
        unit: SI, empty for a pure number.
        options: of plotly's axis, such as ``{"type": "log"}``.
    """

    title: str
    unit: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Layer:
    """One quantity of a map.

    Attributes:
        key: its name in the results.
        title: in words.
        unit: SI.
        values: (nx, ny), or (nx,) over one axis; not finite where there is none.
    """

    key: str
    title: str
    unit: str
    values: NDArray


def label(name: str) -> str:
    """A name as plotly.js is to write it: not as tags."""
    return html.escape(name, quote=False)


def chart(
    traces: Sequence[Mapping[str, Any]], x: Axis, y: Axis, caption: str,
    bars: str = "overlay",
) -> str:  # fmt: skip
    """A chart of plotly traces, their data in SI.

    Args:
        traces: of plotly.js; ``x``, ``y`` and ``error_*.array`` in SI.
        x: the horizontal axis.
        y: the vertical axis.
        caption: below it.
        bars: that share a place: ``"overlay"`` or ``"stack"``.

    Returns:
        HTML, drawn when the page is opened.
    """
    axes = {"x": _axis(x, [t["x"] for t in traces]),
            "y": _axis(y, [t["y"] for t in traces])}  # fmt: skip
    lying = any(t["type"] == "bar" and t.get("orientation") == "h" for t in traces)
    rows = max((len(t["y"]) for t in traces), default=0) if lying else 0
    height = 110 + 26 * rows if lying else 340
    spec = {"traces": traces, "axes": axes, "height": height, "barmode": bars}
    return _figure(spec, "chart", caption)


def bars(values: Mapping[str, float], x: Axis, caption: str, line: float = 1.0) -> str:
    """Horizontal bars, the first on top, their numbers beside them.

    Args:
        values: [SI] by name.
        x: what they are.
        caption: below them.
        line: [SI] where a line is drawn across; NaN for none.

    Returns:
        HTML.
    """
    trace: dict[str, Any] = {
        "type": "bar", "orientation": "h", "x": list(values.values()),
        "y": [label(name) for name in values], "marker": {"color": BLUE},
    }  # fmt: skip
    traces = [trace]
    if np.isfinite(line):
        names = trace["y"]
        traces.append({
            "type": "scatter", "mode": "lines", "x": [line] * len(names), "y": names,
            "line": {"color": GREY}, "hoverinfo": "skip", "showlegend": False,
        })  # fmt: skip
    y = Axis("", options={"autorange": "reversed", "type": "category"})
    return chart(traces, x, y, caption)


def matrix(
    values: ArrayLike, names: Sequence[str], title: str, caption: str, around: bool
) -> str:
    """A square matrix as colours, its numbers written in them.

    Args:
        values: (n, n).
        names: of rows and columns.
        title: of the colours.
        caption: below it.
        around: colours around zero; otherwise from 0 to 1.

    Returns:
        HTML.
    """
    size = float(np.abs(values).max()) or 1.0
    trace: dict[str, Any] = {
        "type": "heatmap", "z": np.asarray(values), "x": [label(n) for n in names],
        "y": [label(n) for n in names], "texttemplate": "%{z:.2f}",
        "colorscale": "RdBu" if around else "Blues", "reversescale": True,
        "zmin": -size if around else 0, "zmax": size if around else 1,
        "colorbar": {"title": {"text": title, "side": "right"}},
    }  # fmt: skip
    if not around:
        trace["reversescale"] = False
    y = Axis("", options={"autorange": "reversed"})
    spec = {"traces": [trace], "height": max(320, 90 + 26 * len(names))}
    axes = {"x": _axis(Axis(""), []), "y": _axis(y, [])}
    return _figure(spec | {"axes": axes}, "chart", caption)


def value_map(
    axes: Sequence[tuple[Axis, NDArray]], layers: Sequence[Layer], states: NDArray,
    caption: str,
) -> str:  # fmt: skip
    """Quantities over a grid: one is chosen, all are opened by a click on a point.

    Args:
        axes: one or two, with their values in SI.
        layers: the quantities; those with one value everywhere are stated in words.
        states: of every point, in words.
        caption: below it.

    Returns:
        HTML.
    """
    flat = {one.key: _constant(one) for one in layers}
    drawn = [one for one in layers if flat[one.key] is None]
    same = [
        (one.title, Value(value, one.unit))
        for one in layers
        if (value := flat[one.key]) is not None and np.isfinite(value)
    ]
    spec = {
        "axes": {
            name: _axis(axis, [values]) | {"values": values}
            for name, (axis, values) in zip("xy", axes, strict=False)
        },
        "layers": [
            _unit(one.unit, one.values)
            | {"key": one.key, "title": one.title, "values": one.values,
               "drawn": one in drawn}
            for one in layers
        ],
        "states": states,
    }  # fmt: skip
    note = piece("constants", same) if same else ""
    if not drawn:
        return note
    return _figure(spec, "map", caption + " A click opens a point's numbers.") + note


def scene(spec: Mapping[str, Any], caption: str) -> str:
    """A robot that the reader turns, exaggerates and closes.

    Args:
        spec: plain values as ``page.js`` reads them, SI.
        caption: below it.

    Returns:
        HTML.
    """
    return _figure(spec, "scene", caption)


def grid(*charts: str) -> str:
    """Charts side by side."""
    return piece("grid", charts)


def _constant(layer: Layer) -> float | None:
    """The one value of a layer that does not vary; NaN if it has none."""
    values = np.asarray(layer.values, dtype=float)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return float("nan")
    # less than this is rounding, and would be drawn as a pattern
    same = np.ptp(finite) <= 1e-9 * np.abs(finite).max()
    return float(finite[0]) if same else None


def _unit(unit: str, values: ArrayLike) -> dict[str, Any]:
    """The unit shown for data of an SI unit, and its factor."""
    array = np.asarray(values, dtype=float) if unit else np.zeros(0)
    finite = array[np.isfinite(array)]
    shown = shown_in(unit, float(np.abs(finite).max()) if len(finite) else 0.0)
    return asdict(shown)


def _axis(axis: Axis, data: Sequence[ArrayLike]) -> dict[str, Any]:
    """An axis as ``page.js`` reads it; its unit suits all that is drawn along it."""
    arrays = [np.ravel(np.asarray(d, dtype=float)) for d in data if axis.unit]
    values = np.concatenate(arrays) if arrays else np.zeros(0)
    return _unit(axis.unit, values) | {
        "title": label(axis.title), "options": dict(axis.options),
    }  # fmt: skip


def _figure(spec: Mapping[str, Any], kind: str, caption: str) -> str:
    """A figure that ``page.js`` fills."""
    return piece("figure", kind, plain(spec), caption)
