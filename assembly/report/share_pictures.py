"""Pictures of the parts' shares in the compliance of the platform."""

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
    """Return a bar chart of the parts' shares in the compliance along each direction.

    Args:
        results: of :func:`forcefit.assembly.report.platform_stiffness.stiffness_of`.
        figure: an empty one in which it is drawn; else a new one.

    Returns:
        The figure; directions without a finite compliance are empty.
    """
    from matplotlib.figure import Figure

    rows = share_rows(results["shares"])
    figure = figure or Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    bottom = np.zeros(6)
    for name, row in largest_rows(rows).items():
        height = 100 * np.nan_to_num(row)
        grey = {} if name in rows else {"color": GREY}
        axes.bar(DIRECTIONS, height, bottom=bottom, label=plot_label(name), **grey)
        bottom = bottom + height
    axes.set_ylabel("share of the compliance [%]")
    axes.set_title(plot_label(f"{results['robot']}: compliance of the parts"))
    axes.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def share_chart(shares: Mapping[str, Any], caption: str) -> str:
    """Return a chart of the largest shares for a page, a bar for each direction.

    Args:
        shares: of :func:`forcefit.assembly.report.platform_stiffness.stiffness_values`.
        caption: below it.

    Returns:
        HTML.
    """
    rows = share_rows(dict(shares))
    traces = [
        {"type": "bar", "name": label(name), "x": list(DIRECTIONS), "y": row,
         "marker": {"color": colour if name in rows else GREY}}
        for (name, row), colour in zip(
            largest_rows(rows).items(), cycle(COLOURS), strict=False
        )
    ]  # fmt: skip
    share = Axis("share of the compliance", options={"tickformat": ".0%"})
    return chart(traces, Axis(""), share, caption, bars="stack")
