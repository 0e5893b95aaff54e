"""Figures of random draws, importance of errors and tolerances."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from forcefit.assembly.statistics.clearance_positions import clearance_means
from forcefit.assembly.statistics.estimates import most_probable, quantile
from forcefit.assembly.statistics.quantities import POSE_ERRORS
from forcefit.assembly.sweeps.panels import named_panels, quantity
from forcefit.inputs.errors import BadInput, plot_label
from forcefit.results.quantities import QUANTITIES
from forcefit.results.units import FACTORS

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

KINDS = ("histogram", "tornado", "allocation")
_MARGINS = ("margin", "margin_free")
_SHOWN = {
    name: QUANTITIES[name]
    for name in (
        "rotation", "translation", "energy", "margin", "margin_free", "force", "moment",
        "stress",
    )
}  # fmt: skip
NAMES = {name: one.words for name, one in _SHOWN.items()}


def figure_of_draws(
    data: "xarray.Dataset", kind: str | None, quantities: Sequence[str] = ()
) -> "Figure | None":
    """Plot a data set of random draws or tolerances.

    Args:
        data: data set written by the commands ``statistics`` or ``tolerances``, or
            another data set.
        kind: ``"histogram"``, ``"tornado"`` or ``"allocation"``; None to select it by
            the variables in the data set.
        quantities: quantities of a histogram, such as ``["energy"]``; for the names see
            :mod:`forcefit.assembly.sweeps.panels`.

    Returns:
        The figure, or None for another data set.

    Raises:
        ValueError: the data set does not contain the variables for this kind of figure.
        BadInput: a quantity is unknown, or quantities are given for another kind of
            figure.
    """
    if kind is None:
        own = {"tolerance": "allocation", "sources_and_posture_sha256": "histogram"}
        kinds = [name for key, name in own.items() if key in (*data, *data.attrs)]
        kind = kinds[0] if kinds else None
    if kind is None:
        return None
    if kind == "histogram":
        return histogram_figure(data, quantities)
    if quantities:
        raise BadInput(
            f"--quantities: found together with {kind}; expected a histogram"
        )
    return tornado_figure(data) if kind == "tornado" else allocation_figure(data)


def histogram_figure(
    data: "xarray.Dataset", quantities: Sequence[str] = ()
) -> "Figure":
    """Plot histograms with medians, 95 % quantiles and most probable values.

    Args:
        data: result of :func:`forcefit.assembly.statistics.monte_carlo.run_draws`.
        quantities: names of quantities, see :mod:`forcefit.assembly.sweeps.panels`; by
            default the limited quantities.

    Returns:
        A figure with one panel per quantity. Bands are 95 % confidence intervals.

    Raises:
        ValueError: the data set contains no draws.
        BadInput: a quantity is unknown.
    """
    from matplotlib.figure import Figure

    if "draw" not in data.dims or "energy" not in data:
        raise ValueError("a histogram requires a data set of random draws")
    solved = data.isel(draw=np.flatnonzero(data["status"].values == 0))
    shown = [panel[:3] for panel in named_panels(data, quantities)] or [
        (name, FACTORS.get(unit, 1.0), f"{NAMES[name]} [{unit}]")
        for name, unit in ((n, one.display_unit) for n, one in _SHOWN.items())
        if name in solved and solved[name].size
    ]
    figure = Figure(figsize=(12, 3.2 * -(-len(shown) // 2)), layout="constrained")
    panels = figure.subplots(-(-len(shown) // 2), 2, squeeze=False).ravel()
    for panel, (name, scale, text) in zip(panels, shown, strict=False):
        _histogram(panel, text, scale * quantity(solved, name).values)
        if name in POSE_ERRORS:
            panel.set_title(f"clearance {data.attrs['clearance']}", fontsize=9)
        if name in _MARGINS:
            half = quantile(np.nan_to_num(data[name].values, nan=np.inf), 0.5)["value"]
            title = f"median of all {data.sizes['draw']} draws: {half:.3g}"
            panel.set_title(title, fontsize=9)
    for panel in panels[len(shown) :]:
        panel.set_axis_off()
    figure.suptitle(
        f"{plot_label(str(data.attrs.get('robot', '')))}: "
        f"of the {solved.sizes['draw']} of {data.sizes['draw']} draws that assemble, "
        f"seed {data.attrs.get('seed', '')}"
        f"\npose errors: clearance {data.attrs['clearance']}: "
        f"{clearance_means(data.attrs['clearance'], data.attrs.get('contact_length'))}"
    )
    return figure


def _histogram(panel: Any, text: str, values: Any) -> None:
    """Draw the histogram of a quantity, or of its maximum over all links."""
    x = values.max(axis=1) if values.ndim == 2 else values
    x = x[np.isfinite(x)]
    panel.set(xlabel=text, ylabel="draws")
    if len(x) < 2 or np.ptp(x) == 0:
        panel.text(0.5, 0.5, "does not vary", transform=panel.transAxes, ha="center")
        return
    panel.hist(x, bins=60, color="lightsteelblue")
    for label, colour, estimate in (
        ("median", "navy", quantile(x, 0.5)),
        ("95 %", "firebrick", quantile(x, 0.95)),
        ("most probable", "darkgreen", most_probable(x, positive=bool((x >= 0).all()))),
    ):
        panel.axvline(
            estimate["value"], color=colour, label=f"{label} {estimate['value']:.3g}"
        )
        if np.isfinite([estimate["lower"], estimate["upper"]]).all():
            panel.axvspan(
                estimate["lower"], estimate["upper"], color=colour, alpha=0.25
            )
    # The default position "best" takes seconds to compute for many bars.
    panel.legend(fontsize=8, loc="upper right")


def tornado_figure(data: "xarray.Dataset", most: int = 15) -> "Figure":
    """Plot the importance of errors as a tornado chart.

    Args:
        data: data set with ``first_index`` and ``total_index``.
        most: largest number of bars per panel.

    Returns:
        A figure with one panel per quantity. Total indices are light, first-order
        indices are dark.

    Raises:
        ValueError: the data set does not contain the importance of errors.
    """
    from matplotlib.figure import Figure

    if "total_index" not in data:
        raise ValueError(
            "a tornado chart requires a data set with the importance of errors"
        )
    some = data.isel(quantity=np.isfinite(data["total_index"].values).any(axis=(1, 2)))
    names = [str(n) for n in some["quantity"].values]
    rows = max(1, -(-len(names) // 2))
    bars = min(most, some.sizes["group"])
    figure = Figure(figsize=(12, rows * (1 + 0.28 * bars)), layout="constrained")
    panels = figure.subplots(rows, 2, squeeze=False).ravel()
    for panel, name in zip(panels, names, strict=False):
        one = some.sel(quantity=name)
        order = np.argsort(one["total_index"].sel(estimate="value").values)[-bars:]
        for key, colour, width in (
            ("total_index", "lightsteelblue", 0.8), ("first_index", "navy", 0.4)
        ):  # fmt: skip
            value, lower, upper = one[key].values[order].T
            off = np.maximum(0.0, [value - lower, upper - value])
            panel.barh(np.arange(bars), value, width, xerr=off, color=colour,
                       error_kw={"lw": 0.8, "ecolor": "black"},
                       label=key.replace("_index", ""))  # fmt: skip
        groups = [plot_label(str(name)) for name in one["group"].values[order]]
        panel.set_yticks(np.arange(bars), groups, fontsize=8)
        panel.set(xlabel=f"share of the variance: {NAMES[name]}")
        if name in POSE_ERRORS:
            panel.set_title(
                f"clearance {data.attrs['importance_clearance_model']}", fontsize=9
            )
        panel.legend(fontsize=8, loc="lower right")
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    return figure


def allocation_figure(data: "xarray.Dataset") -> "Figure":
    """Plot tolerances and their upper bounds as a bar chart.

    Args:
        data: data of
            :func:`forcefit.assembly.statistics.allocated_tolerances.tolerance_dataset`.

    Returns:
        A figure with a panel for angles and one for lengths. Wide bars are minimum-cost
        tolerances. Narrow bars are uniformly scaled tolerances, if they differ.

    Raises:
        ValueError: the data set contains no tolerances.
    """
    from matplotlib.figure import Figure

    if "tolerance" not in data:
        raise ValueError("a chart of tolerances requires a data set of tolerances")
    figure = Figure(
        figsize=(11, 2.2 + 0.35 * data.sizes["class"]), layout="constrained"
    )
    panels = figure.subplots(1, 2)
    units = data["unit"].values.astype(str)
    for panel, unit, scale, shown in (
        (panels[0], "rad", 1e3, "mrad"), (panels[1], "m", 1e3, "mm")
    ):  # fmt: skip
        rows = np.flatnonzero(units == unit)
        value = scale * data["tolerance"].values[rows]
        most = scale * data["loosest_allowed"].values[rows]
        panel.barh(np.arange(len(rows)), value, color="steelblue", label="least cost")
        uniformly_scaled = scale * data["scaled_alike"].values[rows]
        if not np.allclose(uniformly_scaled, value, rtol=1e-6):
            panel.barh(
                np.arange(len(rows)) + 0.3,
                uniformly_scaled,
                0.15,
                color="darkorange",
                label="uniformly scaled",
            )
        panel.plot(most, np.arange(len(rows)), "k|", ms=14, label="largest allowed")
        classes = [plot_label(str(name)) for name in data["class"].values[rows]]
        panel.set_yticks(np.arange(len(rows)), classes, fontsize=8)
        panel.set(xlabel=f"tolerance, plus or minus [{shown}]", xscale="log")
        if len(rows):
            panel.set_xlim(value.min() / 3, 2 * most.max())
            panel.legend(fontsize=8)
        for i, one in enumerate(value):
            panel.annotate(f" {one:.3g}", (one, i), va="center", fontsize=8)
        if not len(rows):
            panel.set_axis_off()
    title = plot_label(str(data.attrs.get("said", ""))).replace("; ", "\n")
    figure.suptitle(title, fontsize=9)
    return figure
