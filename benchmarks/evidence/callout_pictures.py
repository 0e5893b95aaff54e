"""Draw the zone of each callout, for docs/drawing_tolerances.md.

``python benchmarks/evidence/callout_pictures.py docs/pictures/callouts`` writes an SVG
file for each callout.  The zones are computed by :mod:`forcefit.assembly.callouts`.
Side views show the extreme positions of a feature in its zone.  Sections show the
outline of all shifts and tilts.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from forcefit.assembly.callouts.fits import parse_fit
from forcefit.assembly.callouts.general_tolerances import linear_tolerance
from forcefit.assembly.callouts.zone import Zone, intersection
from forcefit.assembly.callouts.zones_of_features import (
    axis_orientation,
    axis_position,
    axis_position_along,
    datum_shift,
    offset_rows,
    plane_orientation,
    plane_position,
    point_position,
    round_plane_orientation,
    round_plane_position,
    shift_along,
)

LENGTH = 0.020  # [m] length of the bore
SIZES = 0.040, 0.030  # [m] sides of a rectangular face, or diameter of a round face
ALONG = np.array([1.0, 0.0])
GREY, BLUE, RED = "0.85", "tab:blue", "tab:red"
_CORNERS = ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (-1.0, 1.0))
# conversion factor and label of each screw component in the pictures
UNITS = {0: (1e3, "tilt RX [mrad]"), 1: (1e3, "tilt RY [mrad]"),
         3: (1e6, "shift TX [µm]"), 4: (1e6, "shift TY [µm]"),
         5: (1e6, "shift TZ [µm]")}  # fmt: skip


def outline(zone: Zone, first: int, second: int) -> np.ndarray:
    """Return the outline of a zone, projected on two components, (k, 2).

    Args:
        zone: zone of a feature.
        first: component along x, 0 to 5 for RX to TZ.
        second: component along y.
    """
    sizes = [max(zone.support(np.eye(6)[k]), 1e-12) for k in (first, second)]
    points = []
    for angle in np.linspace(0, 2 * np.pi, 121):
        direction = np.zeros(6)
        direction[[first, second]] = np.array([np.cos(angle), np.sin(angle)]) / sizes
        points.append(zone.farthest(direction)[[first, second]])
    scale = [UNITS[first][0], UNITS[second][0]]
    return np.array(points) * scale


def section(panel: Axes, zone: Zone, first: int, second: int) -> None:
    """Draw the outline of a zone."""
    points = outline(zone, first, second)
    panel.fill(*points.T, color=BLUE, alpha=0.25)
    panel.plot(*points.T, color=BLUE, lw=1)
    panel.set(xlabel=UNITS[first][1], ylabel=UNITS[second][1])
    panel.margins(0.15)


def extremes(zone: Zone, first: int, second: int, arm: float) -> list[np.ndarray]:
    """Return the extreme screws of a zone in the plane of a shift and a tilt."""
    found = []
    for shift, tilt in _CORNERS:
        direction = np.zeros(6)
        direction[[first, second]] = shift, tilt * arm
        found += [zone.farthest(direction), -zone.farthest(direction)]
    return found


def bore(panel: Axes, zone: Zone, width: float | None) -> None:
    """Draw a side view of the axis of a bore in its extreme positions."""
    z = np.array([-LENGTH / 2, LENGTH / 2])
    if width is not None:
        panel.fill_betweenx(z * 1e3, -width * 5e5, width * 5e5, color=GREY)
    for screw in extremes(zone, 3, 1, LENGTH / 2):
        x = [offset_rows(h)[0] @ screw for h in z]
        panel.plot(np.array(x) * 1e6, z * 1e3, color=BLUE, lw=1)
    panel.axvline(0, color="k", lw=0.8, ls="-.")
    panel.set(xlabel="x [µm]", ylabel="along the axis [mm]")
    panel.margins(0.15)


def face(panel: Axes, zone: Zone, width: float | None) -> None:
    """Draw a side view of a face in its extreme positions."""
    x = np.array([-SIZES[0] / 2, SIZES[0] / 2])
    if width is not None:
        panel.fill_between(x * 1e3, -width * 5e5, width * 5e5, color=GREY)
    for screw in extremes(zone, 5, 1, SIZES[0] / 2):
        panel.plot(x * 1e3, (screw[5] - x * screw[1]) * 1e6, color=BLUE, lw=1)
    panel.axhline(0, color="k", lw=0.8, ls="-.")
    panel.set(xlabel="along the face [mm]", ylabel="height [µm]")
    panel.margins(0.15)


def of_axis(
    zone: Zone, width: float | None, components: tuple[int, int] = (3, 1)
) -> Callable[[Axes, Axes], None]:
    """Return a function that draws both panels for the zone of an axis."""

    def draw(left: Axes, right: Axes) -> None:
        bore(left, zone, width)
        section(right, zone, *components)

    return draw


def of_face(
    zone: Zone, width: float | None, components: tuple[int, int] = (5, 1)
) -> Callable[[Axes, Axes], None]:
    """Return a function that draws both panels for the zone of a face."""

    def draw(left: Axes, right: Axes) -> None:
        face(left, zone, width)
        section(right, zone, *components)

    return draw


def point(left: Axes, right: Axes) -> None:
    """Draw the spherical zone of a point."""
    for panel, second in ((left, 4), (right, 5)):
        section(panel, point_position(50e-6), 3, second)
        panel.set_aspect("equal")


def length(left: Axes, right: Axes) -> None:
    """Draw both interpretations of a toleranced distance to a face."""
    face(left, shift_along(25e-6, np.eye(3)[2]), 50e-6)
    left.set_title("middle of the face", fontsize=8)
    face(right, plane_position(50e-6, *SIZES), 50e-6)
    right.set_title("(E): the whole face", fontsize=8)


def maximum_material(left: Axes, right: Axes) -> None:
    """Draw the zones of the smallest and the largest hole 12 H7."""
    for hole, colour in ((18e-6, RED), (0.0, BLUE)):
        width = 50e-6 + hole
        ends = outline(axis_position(width, LENGTH), 3, 4)
        left.plot(*ends.T, color=colour, lw=1,
                  label=f"hole 12.{hole * 1e6:03.0f} mm")  # fmt: skip
    left.set(xlabel="one end: x [µm]", ylabel="y [µm]", aspect="equal")
    left.legend(fontsize=6, loc="center")
    sizes = np.linspace(0, 18, 19)
    zone = axis_position(50e-6, LENGTH, 18e-6)
    radius = 25 * zone.growth(sizes / 18)
    right.fill_between(sizes, -radius, radius, color=BLUE, alpha=0.25)
    right.set(xlabel="hole larger by [µm]", ylabel="zone: x [µm]")


def shifting_datum(left: Axes, right: Axes) -> None:
    """Draw the possible shift of a datum hole 12 H7."""
    zone = datum_shift("12 H7")
    section(left, zone, 3, 4)
    left.set_aspect("equal")
    sizes = np.linspace(0, 18, 19)
    radius = zone.support(np.eye(6)[3]) * 1e6 * zone.growth(sizes / 18)
    right.fill_between(sizes, -radius, radius, color=BLUE, alpha=0.25)
    right.set(xlabel="datum hole larger by [µm]", ylabel="shift TX [µm]")


def datum_order(left: Axes, right: Axes) -> None:
    """Draw a plate with a hole, whose face B is not perpendicular to face A."""
    tilt = plane_orientation(50e-6, 0.060, 0.040).support(np.eye(6)[1])
    large = 60 * tilt  # the angle is magnified by 60
    turns = np.eye(2), np.array([[1.0, -large], [large, 1.0]])
    outer = np.array([[0, 0], [110, 0], [110, 60], [0, 60], [0, 0]])
    side = np.array([[0, 0], [-60 * large, 60]])
    for panel, title, turn in zip((left, right), ("A|B", "B|A"), turns, strict=True):
        panel.plot(*(outer @ turn).T, color="0.6", lw=1)
        panel.plot(*(side @ turn).T, color=RED, lw=1.5)
        hole = np.array([80.0, 30.0]) @ turn
        panel.plot(80, 30, "k+", ms=8)
        panel.plot(*hole, "o", color=BLUE, mfc="none", ms=8)
        moved = (30.0 - hole[1]) / 60 * 1e3
        panel.set_title(f"{title}: hole moves by {moved:.1f} µm", fontsize=8)
        panel.set(aspect="equal", xlabel="[mm], 60 times the angle", ylim=(-12, 68))
        panel.text(-6, 40, "B", color=RED, fontsize=8, ha="right")
        panel.text(55, -9, "A", fontsize=8)


def form(left: Axes, right: Axes) -> None:
    """Draw the clearance of a fit with and without form errors."""
    for y, text in enumerate(("12 H7/g6", "12 H7/g6 + 5 um")):
        least, most = parse_fit(text).radial
        left.barh(y, (most - least) * 1e6, left=least * 1e6, height=0.4, color=BLUE)
    left.set(yticks=(0, 1), xlabel="radial clearance [µm]", ylim=(-0.5, 1.5),
             xlim=(0, 25))  # fmt: skip
    left.set_yticklabels(("perfect form", "cylindricity 0.01"), fontsize=7)
    x = np.linspace(0, 40, 81)
    wave = 5 * np.sin(2 * np.pi * x / 11) * np.cos(2 * np.pi * x / 37)
    right.fill_between(x, -5, 5, color=GREY)
    right.plot(x, wave, color=BLUE, lw=1)
    right.set(xlabel="along the face [mm]", ylabel="flatness 0.01 [µm]")


def fit(left: Axes, right: Axes) -> None:
    """Draw the limits and the clearance of the fit 12 H7/g6."""
    one = parse_fit("12 H7/g6")
    for y, limits in enumerate((one.hole, one.shaft)):
        width = (limits.upper - limits.lower) * 1e6
        left.barh(y, width, left=limits.lower * 1e6, height=0.4, color=(BLUE, RED)[y])
    left.axvline(0, color="k", lw=0.8)
    left.set(yticks=(0, 1), xlabel="deviation from 12 mm [µm]", ylim=(-0.5, 1.5))
    left.set_yticklabels(("hole H7", "shaft g6"), fontsize=7)
    radial = one.draw(np.random.default_rng(1).random((200_000, 2))) * 1e6
    counts, edges = np.histogram(radial, 60, density=True)
    right.fill_between((edges[1:] + edges[:-1]) / 2, counts, color=BLUE, alpha=0.25)
    right.set(xlabel="radial clearance [µm]", ylabel="density [1/µm]")


def general(left: Axes, right: Axes) -> None:
    """Draw the general tolerances of lengths."""
    lengths = np.geomspace(3.01, 1000, 400)
    for panel, classes in ((left, "fm"), (right, "cv")):
        for kind in classes:
            values = [linear_tolerance(mm * 1e-3, kind) * 1e3 for mm in lengths]
            panel.loglog(lengths, values, lw=1, label=f"ISO 2768-{kind}")
        panel.set(xlabel="length [mm]", ylabel="± [mm]")
        for ticks in (panel.xaxis, panel.yaxis):
            ticks.set_major_formatter("{x:g}")
            ticks.set_minor_formatter("")
        panel.legend(fontsize=6)


_POSITION = axis_position(50e-6, LENGTH)
PICTURES: dict[str, Callable[[Axes, Axes], None]] = {
    "axis_position": of_axis(_POSITION, 50e-6),
    "axis_position_direction": of_axis(
        axis_position_along(50e-6, LENGTH, ALONG), 50e-6, (3, 4)
    ),
    "axis_orientation": of_axis(axis_orientation(20e-6, LENGTH), None),
    "axis_both": of_axis(
        intersection([_POSITION, axis_orientation(20e-6, LENGTH)]), 50e-6
    ),
    "face_profile": of_face(plane_position(50e-6, *SIZES), 50e-6),
    "face_orientation": of_face(plane_orientation(20e-6, *SIZES), 20e-6, (0, 1)),
    "round_face_profile": of_face(round_plane_position(50e-6, SIZES[0]), 50e-6),
    "round_face_orientation": of_face(
        round_plane_orientation(20e-6, SIZES[0]), 20e-6, (0, 1)
    ),
    "point_position": point,
    "length": length,
    "general": general,
    "maximum_material": maximum_material,
    "shifting_datum": shifting_datum,
    "datum_order": datum_order,
    "form": form,
    "fit": fit,
}


def main(folder: str) -> None:
    """Write the pictures."""
    style = {"svg.fonttype": "none", "svg.hashsalt": "callouts", "font.size": 8,
             "path.simplify": True}  # fmt: skip
    Path(folder).mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        with plt.rc_context(style):
            figure, panels = plt.subplots(
                1, 2, figsize=(4.6, 1.9), layout="constrained"
            )
            draw(*panels)
            figure.savefig(
                Path(folder) / f"{name}.svg", metadata={"Date": None, "Creator": None}
            )
            plt.close(figure)


if __name__ == "__main__":
    main(sys.argv[1])
