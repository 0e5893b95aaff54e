"""What is left at each step of the ladder, and against what."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

ARMS = {0: "tab:blue", 7: "tab:orange", 4: "tab:green"}


def draw(scores: dict, rows: dict, out: Path) -> Path:
    """Bars of the ladder; error against height, moment and arm solution.

    Args:
        scores: of the study, by step.
        rows: evaluation points by file.
        out: folder of ``residuals.png``.

    Returns:
        The picture's path.
    """
    figure = Figure(figsize=(12, 7.5), layout="constrained")
    ladder, *panels = figure.subplots(2, 2).ravel()
    names = list(scores)
    place = np.arange(len(names))
    for k, file in enumerate(("pallet", "orthogonal_wood")):
        values = [scores[n].evaluation[file] * 1e3 for n in names]
        ladder.barh(place + 0.4 * k - 0.2, values, 0.4, label=file)
    ladder.set_yticks(place, names)
    ladder.invert_yaxis()
    ladder.set(xlabel="rms [mm], evaluation points")
    ladder.legend()
    shown = (names[1], names[5], names[-1])
    for panel, name in zip(panels, shown, strict=True):
        mine = rows["pallet"]
        height, space = mine.covariates["height"], mine.covariates["space"]
        left = scores[name].left["pallet"] * 1e3
        for number, color in ARMS.items():
            at = space == number
            spread = height[at] + np.linspace(-0.04, 0.04, at.sum())
            panel.plot(
                spread, left[at, 0], ".", color=color, ms=4, label=f"arm {number}"
            )
        panel.axhline(0, color="0.6", lw=0.8)
        panel.set(title=name, xlabel="column height [m]", ylabel="pallet, error x [mm]")
        panel.set_ylim(-6, 6)
    panels[0].legend()
    path = out / "residuals.png"
    figure.savefig(path, dpi=80)
    return path
