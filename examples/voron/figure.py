"""What is left of the held-out run, against time and bed temperature."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from validation.campaign.campaign import Campaign


def draw(campaign: Campaign, left: dict[str, NDArray], out: Path) -> Path:
    """Residuals of the models, one colour each.

    Args:
        campaign: the held-out run.
        left: (k,) [m] by model.
        out: folder of ``residuals.png``.

    Returns:
        The picture's path.
    """
    figure = Figure(figsize=(11, 4), layout="constrained")
    time, bed = figure.subplots(1, 2, sharey=True)
    hours = campaign.covariates["time"] / 3600
    for name, r in left.items():
        um = (r - np.mean(r)) * 1e6
        time.plot(hours, um, lw=1, label=name)
        bed.plot(campaign.covariates["bed_temperature"], um, ".", ms=2)
    time.set(xlabel="time [h]", ylabel="height left, run a [um]")
    bed.set(xlabel="bed temperature above the first [K]")
    time.legend(fontsize=8)
    path = out / "residuals.png"
    figure.savefig(path, dpi=80)
    return path
