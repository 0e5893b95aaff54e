"""Figures of the results of ``crosscheck_validity.py``."""

import numpy as np
from matplotlib.figure import Figure

PANELS = {
    "closures": ("(a) linear closures", "errors [mrad]"),
    "beams": ("(b) beams, not solids", "slenderness L / r"),
    "weights": ("(c) weight at the links' ends", "slenderness L / r"),
    "discs": ("(d) disc and cone, not two bushes", "errors [mrad]"),
}
LIMITS = {"position": 20e-6, "energy": 0.01}  # [m], [-]
STYLES = {"position": "o-", "energy": "s--"}


def validity_figure(rows: list[dict]) -> Figure:
    """Plot medians and maxima of errors, relative to their limits (20 um or 1 %).

    Args:
        rows: results of the benchmark.

    Returns:
        A figure with a row of panels for each robot and a column for each assumption.
    """
    names = list(dict.fromkeys(r["robot"] for r in rows))
    figure = Figure(figsize=(15, 3.6 * len(names)), layout="constrained")
    axes = figure.subplots(len(names), len(PANELS), sharey=True)
    for (i, name), (j, (what, (title, label))) in (
        (a, b) for a in enumerate(names) for b in enumerate(PANELS.items())
    ):
        panel = axes[i, j]
        mine = [r for r in rows if r["robot"] == name and r["assumption"] == what]
        unit = 1e3 if label.startswith("errors") else 1.0
        for k, case in enumerate(dict.fromkeys(r["case"] for r in mine)):
            chosen = [r for r in mine if r["case"] == case]
            x = unit * np.array([r["x"] for r in chosen])
            for kind, limit in LIMITS.items():
                y = np.array([r[kind] for r in chosen]) / limit
                shown = np.where(y > 1e-3, y, np.nan)
                style = {"color": f"C{k}", "ms": 4}
                panel.loglog(
                    x, shown[:, 0], STYLES[kind], label=f"{case}: {kind}", **style
                )
                panel.loglog(x, shown[:, 1], STYLES[kind][1:], lw=0.5, color=f"C{k}")
        panel.axhspan(1, 1e4, color="C3", alpha=0.08)
        panel.axhline(1, color="C3", lw=1)
        panel.set(title=f"{name} {title}", xlabel=label, ylim=(1e-3, 1e3))
        ticks = list(dict.fromkeys(unit * r["x"] for r in mine))
        panel.set_xticks(ticks, [f"{t:g}" for t in ticks])
        panel.set_xticks([], minor=True)
        panel.grid(visible=True, alpha=0.3)
        panel.legend(fontsize=6)
    for panel in axes[:, 0]:
        panel.set_ylabel("cost / (20 um or 1 %)")
    return figure


def pose_figure(maps: dict[str, dict]) -> Figure:
    """Plot the errors over the workspace for the geometric errors of the paper.

    Args:
        maps: for each robot, coordinates ``x`` and ``z`` [m], and position errors [m]
            and energy errors [-] for each assumption, (z, x, 2).

    Returns:
        The figure.
    """
    from matplotlib.colors import LogNorm

    figure = Figure(figsize=(15, 3.2 * len(maps)), layout="constrained")
    axes = figure.subplots(len(maps), 4)
    for i, (name, costs) in enumerate(maps.items()):
        kinds = [(a, k) for a in ("closures", "discs") for k in range(2)]
        for panel, (what, k) in zip(axes[i], kinds, strict=True):
            kind = list(LIMITS)[k]
            values = np.maximum(costs[what][..., k] / LIMITS[kind], 1e-2)
            image = panel.pcolormesh(
                costs["x"], costs["z"], values, cmap="coolwarm",
                norm=LogNorm(1e-2, 1e2), shading="nearest",
            )  # fmt: skip
            panel.set(title=f"{name} {PANELS[what][0]}: {kind}", xlabel="x [m]",
                      ylabel="z [m]")  # fmt: skip
            panel.title.set_fontsize("small")
        figure.colorbar(image, ax=axes[i], label="cost / (20 um or 1 %)")
    return figure
