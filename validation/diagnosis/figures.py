"""Figures of a diagnosis.  Functions take it and return a matplotlib figure."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forcefit.inputs.errors import plot_label
from validation.diagnosis.diagnosis import Diagnosis
from validation.diagnosis.separability import Separability, compare_signatures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BEFORE, _AFTER = "C3", "C0"


def error_figure(diagnosis: Diagnosis) -> "Figure":
    """Before, after and noise on the rows kept aside [um, urad].

    Args:
        diagnosis: the diagnosis.

    Returns:
        Bars, position and rotation beside each other.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 2.8), layout="constrained")
    panels = figure.subplots(1, 2)
    for panel, kind, unit in zip(
        panels, ("position", "rotation"), ("um", "urad"), strict=True
    ):
        bars = {
            "before": diagnosis.before,
            "after": diagnosis.after,
            "noise": diagnosis.noise,
        }
        values = [1e6 * getattr(e, kind) for e in bars.values()]
        shown = [v if np.isfinite(v) else 0.0 for v in values]
        panel.barh(list(bars), shown, color=[_BEFORE, _AFTER, "0.6"])
        panel.invert_yaxis()
        panel.set(title=kind, xlabel=f"rms on rows kept aside [{unit}]")
        for k, v in enumerate(values):
            panel.text(shown[k], k, f" {v:.3g}" if np.isfinite(v) else " not measured",
                       va="center")  # fmt: skip
        panel.margins(x=0.25)
    return figure


def ladder_figure(diagnosis: Diagnosis) -> "Figure":
    """What every step bought, on the rows kept aside.

    Args:
        diagnosis: the diagnosis.

    Returns:
        Bars in the order of the steps, in sigmas.
    """
    from matplotlib.figure import Figure

    steps = diagnosis.ladder
    figure = Figure(figsize=(7, 0.35 * len(steps) + 0.9), layout="constrained")
    panel = figure.subplots()
    values = [rung.error.normalised for rung in steps]
    panel.barh(range(len(steps)), values, color=_AFTER)
    panel.set_yticks(range(len(steps)), [rung.term for rung in steps])
    panel.invert_yaxis()
    panel.axvline(1.0, color="0.5", lw=0.8)
    for k, value in enumerate(values):
        panel.text(value, k, f" {value:.3g}", va="center")
    panel.set(xlabel="rms on rows kept aside [sigma]")
    panel.margins(x=0.15)
    return figure


def vector_figure(diagnosis: Diagnosis) -> "Figure":
    """Residual displacements where they were measured, seen from the top and the side.

    Args:
        diagnosis: the diagnosis.

    Returns:
        Arrows before and after, all to the same scale.
    """
    from matplotlib.figure import Figure

    platform = diagnosis.conditions.postures.platform
    where = platform[:, :3, 3] + platform[:, :3, :3] @ diagnosis.conditions.point
    known = ~diagnosis.outliers
    figure = Figure(figsize=(9, 8), layout="constrained")
    panels = figure.subplots(2, 2)
    both = {"before": diagnosis.residual_before, "after": diagnosis.residual_after}
    size = np.linalg.norm(np.nan_to_num(diagnosis.residual_before[known, 3:]), axis=1)
    span = float(np.ptp(where, axis=0).max()) or 1.0
    factor = max(float(np.quantile(size, 0.9)), 1e-12) / (0.12 * span)
    for column, (name, residual) in zip(panels.T, both.items(), strict=True):
        shift = np.nan_to_num(residual[:, 3:])
        for panel, (i, j) in zip(column, ((0, 1), (0, 2)), strict=True):
            panel.quiver(
                where[known, i], where[known, j], shift[known, i], shift[known, j],
                angles="xy", scale_units="xy", scale=factor, width=0.003,
                color=_BEFORE if name == "before" else _AFTER,
            )  # fmt: skip
            panel.set(title=name, xlabel=f"{'xyz'[i]} [m]", ylabel=f"{'xyz'[j]} [m]")
            panel.set_aspect("equal", adjustable="datalim")
            panel.margins(0.2)
    figure.suptitle(
        f"residual displacements, shown {1 / factor:.0f} times larger", fontsize=10
    )
    return figure


