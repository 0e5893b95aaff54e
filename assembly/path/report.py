"""Figure and HTML report of the errors along a path."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.statuses import OK
from forcefit.assembly.path.path_errors import PathErrors
from forcefit.assembly.path.summary import LARGEST, LAWS, LEAST_PERIODS, sizes
from forcefit.inputs.errors import plot_label
from forcefit.page.charts import COLOURS, Axis, chart, grid
from forcefit.page.page import Page, Provenance, Tile, listed, page, section
from forcefit.page.tables import Value, table
from forcefit.stiffness.screws import SCREW

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ASSUMED = (
    "Quasi-static model, in which inertia and weight act as loads at each instant. "
    "Vibration, damping and inertial forces due to the deflection are neglected.",
    "Control errors of the drives are neglected.",
    "The accelerations are those of the rigid nominal robot. The mass of a beam is "
    "distributed along the beam.",
    "The model is linear in errors and deflections.",
)


def plot_path(errors: PathErrors) -> "Figure":
    """Plot deflection, rotation, drive forces and acceleration over time.

    Args:
        errors: errors along a path.

    Returns:
        The figure.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True).ravel()
    times, arrays = errors.trajectory.times, errors.arrays
    screws = 1e3 * errors.inertial
    for k in range(3):
        panels[0].plot(times, screws[:, 3 + k], label=SCREW[3 + k])
        panels[1].plot(times, screws[:, k], label=SCREW[k])
    for name, force in zip(errors.drives, arrays["drive_force"].T, strict=True):
        panels[2].plot(times, force, label=plot_label(name))
    panels[3].plot(times, sizes(errors)["acceleration"])
    for panel, words in zip(
        panels,
        ("deflection due to acceleration [mm]", "rotation due to acceleration [mrad]",
         "drive force [N m or N]", "acceleration of the platform [m/s²]"),
        strict=True,
    ):  # fmt: skip
        panel.set_ylabel(words)
    for panel in panels[:3]:
        panel.legend(fontsize="small")
    for panel in panels[2:]:
        panel.set_xlabel("time [s]")
    figure.suptitle(plot_label(errors.robot.name))
    return figure


def path_page(
    summary: Mapping[str, Any], errors: PathErrors, provenance: Provenance
) -> str:
    """Return the HTML report of the results along a path.

    Args:
        summary: result of :func:`forcefit.assembly.path.summary.path_summary`.
        errors: the errors along the path.
        provenance: the command and its input files.

    Returns:
        HTML without references to other files.
    """
    peaks = summary.get("largest", {})
    return page(
        Page(
            title=f"{summary['robot']}: errors along a path",
            verdict=_verdict(summary),
            good=_good(summary),
            tiles=_tiles(summary),
            about=f"{summary['points']} instants, {summary['solved']} solved; law of "
            f"the motion: {LAWS.get(summary['law'], summary['law'])}.",
            body=[
                section("Largest values", _largest(summary)) if peaks else "",
                section("Over time", *_charts(errors)) if peaks else "",
                section("Notes", listed([f"{one}." for one in summary["remarks"]]))
                if summary["remarks"]
                else "",
            ],
            assumed=_ASSUMED,
            provenance=provenance,
            results=summary,
        )
    )


def _good(summary: Mapping[str, Any]) -> bool | None:
    """Return True if a path can be followed, None if vibration may be significant."""
    if summary["status"] != OK:
        return False
    periods = summary["periods"] or 0.0
    return True if LEAST_PERIODS <= periods < np.inf else None


def _verdict(summary: Mapping[str, Any]) -> str:
    """Return the conclusion on the errors along a path as a sentence."""
    if "largest" not in summary:
        return f"No point has a result: {summary.get('reason', summary['status'])}."
    peak = summary["largest"].get("inertial_translation")
    if peak is None:
        verdict = (
            "The deflection due to acceleration is unknown, because the robot has no "
            "equilibrium at rest"
        )
    else:
        size = Value(peak["value"], "m").text
        verdict = f"The deflection due to acceleration is at most {size}"
    if _good(summary) is None:
        verdict += "; the neglected vibration may exceed this value"
    if summary["status"] != OK:
        verdict += f"; {summary['status']} {summary.get('reason', '')}"
    return verdict + "."


def _tiles(summary: Mapping[str, Any]) -> list[Tile]:
    """Return tiles on deflection, drive force and duration in natural periods."""
    tiles = []
    for key in ("inertial_rotation", "inertial_translation", "stress"):
        peak = summary.get("largest", {}).get(key)
        if peak is not None:
            words, unit, _ = LARGEST[key]
            note: list[str | Value] = ["at ", Value(peak["time"], "s")]
            tiles.append(Tile(f"Largest {words}", [Value(peak["value"], unit)], note))
    if summary["periods"] is not None and np.isfinite(summary["periods"]):
        periods: list[str | Value] = [
            f"of {summary['first_frequency']:.4g} Hz; with less than "
            f"{LEAST_PERIODS:g} periods, vibration is significant."
        ]
        tiles.append(Tile("Periods", [f"{summary['periods']:.3g}"], periods))
    return tiles


def _largest(summary: Mapping[str, Any]) -> str:
    """Return a table of the largest values and drive forces."""
    rows = [
        [LARGEST[key][0], Value(peak["value"], LARGEST[key][1]),
         Value(peak["time"], "s"), peak.get("frame", "")]
        for key, peak in summary["largest"].items()
    ]  # fmt: skip
    rows += [
        [
            f"drive {name}",
            Value(peak["value"], peak["unit"]),
            Value(peak["time"], "s"),
            "",
        ]
        for name, peak in summary["drives"].items()
    ]
    return table(["quantity", "largest", "at", "body"], rows, "largest values")


def _charts(errors: PathErrors) -> list[str]:
    """Return charts of deflection, rotation, drive forces and acceleration."""
    screws = errors.inertial.T
    forces = dict(zip(errors.drives, errors.arrays["drive_force"].T, strict=True))
    of_size = sizes(errors)
    return [
        grid(
            _chart(errors, dict(zip(SCREW[:3], screws[:3], strict=True)), "rad",
                   "rotation due to acceleration"),
            _chart(errors, dict(zip(SCREW[3:], screws[3:], strict=True)), "m",
                   "deflection due to acceleration"),
        ),
        grid(
            _chart(errors, forces, "N m or N", "drive force"),
            _chart(errors, {"acceleration": of_size["acceleration"]}, "m/s^2",
                   "acceleration of the platform"),
        ),
    ]  # fmt: skip


def _chart(
    errors: PathErrors, lines: Mapping[str, NDArray], unit: str, title: str
) -> str:
    """Return a chart of lines over time."""
    traces = [
        {"type": "scatter", "mode": "lines", "x": errors.trajectory.times, "y": values,
         "name": name, "line": {"color": COLOURS[k % len(COLOURS)]}}
        for k, (name, values) in enumerate(lines.items())
    ]  # fmt: skip
    caption = f"{title[0].upper()}{title[1:]}."
    return chart(traces, Axis("time", "s"), Axis(title, unit), caption)
