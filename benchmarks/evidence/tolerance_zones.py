"""Draw the zones of callouts for docs/drawing_tolerances.md.

``python benchmarks/evidence/tolerance_zones.py docs/pictures/tolerance_zones.png``
draws sections of the zones, with uniformly distributed random positions.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from forcefit.assembly.callouts.fits import parse_fit
from forcefit.assembly.callouts.zone import Zone, intersection
from forcefit.assembly.callouts.zones_of_features import (
    axis_orientation,
    axis_position,
    offset_rows,
    plane_position,
)

COUNT = 3000


def drawn(zone: Zone) -> np.ndarray:
    """Return uniformly distributed random screws in a zone, (k, 6)."""

    def numbers(attempt: int) -> np.ndarray:
        return np.random.default_rng([1, attempt]).random((COUNT, zone.words))

    return zone.draw(numbers) @ zone.columns.T


def main(path: str) -> None:
    """Write the picture."""
    position = axis_position(50e-6, 0.020)
    both = intersection([position, axis_orientation(20e-6, 0.020)])
    face = plane_position(40e-6, 0.040, 0.030)
    figure, axes = plt.subplots(2, 3, figsize=(10, 6.2), layout="constrained")
    screws = drawn(position)
    end = screws @ offset_rows(0.010).T * 1e6
    axes[0, 0].plot(*end.T, ".", ms=1.5)
    axes[0, 0].set(title="position 0.05: one end of the axis", xlabel="x [um]",
                   ylabel="y [um]", aspect="equal")  # fmt: skip
    for panel, zone, title in [
        (axes[0, 1], position, "position 0.05: shift and tilt"),
        (axes[0, 2], both, "and parallelism 0.02"),
    ]:
        screws = drawn(zone)
        panel.plot(screws[:, 3] * 1e6, screws[:, 1] * 1e3, ".", ms=1.5)
        panel.set(title=title, xlabel="shift TX [um]", ylabel="tilt RY [mrad]",
                  xlim=(-27, 27), ylim=(-2.7, 2.7))  # fmt: skip
    screws = drawn(face)
    axes[1, 0].plot(screws[:, 5] * 1e6, screws[:, 1] * 1e3, ".", ms=1.5)
    axes[1, 0].set(title="profile 0.04 of a face 40 x 30", xlabel="shift TZ [um]",
                   ylabel="tilt RY [mrad]")  # fmt: skip
    heights = np.linspace(0, 0.2, 60)
    for zone, name in [(position, "position 0.05"), (both, "and parallelism 0.02")]:
        reach = [zone.support(offset_rows(h)[0]) * 1e6 for h in heights]
        axes[1, 1].plot(heights * 1e3, reach, label=name)
    axes[1, 1].set(title="reach along the axis", xlabel="height [mm]",
                   ylabel="largest offset [um]")  # fmt: skip
    axes[1, 1].legend()
    pairs = np.random.default_rng(1).random((200_000, 2))
    for kind in ("uniform", "normal"):
        radial = parse_fit("12 H7/g6").draw(pairs, kind) * 1e6
        axes[1, 2].hist(radial, 80, histtype="step", density=True, label=kind)
    axes[1, 2].set(title="fit 12 H7/g6", xlabel="radial clearance [um]",
                   ylabel="density [1/um]")  # fmt: skip
    axes[1, 2].legend()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(sys.argv[1])
