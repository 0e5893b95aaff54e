"""Pictures of stiffnesses; a function takes a result and returns a figure."""

from typing import TYPE_CHECKING

import numpy as np

from stiffness.compare import Comparison
from stiffness.link import LinkStiffness, scaled
from stiffness.screws import SCREW

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_comparison(comparison: Comparison) -> "Figure":
    """K_E by finite elements and by a beam, and their difference, entry by entry.

    Args:
        comparison: of one link by two methods.

    Returns:
        The figure: a bar pair for each entry that matters, and the map of differences.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.3, 1])
    _draw_entries(left, [comparison.beam, comparison.fea])
    percent = 100 * comparison.difference
    limit = max(np.abs(percent).max(), 1e-3)
    image = right.imshow(percent, cmap="RdBu_r", vmin=-limit, vmax=limit)
    for (i, j), value in np.ndenumerate(percent):
        if abs(value) >= 0.005:
            right.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=8)
    right.set_xticks(range(6), SCREW)
    right.set_yticks(range(6), SCREW)
    right.set_title("finite elements minus beam\n[% of sqrt(K_ii K_jj)]", fontsize=10)
    figure.colorbar(image, ax=right, shrink=0.8)
    figure.suptitle(
        f"K_E at the tip, L / r = {comparison.slenderness:.3g}; mesh error "
        f"{100 * comparison.fea.relative_error_estimate:.2g} % (estimate)",
        fontsize=11,
    )
    return figure


def _draw_entries(axes: "Axes", links: "Sequence[LinkStiffness]") -> None:
    """Entries larger than a thousandth of their scale, as bars of each link."""
    reference = links[0].stiffness
    matters = np.abs(np.triu(scaled(reference, reference))) > 1e-3
    entries = list(zip(*np.nonzero(matters), strict=True))
    width = 0.8 / len(links)
    for k, link in enumerate(links):
        values = [abs(link.stiffness[i, j]) for i, j in entries]
        offset = (k - (len(links) - 1) / 2) * width
        axes.bar(np.arange(len(entries)) + offset, values, width, label=link.method)
    axes.set_yscale("log")
    axes.set_xticks(
        range(len(entries)),
        [f"{SCREW[i]}\n{SCREW[j]}" for i, j in entries],
        fontsize=8,
    )
    axes.set_ylabel("|K| [N m/rad, N/rad, N/m]")
    axes.legend(fontsize=8)
