"""Charts and maps, drawn by plotly.js from data in SI units.

A chart consists of plotly traces.  Each axis defines an SI unit and a display unit.  A
map shows several quantities over one or two axes; clicking a point shows all of its
values. A scene shows a robot; see :mod:`forcefit.assembly.report.scene`.
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

BLUE, RED, GREY = "#1f6fb4", "#c0392b", "#858e97"
# colours of lines and bars; grey denotes the sum of all remaining items
COLOURS = (
    BLUE, RED, "#2e8b57", "#8e5ea2", "#d98b1f", "#179cb0", "#a3541c", "#d2679f",
    "#7d8f14", "#5b63d3", "#e2703a", "#0f7a6c",
)  # fmt: skip


@dataclass(frozen=True)
class Axis:
    """Axis of a chart.

    Attributes:
        title: description of the quantity.
        unit: SI unit; empty for a dimensionless quantity.
        options: options of the plotly axis, for example ``{"type": "log"}``.
    """

    title: str
    unit: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Layer:
    """Quantity shown in a map.

    Attributes:
        key: name of the quantity in the results.
        title: description of the quantity.
        unit: SI unit.
        values: array (nx, ny), or (nx,) over one axis; NaN where there is no value.
    """

    key: str
    title: str
    unit: str
    values: NDArray


def label(name: str) -> str:
    """Escape HTML tags in a name for plotly.js."""
    return html.escape(name, quote=False)


def chart(
    traces: Sequence[Mapping[str, Any]], x: Axis, y: Axis, caption: str,
    bars: str = "overlay",
) -> str:  # fmt: skip
    """Return a chart of plotly traces with data in SI units.

    Args:
        traces: plotly traces; ``x``, ``y`` and ``error_*.array`` are in SI units.
        x: horizontal axis.
        y: vertical axis.
        caption: text below the chart.
        bars: arrangement of bars at the same position: ``"overlay"`` or ``"stack"``.

    Returns:
        HTML of the chart, which is drawn when the page is opened.
    """
    axes = {"x": _axis(x, [t["x"] for t in traces]),
            "y": _axis(y, [t["y"] for t in traces])}  # fmt: skip
    lying = any(t["type"] == "bar" and t.get("orientation") == "h" for t in traces)
    rows = max((len(t["y"]) for t in traces), default=0) if lying else 0
    height = 110 + 26 * rows if lying else 340
    spec = {"traces": traces, "axes": axes, "height": height, "barmode": bars}
    return _figure(spec, "chart", caption)


def bars(
    values: Mapping[str, float], x: Axis, caption: str, line: float = 1.0,
    rest: str = "",
) -> str:  # fmt: skip
    """Return a horizontal bar chart with the first bar at the top.

    Args:
        values: lengths of the bars [SI units], by name.
        x: horizontal axis.
        caption: text below the chart.
        line: coordinate [SI units] of a line across all bars, or NaN for no line.
        rest: name of the bar, drawn in grey, that shows the sum of all remaining items.

    Returns:
        HTML of the chart.
    """
    trace: dict[str, Any] = {
        "type": "bar", "orientation": "h", "x": list(values.values()),
        "y": [label(name) for name in values],
        "marker": {"color": [GREY if name == rest else BLUE for name in values]},
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
    values: ArrayLike, names: Sequence[str], title: str, caption: str, around: bool,
    most: float = 1.0,
) -> str:  # fmt: skip
    """Return a heat map of a square matrix, with the numbers printed in the cells.

    Args:
        values: matrix (n, n).
        names: names of the rows and columns.
        title: title of the colour scale.
        caption: text below the chart.
        around: whether the colour scale is centred at zero; otherwise it ranges from 0
            to ``most``.
        most: upper end of the colour scale.

    Returns:
        HTML of the chart.
    """
    size = float(np.abs(values).max()) or 1.0
    trace: dict[str, Any] = {
        "type": "heatmap", "z": np.asarray(values), "x": [label(n) for n in names],
        "y": [label(n) for n in names], "texttemplate": "%{z:.2f}",
        "colorscale": "RdBu" if around else "Blues", "reversescale": True,
        "zmin": -size if around else 0, "zmax": size if around else most,
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
    """Return a map of quantities over a grid; clicking a point shows all its values.

    Args:
        axes: one or two axes, with their values in SI units.
        layers: quantities to map; a constant quantity is stated in a sentence instead.
        states: state of each point, as text.
        caption: text below the map.

    Returns:
        HTML of the map.
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
    return _figure(spec, "map", caption + " Click a point for its numbers.") + note


def scene(spec: Mapping[str, Any], caption: str) -> str:
    """Return a robot that the reader can rotate, zoom and assemble.

    Args:
        spec: plain values in SI units, in the format that ``page.js`` reads.
        caption: text below the robot.

    Returns:
        HTML of the scene.
    """
    return _figure(spec, "scene", caption)


def grid(*charts: str) -> str:
    """Arrange charts side by side."""
    return piece("grid", charts)


def _constant(layer: Layer) -> float | None:
    """Return the value of a constant layer, NaN if it is empty, None if it varies."""
    values = np.asarray(layer.values, dtype=float)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return float("nan")
    # a smaller variation is attributed to rounding errors
    same = np.ptp(finite) <= 1e-9 * np.abs(finite).max()
    return float(finite[0]) if same else None


def _unit(unit: str, values: ArrayLike) -> dict[str, Any]:
    """Return the display unit for data in an SI unit, and the conversion factor."""
    array = np.asarray(values, dtype=float) if unit else np.zeros(0)
    finite = array[np.isfinite(array)]
    shown = shown_in(unit, float(np.abs(finite).max()) if len(finite) else 0.0)
    return asdict(shown)


def _axis(axis: Axis, data: Sequence[ArrayLike]) -> dict[str, Any]:
    """Return an axis for ``page.js``, with a suitable display unit for the data."""
    arrays = [np.ravel(np.asarray(d, dtype=float)) for d in data if axis.unit]
    values = np.concatenate(arrays) if arrays else np.zeros(0)
    return _unit(axis.unit, values) | {
        "title": label(axis.title), "options": dict(axis.options),
    }  # fmt: skip


def _figure(spec: Mapping[str, Any], kind: str, caption: str) -> str:
    """Return the HTML of a figure that is drawn by ``page.js``."""
    return piece("figure", kind, plain(spec), caption)
