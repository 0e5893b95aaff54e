"""Create the report page of ISO 9283 and ISO 230-2 characteristics."""

from dataclasses import asdict

import numpy as np

from forcefit.page.charts import Axis, bars, grid
from forcefit.page.page import Page, Provenance, Tile, page, paragraph, section
from forcefit.page.tables import Cell, Column, Value, table
from forcefit.validation.standards.figures import PoseFigures, StandardFigures

CYCLES = 30  # number of cycles that ISO 9283 requires for each pose
_LISTED = 20  # largest number of poses in a chart
_ASSUMED = (
    "Every set of repeats is evaluated separately for each load and side of approach.",
    "No tolerance is stated, so the characteristics are neither good nor bad.",
    "With an unknown registration, AP includes the position of the measuring device.",
)
_AXIS_WORDS = {
    "reversal": "reversal B", "repeatability": "repeatability R",
    "systematic_deviation": "systematic deviation E", "mean_deviation": "range M",
    "accuracy": "accuracy A",
}  # fmt: skip
Cells = list[list[Cell]]


def standards_page(figures: StandardFigures, provenance: Provenance) -> str:
    """Create the report page of a campaign's characteristics.

    Args:
        figures: result of
            :func:`forcefit.validation.standards.figures.standard_figures`.
        provenance: command and input files.

    Returns:
        A self-contained HTML page.
    """
    reservations = _reservations(figures)
    return page(
        Page(
            title=f"ISO 9283 and ISO 230-2: {figures.campaign}",
            verdict="; ".join([_verdict(figures), *reservations]) + ".",
            good=None if reservations else True,
            tiles=_tiles(figures),
            about=f"{len(figures.poses)} poses with repeats, {len(figures.distances)} "
            f"distances, registration {figures.registration}.",
            body=[_poses(figures), _distances(figures), _axes(figures)],
            assumed=_ASSUMED,
            provenance=provenance,
            results=figures.table(),
        )
    )


def _verdict(figures: StandardFigures) -> str:
    """Return a sentence with the worst accuracy and repeatability over all poses."""
    worst = [
        f"{words} {Value(max(known), unit).text}"
        for words, unit, known in (
            ("accuracy AP", "m", _known(figures, "accuracy")),
            ("repeatability RP", "m", _known(figures, "repeatability")),
        )
        if known
    ]
    if not worst:
        return f"No position was measured twice at any of {len(figures.poses)} poses"
    return f"Worst of {len(figures.poses)} poses: {' and '.join(worst)}"


def _known(figures: StandardFigures, key: str) -> list[float]:
    """Return the values of a characteristic at the poses where it is known."""
    values = [getattr(pose, key) for pose in figures.poses]
    return [value for value in values if value is not None]


def _reservations(figures: StandardFigures) -> list[str]:
    """Return phrases on the limitations of the characteristics."""
    found = []
    fewest = min(pose.cycles for pose in figures.poses)
    if fewest < CYCLES:
        found.append(f"a pose has {fewest} cycles, ISO 9283 requires {CYCLES}")
    if figures.registration == "unknown":
        found.append("AP includes the unknown position of the measuring device")
    return found


def _tiles(figures: StandardFigures) -> list[Tile]:
    """Return tiles for the worst pose, the worst distance and the worst reversal."""
    tiles = []
    for key, words in (("accuracy", "Pose accuracy AP"),
                       ("repeatability", "Pose repeatability RP")):  # fmt: skip
        known = [one for one in figures.poses if getattr(one, key) is not None]
        if known:
            worst = max(known, key=lambda one: getattr(one, key))
            size, at = Value(getattr(worst, key), "m"), f"at {worst.label}, "
            tiles.append(
                Tile(f"{words}, worst", [size], [f"{at}{worst.cycles} cycles."])
            )
    if figures.distances:
        far = max(figures.distances, key=lambda pair: abs(pair.accuracy))
        a, b = far.labels
        commanded = Value(far.commanded, "m")
        tiles.append(Tile("Distance accuracy AD, worst", [Value(far.accuracy, "m")],
                          [f"{a} to {b}, ", commanded, "."]))  # fmt: skip
    return tiles + [
        Tile("Reversal B, worst", [Value(axes[name].reversal, unit)], [f"of {name}."])
        for kind, unit in (("r", "rad"), ("t", "m"))
        if (axes := {k: v for k, v in figures.axes.items() if k[0] == kind})
        for name in [max(axes, key=lambda one: axes[one].reversal)]
    ]


def _poses(figures: StandardFigures) -> str:
    """Return charts and a table of the ISO 9283 characteristics at every pose."""
    turns = [f"{kind} about {axis}" for kind in ("AP", "RP") for axis in "xyz"]
    head: list[str | Column] = [
        "pose", Column("cycles"), *(Column(name, "rad") for name in turns),
        Column("accuracy AP", "m"), Column("repeatability RP", "m"),
        Column("drift of AP", "m"),
    ]  # fmt: skip
    rows: Cells = [
        [one.label, float(one.cycles), *_angles(one),
         *(_number(v) for v in (one.accuracy, one.repeatability, one.drift))]
        for one in figures.poses
    ]  # fmt: skip
    charts = []
    for key, words in (("accuracy", "accuracy AP"), ("repeatability", "RP")):
        sizes = {
            p.label: v for p in figures.poses if (v := getattr(p, key)) is not None
        }
        most = dict(sorted(sizes.items(), key=lambda item: -item[1])[:_LISTED])
        if most:
            caption = f"The largest {len(most)} of {len(sizes)} poses."
            charts.append(bars(most, Axis(words, "m"), caption, np.nan))
    return section("Poses, ISO 9283", grid(*charts), table(head, rows, "poses"))


def _angles(pose: PoseFigures) -> list[float]:
    """Return AP and RP of the three angles, or NaN if no rotation was measured."""
    return [*(pose.angles or [np.nan] * 3), *(pose.angle_repeatability or [np.nan] * 3)]


def _number(value: float | None) -> float:
    """Convert None to NaN."""
    return np.nan if value is None else value


def _distances(figures: StandardFigures) -> str:
    """Return a table of the distances between poses, or an empty string."""
    rows: Cells = [
        [f"{a} to {b}", one.commanded, one.accuracy, one.repeatability]
        for one in figures.distances
        for a, b in [one.labels]
    ]
    head: list[str | Column] = [
        "poses", Column("commanded", "m"), Column("accuracy AD", "m"),
        Column("repeatability RD", "m"),
    ]  # fmt: skip
    if not rows:
        return ""
    return section("Distances, ISO 9283", table(head, rows, "distances"))


def _axes(figures: StandardFigures) -> str:
    """Return a table of the ISO 230-2 characteristics, or an empty string."""
    if not figures.axes:
        return ""
    rows: Cells = []
    for name, axis in figures.axes.items():
        unit, values = "rad" if name.startswith("r") else "m", asdict(axis)
        rows.append([name, *(Value(values[key], unit) for key in _AXIS_WORDS)])
    text = paragraph("Components approached from both directions, coverage factor 2.")
    head = ["reading", *_AXIS_WORDS.values()]
    return section("Axes, ISO 230-2", text, table(head, rows, "axes"))
