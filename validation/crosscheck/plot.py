"""Plot the results of cross-checks."""

import math
from typing import TYPE_CHECKING

import numpy as np

from forcefit.validation.crosscheck.crosscheck import Crosscheck
from forcefit.validation.crosscheck.pose_metric import PoseMetric

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def slope_figure(check: Crosscheck) -> "Figure":
    """Return a log-log figure of the model difference over the scale.

    Args:
        check: result of :func:`forcefit.validation.crosscheck.crosscheck.crosscheck`,
            without clearances.

    Returns:
        A figure with panels for rotation [mrad] and translation [mm], each with a line
        of slope 2 through the value at the smallest scale.
    """
    from matplotlib.figure import Figure

    metric = check.metric
    assert isinstance(metric, PoseMetric)
    figure = Figure(figsize=(8, 3.6), layout="constrained")
    panels = figure.subplots(1, 2)
    units = {"rotation": "mrad", "translation": "mm"}
    scales = check.scales
    for panel, (name, values) in zip(panels, metric.differences.items(), strict=True):
        slope = metric.slopes[name]
        label = "no difference" if math.isnan(slope) else f"slope {slope:.3f}"
        shown = np.where(values > 0, values, np.nan) * 1e3
        panel.loglog(scales, shown, "o", color="C0", label=label)
        guide = shown[-1] * (scales / scales[-1]) ** 2
        panel.loglog(scales, guide, "--", color="0.5", label="slope 2")
        panel.set(
            title=name,
            xlabel="scale of the errors [-]",
            ylabel=f"simulation minus linear model [{units[name]}]",
        )
        panel.set_xticks(scales, [f"{s:.4g}" for s in scales])
        panel.set_xticks([], minor=True)
        panel.grid(visible=True, which="both", alpha=0.3)
        panel.legend()
    return figure
