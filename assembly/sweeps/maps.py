"""Figures of a sweep: maps over two axes, or lines along one axis.

Start with :func:`figure_of`.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.statuses import OK
from forcefit.assembly.sweeps.panels import Panel, named_panels, quantity, usual_panels
from forcefit.inputs.errors import plot_label
from forcefit.inputs.table import BadInput, nearest, quoted
from forcefit.page.picture import show_figures_of_cells

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure_of(
    data: "xarray.Dataset",
    at: Mapping[str, float | str] | None = None,
    quantities: Sequence[str] = (),
) -> "Figure":
    """Plot a sweep as maps over two axes, or as lines along one axis.

    Args:
        data: data set of a sweep.
        at: values of the axes that are not drawn, by name. The nearest points are used.
            Without a value for ``draw``, medians over all draws are drawn.
        quantities: names of quantities, see :mod:`forcefit.assembly.sweeps.panels`; by
            default the quantities in figure 5 of the paper.

    Returns:
        A figure with one panel per quantity, which a notebook displays as the result of
        a cell.

    Raises:
        BadInput: an axis or a quantity is unknown, or more than two axes have no value
            in ``at``.
    """
    if "status" not in data:
        raise BadInput(
            "figure: found no variable status; expected the NetCDF file of a sweep"
        )
    view, note = part_of_sweep(data, at or {})
    axes = {str(d): view.sizes[d] for d in view["status"].dims}
    check_axes(axes)
    panels = named_panels(view, quantities) if quantities else None
    show_figures_of_cells()
    figure = (map_figure if len(axes) == 2 else path_figure)(view, panels)
    if note:
        figure.text(0.995, 0.995, plot_label(note), ha="right", va="top", fontsize=8)
    return figure


def check_axes(sizes: Mapping[str, int]) -> None:
    """Raise an error unless a sweep has one or two axes with several values.

    Args:
        sizes: number of values of each axis.

    Raises:
        BadInput: apart from draws, the number of axes with several values is not 1 or
            2.
    """
    long = {name: n for name, n in sizes.items() if n > 1 and name != "draw"}
    if len(long) > 2:
        named = ", ".join(f"{name} ({n})" for name, n in long.items())
        raise BadInput(
            f"figure: found axes {named}, expected one or two; select a part of "
            "the file with forcefit assembly plot --at AXIS=VALUE"
        )
    if not long:
        raise BadInput(
            "figure: found a single point; expected one or two axes with several points"
        )


def part_of_sweep(
    data: "xarray.Dataset", at: Mapping[str, float | str]
) -> tuple["xarray.Dataset", str]:
    """Select points of a sweep by axis values, and compute medians over draws.

    Args:
        data: data set of a sweep.
        at: values of axes by name.

    Returns:
        The selected data without axes of length one, and a text on the selection.

    Raises:
        BadInput: an axis or a value is unknown.
    """
    axes = [str(d) for d in data["status"].dims]
    note = []
    for name, value in at.items():
        if name not in axes:
            raise BadInput(f"--at: no axis {quoted(name)}{nearest(name, axes)}")
        labels = data[name].values
        if labels.dtype.kind in "fiu":
            place = int(np.abs(labels - _number(name, value)).argmin())
        elif str(value) in (known := [str(v) for v in labels]):
            place = known.index(str(value))
        else:
            raise BadInput(
                f"--at {name}: no {quoted(str(value))}{nearest(str(value), known)}"
            )
        data = data.isel({name: place})
        note.append(f"{name} = {labels[place]}")
    data = _squeezed(data)
    if "draw" in data["status"].dims:
        note.append(f"median of {data.sizes['draw']} draws")
        data = _median(data)
    return data, "; ".join(note)


def _number(name: str, value: float | str) -> float:
    """Convert the value of an axis to a number."""
    try:
        return float(value)
    except ValueError:
        raise BadInput(
            f"--at {name}: found {quoted(str(value))}, expected a number"
        ) from None


def _median(data: "xarray.Dataset") -> "xarray.Dataset":
    """Return medians over the draws, and the first status other than ok."""
    numbers = [k for k, v in data.data_vars.items() if v.dtype.kind == "f"]
    middle = data[numbers].median("draw", skipna=True)
    first = data.isel(draw=0, drop=True)
    status = data["status"].transpose(..., "draw")
    bad = (status != OK).values
    shown = np.take_along_axis(
        status.values, bad.argmax(axis=-1)[..., None], axis=-1
    )[..., 0]  # fmt: skip
    middle["status"] = first["status"].transpose(*status.dims[:-1]).copy(data=shown)
    for text in ("near_singularity", "reason"):
        if text in first:
            middle[text] = first[text]
    return middle


def _squeezed(data: "xarray.Dataset") -> "xarray.Dataset":
    """Return a data set without axes that have a single value."""
    single = [d for d in data["status"].dims if data.sizes[d] == 1]
    return data.squeeze(single, drop=True)


def map_figure(
    data: "xarray.Dataset", panels: Sequence[Panel] | None = None
) -> "Figure":
    """Plot quantities as maps over a two-dimensional grid.

    Args:
        data: data set of a sweep over two axes with several values each.
        panels: panels to draw; by default the panels of figure 5 of the paper and the
            status.

    Returns:
        A figure with one panel per quantity. The contour of margin 1 is the boundary of
        the assembly zone. Crosses mark points near a singularity.

    Raises:
        ValueError: the sweep does not have two axes with several values.
    """
    data = _along_numbers(_squeezed(data))
    names = [str(d) for d in data["status"].dims]
    if len(names) != 2:
        raise ValueError(f"a map requires two axes, this sweep has {len(names)}")
    x, y = names
    shown = panels or usual_panels(data)
    figure, axes = _figure_for(len(shown), 3.7)
    for panel, (key, scale, title, colours) in zip(axes, shown, strict=False):
        values = quantity(data, key).transpose(y, x)
        finite = scale * values.where(np.isfinite(values))
        image = panel.pcolormesh(data[x], data[y], finite, cmap=colours)
        low, high = float(finite.min()), float(finite.max())
        if low < high:
            figure.colorbar(image, ax=panel)
        elif low == high:  # a colour scale would show only round-off errors
            title = f"{title}: {low:.4g} everywhere"
        inside = bool((finite < 1).any()) and bool((finite > 1).any())
        if key.startswith("margin") and inside and min(finite.shape) > 1:
            panel.contour(data[x], data[y], finite, levels=[1.0], colors="cyan")
        _mark(panel, data, x, y)
        _label(panel, data, x, y, title)
    if len(shown) < len(axes):
        _states(axes[-1], data, x, y)
    figure.suptitle(_caption(data), fontsize=10)
    return figure


def _figure_for(count: int, height: float) -> tuple["Figure", "list[Axes]"]:
    """Create a figure with at least the given number of panels."""
    from matplotlib.figure import Figure

    rows, columns = -(-count // 2), min(count, 2)
    size = (5.5 * columns, height * rows) if columns > 1 else (7.0, 1.5 * height)
    figure = Figure(figsize=size, layout="constrained")
    return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def path_figure(
    data: "xarray.Dataset", panels: Sequence[Panel] | None = None
) -> "Figure":
    """Plot quantities as lines along one axis.

    Args:
        data: data set of a sweep over one axis.
        panels: panels to draw; by default the panels of figure 5 of the paper and the
            condition number.

    Returns:
        A figure with one panel per quantity. Crosses mark points near a singularity.
    """
    data = _along_numbers(_squeezed(data))
    (x,) = (str(d) for d in data["status"].dims)
    along = data[x].values
    near = _near(data)
    shown = panels or usual_panels(data)
    figure, axes = _figure_for(len(shown), 3.0)
    for panel, (key, scale, title, _) in zip(axes, shown, strict=False):
        values = quantity(data, key).values
        values = scale * np.where(np.isfinite(values), values, np.nan)
        panel.plot(along, values, ".-", color="tab:blue")
        panel.plot(along[near], values[near], "kx", label="near a singularity")
        if key.startswith("margin"):
            panel.axhline(1.0, color="tab:cyan", linewidth=1)
        panel.set(title=title, xlabel=_axis_name(data, x))
        panel.grid(alpha=0.3)
    if panels is not None:
        for panel in axes[len(shown) :]:
            panel.set_axis_off()
    elif len(shown) < len(axes):
        axes[-1].semilogy(along, data["condition"].values, ".-")
        axes[-1].set(
            title="condition, drives to platform [-]", xlabel=_axis_name(data, x)
        )
    figure.suptitle(_caption(data), fontsize=10)
    return figure


def _along_numbers(data: "xarray.Dataset") -> "xarray.Dataset":
    """Sort a data set by axis values, after replacing text labels by 1, 2, .."""
    for name in map(str, data["status"].dims):
        if data[name].dtype.kind not in "fiu":
            data = data.assign_coords({name: np.arange(data.sizes[name]) + 1})
        data = data.sortby(name)
    return data


def _near(data: "xarray.Dataset") -> NDArray:
    """Return which points are near a singularity, as a bool array."""
    if "near_singularity" not in data:
        return np.zeros(data["status"].shape, dtype=bool)
    texts = data["near_singularity"].transpose(*data["status"].dims)
    return texts.values.astype(str) != ""


def _mark(panel: "Axes", data: "xarray.Dataset", x: str, y: str) -> None:
    """Draw crosses at points near a singularity."""
    i, j = np.nonzero(_near(data))
    if len(i):
        x_first = data["status"].dims[0] == x
        xs, ys = (i, j) if x_first else (j, i)
        panel.plot(data[x].values[xs], data[y].values[ys], "kx", markersize=3)


def _states(panel: "Axes", data: "xarray.Dataset", x: str, y: str) -> None:
    """Draw the status of the points in colour."""
    texts = data["status"].transpose(y, x).values.astype(str)
    _, codes = np.unique(texts, return_inverse=True)
    codes = codes.reshape(texts.shape)
    panel.pcolormesh(data[x], data[y], codes, cmap="Set2", vmin=0, vmax=7)
    _label(panel, data, x, y, _counts(data))
    _mark(panel, data, x, y)


def _label(panel: "Axes", data: "xarray.Dataset", x: str, y: str, title: str) -> None:
    """Set title and axis labels, and equal scales for axes of the same unit."""
    same = data[x].attrs.get("units") == data[y].attrs.get("units")
    spans = [float(np.ptp(data[k].values)) for k in (x, y)]
    fits = same and 0.2 < spans[0] / spans[1] < 5
    panel.set(title=title, xlabel=_axis_name(data, x), ylabel=_axis_name(data, y),
              aspect="equal" if fits else "auto")  # fmt: skip


def _axis_name(data: "xarray.Dataset", name: str) -> str:
    """Return the name and the unit of an axis."""
    unit = data[name].attrs.get("units")
    return plot_label(f"{name} [{unit}]" if unit else name)


def _counts(data: "xarray.Dataset") -> str:
    """Format the number of points of each status as text."""
    names, counts = np.unique(data["status"].values.astype(str), return_counts=True)
    return ", ".join(f"{n}: {c}" for n, c in zip(names, counts, strict=True))


def _caption(data: "xarray.Dataset") -> str:
    """Return a caption with robot, statuses and nearby singularities."""
    caption = f"{data.attrs.get('robot', '')}; {_counts(data)}"
    if _near(data).any():
        texts = np.unique(data["near_singularity"].values.astype(str))
        kinds = sorted({
            part.partition(",")[0] for t in texts if t for part in t.split("; ")
        })  # fmt: skip
        more = f" and {len(kinds) - 6} more" if len(kinds) > 6 else ""
        caption += f"\nx: nearby singularities ({'; '.join(kinds[:6])}{more})"
    return plot_label(caption)
