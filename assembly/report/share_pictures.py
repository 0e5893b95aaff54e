"""Charts of the contributions to the platform compliance."""

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
    """Draw a bar chart of the contributions to the compliance in each direction.

    Args:
        results: result of
            :func:`forcefit.assembly.report.platform_stiffness.stiffness_of`.
        figure: empty figure; None to create one.

    Returns:
        The figure. There is no bar without a finite compliance.
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
    """Return an HTML chart of the largest contributions in each direction.

    Args:
        shares: contributions from
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
    """Return the largest contributions with their colours."""
    rows = share_rows(dict(shares))
    shown = largest_rows(rows).items()
    return {
        name: (row, colour if name in rows else GREY)
        for (name, row), colour in zip(shown, cycle(COLOURS), strict=False)
    }
