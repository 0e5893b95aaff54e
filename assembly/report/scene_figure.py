"""Drawing of a 3D scene as a matplotlib figure."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import plot_label
from forcefit.page.charts import BLUE, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LIGHT, _ORANGE, _DARK, _GOLD = "#c3c9cf", "#d68910", "#5b6773", "#e0a800"
_ELEVATION, _AZIMUTH = 22.0, -62.0  # [deg] direction of view


def scene_figure(spec: Mapping[str, Any], title: str) -> "Figure":
    """Draw a robot in its nominal state or in both states.

    Args:
        spec: data from :mod:`forcefit.assembly.report.scene`, in SI units.
        title: title above the axes.

    Returns:
        A pyplot figure.
    """
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=(7.5, 6.5), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    axes.view_init(_ELEVATION, _AZIMUTH)
    scale, unit = spec["length"]["factor"], spec["length"]["shown"]
    factor, nominal = spec["exaggeration"], "nominal" in spec
    long = [body for body in spec["bodies"] if body["long"]]
    if not nominal:
        lines = [scale * body["nominal"] for body in long]
        _draw(axes, lines, "nominal", _LIGHT, 2)
    word = "nominal" if nominal else "forced"
    for kind, color in (("elastic", RED), ("rigid", BLUE)):
        lines = [_moved(b, factor, scale) for b in long if b["kind"] == kind]
        _draw(axes, lines, f"{word}, {kind}", color, 3)
    ends = np.array([_moved(b, factor, scale)[-1] for b in spec["bodies"]])
    drives = [b["actuated"] for b in spec["bodies"]]
    passive = [b["joint"] != "fixed" and not b["actuated"] for b in spec["bodies"]]
    for points, name, color in (
        (ends[drives], "drives", _ORANGE),
        (ends[passive], "passive joints", _DARK),
    ):
        if len(points):
            axes.scatter(*points.T, s=16, label=name, color=color, depthshade=False)
    if spec["body"] is not None:
        _draw_errors(axes, spec["body"], factor, scale)
    box = scale * np.asarray(spec["box"])
    axes.set(xlim=box[0], ylim=box[1], zlim=box[2])
    axes.set_box_aspect(np.ptp(box, axis=1))
    axes.set(xlabel=f"x [{unit}]", ylabel=f"y [{unit}]", zlabel=f"z [{unit}]")
    times = "" if nominal else f", displacements x {factor:g}"
    axes.set_title(plot_label(f"{title}{times}"))
    axes.legend(fontsize="small", loc="upper left")
    return figure


def _moved(body: Mapping[str, Any], factor: float, scale: float) -> NDArray:
    """Return points along a displaced body in the displayed unit, (k, 3)."""
    return np.asarray(scale * (body["nominal"] + factor * body["moved"]))


def _draw(
    axes: Any, lines: Sequence[NDArray], name: str, color: str, width: float
) -> None:
    """Draw lines with one entry in the legend."""
    gap = np.full((1, 3), np.nan)
    if lines:
        points = np.concatenate([part for line in lines for part in (line, gap)])
        axes.plot(*points.T, label=name, color=color, linewidth=width)


def _draw_errors(
    axes: Any, body: Mapping[str, Any], factor: float, scale: float
) -> None:
    """Draw the set of possible errors at the origin of the platform."""
    points = scale * (body["origin"] + factor * body["points"])
    look = {"color": _GOLD, "label": plot_label(body["text"])}
    if len(body["faces"]):
        axes.plot_trisurf(*points.T, triangles=body["faces"], alpha=0.5, **look)
    else:
        axes.scatter(*points.T, s=4, **look)
