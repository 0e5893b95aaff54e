"""Figures of link stiffnesses and stresses."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from forcefit.results.text import value_text
from forcefit.stiffness.beam.beam import section_axes
from forcefit.stiffness.beam.beam_stress import peak_beam_stress
from forcefit.stiffness.fem.stress import PeakStress, StressInfluence, von_mises
from forcefit.stiffness.link import LinkStiffness
from forcefit.stiffness.report.compare import LinkComparison, entries_that_matter
from forcefit.stiffness.report.slenderness import SlendernessSweep
from forcefit.stiffness.screws import SCREW

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_comparison(comparison: LinkComparison) -> "Figure":
    """Plot the stiffnesses by finite elements and by beam theory, and their difference.

    Args:
        comparison: comparison of the two stiffnesses of a link.

    Returns:
        A figure with two bars for each significant entry, and a map of the differences.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.3, 1])
    _plot_entries(left, [comparison.beam, comparison.fea])
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


def _plot_entries(axes: "Axes", links: "Sequence[LinkStiffness]") -> None:
    """Plot the significant entries as bars."""
    entries = entries_that_matter(links[0].stiffness)
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


def plot_slenderness(sweep: SlendernessSweep) -> "Figure":
    """Plot the end effect over slenderness, with its fit.

    Args:
        sweep: comparisons of one section at several lengths.

    Returns:
        A figure with a curve for each significant entry. Error bars show the mesh
        errors.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.8), layout="constrained")
    axes = figure.subplots()
    ratio = sweep.slenderness
    fine = np.geomspace(ratio.min(), ratio.max(), 200)
    errors = [100 * c.fea.relative_error_estimate for c in sweep.comparisons]
    # of two equal entries of a round section, only the first is plotted
    plotted: list[tuple[int, int]] = []
    for entry in entries_that_matter(sweep.comparisons[0].beam.stiffness):
        c, d = sweep.end_effect[entry], sweep.second[entry]
        if any(abs(abs(sweep.end_effect[e]) - abs(c)) < 0.01 for e in plotted):
            continue
        plotted.append(entry)
        name = " ".join(SCREW[i] for i in dict.fromkeys(entry))
        values = [100 * k.difference[entry] for k in sweep.comparisons]
        (line,) = axes.plot(fine, 100 * (c / fine + d / fine**2), lw=1)
        label = f"{name}: c = {c:.3f}"
        axes.errorbar(
            ratio, values, errors, fmt="o", color=line.get_color(), label=label
        )
    axes.set_xscale("log")
    axes.set_xticks(ratio, [f"{v:.3g}" for v in ratio])
    axes.set_xticks([], minor=True)
    axes.axhline(0, color="0.7", lw=0.8)
    axes.set_xlabel("L / r")
    axes.set_ylabel("finite elements minus beam [% of sqrt(K_ii K_jj)]")
    axes.set_title("End effect: K / K_beam = 1 + c r / L + d (r / L)²", fontsize=11)
    axes.legend(fontsize=8)
    return figure


def plot_stress(
    everywhere: StressInfluence,
    peak: PeakStress,
    base: ArrayLike,
    tip: ArrayLike,
    section: "Mapping[str, float] | None" = None,
    up: ArrayLike | None = None,
) -> "Figure":
    """Plot the von Mises stress due to a wrench over the position along the link.

    Args:
        everywhere: stresses due to unit wrenches at all nodes.
        peak: peak stress due to the wrench.
        base: (3,) [m] position of the base.
        tip: (3,) [m] position of the tip.
        section: section of a beam, to plot the stress by beam theory.
        up: (3,) vector in the direction of the section's z axis.

    Returns:
        A figure with a dot for each node, and a line for the largest stress in each
        section of the beam. Regions that were not evaluated are shaded.
    """
    from matplotlib.figure import Figure

    p, q = np.asarray(base, dtype=float), np.asarray(tip, dtype=float)
    length = float(np.linalg.norm(q - p))
    along = (everywhere.places - p) @ (q - p) / length
    values = von_mises(everywhere.stresses(peak.wrench)) / 1e6
    figure = Figure(figsize=(8, 4.4), layout="constrained")
    axes = figure.subplots()
    axes.plot(1e3 * along, values, ".", ms=2, color="0.5", label="nodes")
    for low, high in ((along.min(), peak.away), (length - peak.away, along.max())):
        axes.axvspan(1e3 * low, 1e3 * high, color="C3", alpha=0.12, lw=0)
    where = 1e3 * float((peak.place - p) @ (q - p)) / length
    label = f"peak {value_text('von_mises', peak.von_mises)}"
    axes.plot(where, peak.von_mises / 1e6, "o", color="C3", label=label)
    top = peak.von_mises / 1e6
    if section is not None:
        R = section_axes(q - p, up)
        x = np.linspace(0, length, 200)
        loads = np.tile(np.r_[peak.wrench[:3] @ R, peak.wrench[3:] @ R], (200, 1))
        arm = np.column_stack([length - x, 0 * x, 0 * x])
        loads[:, :3] += np.cross(arm, loads[:, 3:])
        line = peak_beam_stress(section, 0.0, loads)[0] / 1e6
        axes.plot(1e3 * x, line, color="C0", label="beam formula")
        top = max(top, line.max())
    axes.set_ylim(0, 1.3 * top)
    axes.set_xlabel("from base to tip [mm]; shaded: not evaluated (clamped edge)")
    axes.set_ylabel("von Mises stress [MPa]")
    axes.legend(fontsize=8)
    return figure
