"""Plot the errors caused by modelling assumptions."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from forcefit.inputs.errors import plot_label
from forcefit.validation.assumptions.platform_cost import PlatformCosts
from forcefit.validation.assumptions.report import COMPARED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BARS = 12  # largest number of links in the figure


def platform_cost_figure(
    costs: PlatformCosts, asked: Sequence[Mapping[str, float]], robot: str
) -> "Figure":
    """Return a figure of the platform stiffness errors and each link's contribution.

    Args:
        costs: errors at k poses.
        asked: prescribed pose components [m or rad] of each pose.
        robot: name of the robot.

    Returns:
        The figure.  Bars show the median and the largest error of each link.  For
        several poses, curves show the errors over the varied pose component or over the
        pose index.
    """
    from matplotlib.figure import Figure

    many = len(costs.beams) > 1
    figure = Figure(figsize=(9.0 if many else 5.5, 4.0), layout="constrained")
    panels = figure.subplots(1, 2 if many else 1, squeeze=False)[0]
    figure.suptitle(plot_label(f"{robot}: error of the platform's compliance"))
    if many:
        changes = [name for name in asked[0] if len({one[name] for one in asked}) > 1]
        x = np.arange(1.0, len(asked) + 1)
        label = "pose"
        if len(changes) == 1:
            label = f"{changes[0]} [{'rad' if changes[0][0] == 'r' else 'm'}]"
            x = np.array([one[changes[0]] for one in asked])
        for name, line in (("beams", ".-"), ("ends", "x:")):
            panels[0].plot(x, 100 * getattr(costs, name), line, label=COMPARED[name])
        panels[0].set(xlabel=plot_label(label), ylabel="largest over all wrenches [%]")
        panels[0].set_ylim(bottom=0.0, top=1.1 * panels[0].get_ylim()[1])
        panels[0].legend()
    links = list(costs.by_link)[:_BARS][::-1]
    most = [100 * np.nanmax(costs.by_link[name]) for name in links]
    names = [plot_label(name) for name in links]
    panels[-1].barh(names, most, color="C0", alpha=0.4 if many else 1.0)
    if many:
        middle = [100 * np.nanmedian(costs.by_link[name]) for name in links]
        panels[-1].barh(names, middle, color="C0")
    panels[-1].set_xlabel(
        "only that link a beam [%]" + (", median and largest" if many else "")
    )
    return figure