def covariate_figure(diagnosis: Diagnosis) -> "Figure":
    """Size of the residual against everything that was varied, before and after.

    Args:
        diagnosis: the diagnosis.

    Returns:
        A panel for each of load, pose components and covariates.
    """
    from matplotlib.figure import Figure

    varied = {k: v for k, v in _varied(diagnosis).items() if np.ptp(v) > 0}
    columns = 3
    rows = max(1, -(-len(varied) // columns))
    figure = Figure(figsize=(9, 2.4 * rows), layout="constrained")
    panels = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    kept = ~diagnosis.outliers
    for panel, (name, values) in zip(panels, varied.items(), strict=False):
        for residual, color, label in (
            (diagnosis.residual_before, _BEFORE, "before"),
            (diagnosis.residual_after, _AFTER, "after"),
        ):
            z = np.sqrt(np.nanmean((residual / diagnosis.campaign.sigma) ** 2, axis=1))
            panel.plot(values[kept], z[kept], ".", ms=4, color=color, label=label)
        panel.axhline(1.0, color="0.5", lw=0.8)
        panel.set(xlabel=plot_label(name), yscale="log")
    for panel in panels[len(varied) :]:
        panel.set_axis_off()
    panels[0].set_ylabel("residual / sigma")
    panels[0].legend(fontsize=8)
    return figure


def _varied(diagnosis: Diagnosis) -> dict[str, NDArray]:
    """What the residual may depend on, by its label."""
    campaign = diagnosis.campaign
    varied = {"load size [N]": np.linalg.norm(campaign.loads[:, 3:], axis=1)}
    for i, frame in enumerate(campaign.robot.frames):
        if frame.actuated and len(varied) < 8:
            unit = "m" if frame.joint == "prismatic" else "rad"
            varied[f"{frame.name} [{unit}]"] = campaign.coordinates[:, i]
    units = {"temperature": "K", "time": "s"}
    for name, values in campaign.covariates.items():
        varied[f"{name} [{units.get(name, '-')}]"] = values
    return varied


def probability_figure(diagnosis: Diagnosis) -> "Figure":
    """Probability of every effect that the design can show.

    Args:
        diagnosis: the diagnosis.

    Returns:
        Bars, the likeliest on top.
    """
    from matplotlib.figure import Figure

    ranked = sorted(diagnosis.probability.items(), key=lambda item: item[1])
    figure = Figure(figsize=(7, 0.3 * len(ranked) + 0.8), layout="constrained")
    panel = figure.subplots()
    panel.barh([n for n, _ in ranked], [p for _, p in ranked], color=_AFTER)
    panel.axvline(0.9, color="0.5", lw=0.8)
    panel.axvline(0.5, color="0.5", lw=0.8, ls="--")
    panel.set(xlim=(0, 1), xlabel="probability (claimed from 0.9, a rival from 0.5)")
    return figure


def separability_of(diagnosis: Diagnosis) -> Separability:
    """Angles between the signatures of effects, by the design of this campaign.

    Args:
        diagnosis: the diagnosis.

    Returns:
        The comparison, each effect in its most general form.
    """
    columns: dict[str, NDArray] = {}
    for signature in diagnosis.screen.signatures:
        h = signature.hypothesis
        scale = np.array([slot.unknown.scale for slot in h.slots])
        shown = signature.columns * scale
        if h.effect not in columns and np.any(shown):
            columns[h.effect] = shown
    return compare_signatures(columns)


def confounding_figure(diagnosis: Diagnosis) -> "Figure":
    """What can imitate what: share of the row's effect that the column's can show.

    Args:
        diagnosis: the diagnosis.

    Returns:
        A matrix of numbers from 0 to 1.
    """
    from matplotlib.figure import Figure

    angles = separability_of(diagnosis)
    count = len(angles.names)
    figure = Figure(figsize=(8, 7), layout="constrained")
    panel = figure.subplots()
    shared = angles.shared
    image = panel.imshow(shared, vmin=0, vmax=1, cmap="Blues")
    panel.set_xticks(range(count), angles.names, rotation=45, ha="right", fontsize=8)
    panel.set_yticks(range(count), angles.names, fontsize=8)
    for i in range(count):
        for j in range(count):
            value = shared[i, j]
            panel.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=6,
                       color="w" if value > 0.6 else "k")  # fmt: skip
    figure.colorbar(image, label="share of the row that the column can imitate")
    return figure
