"""Plots of cross-checks.  Functions take a result and return a figure."""

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import Posture
from stiffness.link import scaled
from stiffness.screws import SCREW
from validation.crosscheck.crosscheck import Crosscheck
from validation.crosscheck.pose_metric import PoseMetric

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def slope_figure(check: Crosscheck) -> "Figure":
    """Difference of simulation and linear model against the scale of the errors.

    Args:
        check: of :func:`validation.crosscheck.crosscheck.crosscheck`, without
            clearances.

    Returns:
        A log-log figure, rotation [mrad] and translation [mm] beside each other, each
        with a line of slope 2 through the value of the smallest scale.
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


def stiffness_figure(beam: NDArray, fea: NDArray) -> "Figure":
    """Two stiffness matrices of one link, entry by entry.

    Args:
        beam: (6, 6) [N m/rad .. N/m] K_E in closed form.
        fea: (6, 6) the same by finite elements.

    Returns:
        A figure of their difference in per cent of sqrt(K_ii K_jj) of the beam, so
        that rotations and translations are comparable.
    """
    from matplotlib.figure import Figure

    difference = 100 * scaled(fea - beam, beam)
    bound = np.abs(difference).max() or 1.0
    figure = Figure(figsize=(5.2, 4.4), layout="constrained")
    panel = figure.subplots()
    image = panel.imshow(difference, cmap="RdBu_r", vmin=-bound, vmax=bound)
    figure.colorbar(image, ax=panel, label="difference [% of sqrt(K_ii K_jj)]")
    for (i, j), value in np.ndenumerate(difference):
        panel.text(j, i, f"{value:+.2f}", ha="center", va="center", fontsize=8)
    panel.set(xticks=range(6), yticks=range(6), xticklabels=SCREW, yticklabels=SCREW)
    panel.set_title("K_E, finite elements minus beam", fontsize="medium")
    return figure


def closing_figure(
    posture: Posture, sequence: NDArray, exaggeration: float | None = None
) -> "Figure":
    """A robot open, half closed and closed, its displacements exaggerated.

    Args:
        posture: nominal.
        sequence: (k, n, 4, 4) frames of
            :func:`validation.multibody.simulation.closing_sequence`.
        exaggeration: factor on displacements from the nominal posture; default: the
            widest open closure is plotted as a tenth of the robot.

    Returns:
        A figure of three panels; red lines join the frames that are to coincide.
    """
    from matplotlib.figure import Figure

    robot, nominal = posture.robot, posture.transforms[:, :3, 3]
    pairs = [(robot.index(a), robot.index(b)) for a, b in robot.closures]
    moved = sequence[:, :, :3, 3] - nominal
    size = float(np.ptp(nominal, axis=0).max()) or 1.0
    if exaggeration is None:
        gaps = [np.linalg.norm(moved[0, a] - moved[0, b]) for a, b in pairs]
        widest = float(max(gaps, default=0.0))
        exaggeration = 0.1 * size / widest if widest > 0 else 1.0
    shown = nominal + exaggeration * moved
    figure = Figure(figsize=(11, 4), layout="constrained")
    chosen = {"open": 0, "closing": len(sequence) // 3, "shut": -1}
    for k, (title, step) in enumerate(chosen.items(), 1):
        panel = figure.add_subplot(1, 3, k, projection="3d")
        for points, colour in ((nominal, "0.8"), (shown[step], "C0")):
            starts = np.vstack([points, np.zeros(3)])[robot.parents]
            for start, end in zip(starts, points, strict=True):
                panel.plot(*np.transpose([start, end]), color=colour, lw=1.5)
        for a, b in pairs:
            panel.plot(*np.transpose(shown[step][[a, b]]), color="C3", lw=2)
        panel.set(title=title, xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
        panel.set_aspect("equal")
    figure.suptitle(f"displacements {exaggeration:.3g} times", fontsize="medium")
    return figure
