"""Charts of the compliance shares of the parts."""

from collections.abc import Mapping
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from forcefit.assembly.report.platform_stiffness import (
    DIRECTIONS,
    largest_rows,
    share_rows,
)
from forcefit.inputs.errors import plot_label
from forcefit.page.charts import COLOURS, GREY, Axis, chart, label

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_shares(results: Mapping[str, Any], figure: "Figure | None" = None) -> "Figure":
    """Draw a bar chart of the compliance shares of the parts in each direction.

    Args:
        results: result of
            :func:`forcefit.assembly.report.platform_stiffness.stiffness_of`.
        figure: empty figure to draw in; None to create a new one.

    Returns:
        The figure; directions without a finite compliance are left empty.
    """
    from matplotlib.figure import Figure

    figure = figure or Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    bottom = np.zeros(6)
    for name, (row, colour) in _coloured(results["shares"]).items():
        height = 100 * np.nan_to_num(row)
        axes.bar(
            DIRECTIONS, height, bottom=bottom, label=plot_label(name), color=colour
        )
        bottom = bottom + height
    axes.set_ylabel("share of the compliance [%]")
    axes.set_title(plot_label(f"{results['robot']}: compliance of the parts"))
    axes.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def share_chart(shares: Mapping[str, Any], caption: str) -> str:
    """Return an HTML chart of the largest compliance shares, one bar per direction.

    Args:
        shares: shares from
            :func:`forcefit.assembly.report.platform_stiffness.stiffness_values`.
        caption: caption below the chart.

    Returns:
        HTML of the chart.
    """
    traces = [
        {"type": "bar", "name": label(name), "x": list(DIRECTIONS), "y": row,
         "marker": {"color": colour}}
        for name, (row, colour) in _coloured(shares).items()
    ]  # fmt: skip
    share = Axis("share of the compliance", options={"tickformat": ".0%"})
    return chart(traces, Axis(""), share, caption, bars="stack")


def _coloured(shares: Mapping[str, Any]) -> dict[str, tuple[list[float], str]]:
    """Assign colours to the largest shares; the sum of all others is grey."""
    rows = share_rows(dict(shares))
    shown = largest_rows(rows).items()
    return {
        name: (row, colour if name in rows else GREY)
        for (name, row), colour in zip(shown, cycle(COLOURS), strict=False)
    }
