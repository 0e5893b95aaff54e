"""What is left of each line's length, against the turn of its spool."""

from pathlib import Path

from matplotlib.figure import Figure
from numpy.typing import NDArray

from examples.hangprinter.convert import LINES, Samples


def draw(left: dict[str, NDArray], samples: Samples, out: Path) -> Path:
    """One panel a model.

    Args:
        left: (k, 4) [m] residuals by model.
        samples: the k rows.
        out: folder of ``residuals.png``.

    Returns:
        The picture's path.
    """
    figure = Figure(figsize=(12, 3.6), layout="constrained")
    panels = figure.subplots(1, len(left), sharey=True)
    for panel, (name, r) in zip(panels, left.items(), strict=True):
        for k, line in enumerate(LINES):
            panel.plot(samples.spool[:, k], r[:, k] * 1e3, ".", label=line)
        panel.axhline(0, color="0.6", lw=0.8)
        panel.set(title=name, xlabel="turn of the spool [rad]")
    panels[0].set_ylabel("line length left [mm]")
    panels[-1].legend()
    path = out / "residuals.png"
    figure.savefig(path, dpi=80)
    return path
