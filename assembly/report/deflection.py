"""Load-deflection curves as a dictionary, as text and as a figure."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import CannotAssemble, failure_status
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.platform_stiffness.arc_length import follow_load
from forcefit.assembly.platform_stiffness.deflection import (
    DeflectionCurve,
    Progress,
    deflection_curve,
)
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.inputs.errors import plot_label
from forcefit.results.display import listing, rounded
from forcefit.results.text import lines_of, table_lines
from forcefit.stiffness.screws import SCREW, WRENCH

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ROWS = 25  # largest number of rows in the text table


def deflection_of(
    posture: Posture,
    component: int,
    loads: Sequence[float],
    load: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    state: Literal["contact", "exact"] = "contact",
    follow: bool = False,
    progress: Progress = lambda what, done, most: None,
) -> dict[str, Any]:
    """Compute a load-deflection curve as a dictionary.

    Args:
        posture: posture of the robot.
        component: index of the load component that varies, 0 to 5.
        loads: [N m or N] values of this component, in order.
        load: (6,) [N m, N] constant load on the platform.
        gravity: (3,) [m/s^2] gravity in base axes.
        state: ``"exact"`` for finite rotations, ``"contact"`` for the linear model.
        follow: whether to use an arc-length method, which passes limit points, from the
            first to the last load. The state is then ``"exact"``, and clearances are
            zero.
        progress: function called with the name of the computation, the number of
            finished steps and the largest number of steps.

    Returns:
        The curve and its events. ``status`` is ``"ok"`` or the type of failure.
    """
    results: dict[str, Any] = {
        "robot": posture.robot.name, "status": "ok", "pose": posture.pose(),
        "along": WRENCH[component].lower(), "state": "exact" if follow else state,
        "followed": follow,
    }  # fmt: skip
    try:
        if follow:
            curve = follow_load(
                posture, component, loads[0], loads[-1], load, gravity, len(loads) - 1,
                progress,
            )  # fmt: skip
        else:
            curve = deflection_curve(
                posture, component, loads, load, gravity, state, progress
            )
    except (CannotAssemble, FreeMotion, SolverFailed) as error:
        return results | {"status": failure_status(error), "reason": str(error)}
    return results | _curve_values(curve)


def _curve_values(curve: DeflectionCurve) -> dict[str, Any]:
    """Convert a load-deflection curve to a dictionary."""
    return {
        "loads": curve.loads,
        "deflection": curve.deflection,
        "platform_screw": curve.screws,
        "energy": curve.energies,
        "stiffness": curve.stiffness,
        "contacts": [sorted(names) for names in curve.pressed],
        "free_in_clearances": curve.open_,
        "events": [vars(event) for event in curve.events],
    }


def deflection_text(results: dict[str, Any]) -> str:
    """Format a curve as a text table, followed by its events."""
    head = listing(results["robot"], lines_of(results, "pose status reason state"))
    if "loads" not in results:
        return head
    component = [name.lower() for name in WRENCH].index(results["along"])
    turns = component < 3
    units = ("N m", "mrad", "N m/rad") if turns else ("N", "mm", "N/m")
    columns = (
        f"{results['along']} [{units[0]}]", f"{SCREW[component]} [{units[1]}]",
        f"stiffness [{units[2]}]", "contacts", "",
    )  # fmt: skip
    count = len(results["loads"])
    chosen = sorted({round(k) for k in np.linspace(0, count - 1, min(count, _ROWS))})
    rows = {
        str(i): (
            results["loads"][i], rounded(1e3 * results["deflection"][i]),
            results["stiffness"][i], len(results["contacts"][i]),
            "within clearances" if results["free_in_clearances"][i] else "",
        )
        for i in chosen
    }  # fmt: skip
    lines = [head, *table_lines(("step", *columns), rows, digits=6)]
    for event in results["events"]:
        at = f"{event['load']:.6g} {units[0]}"
        lines.append(f"{event['kind']} at {at}: {event['what']}")
    return "\n".join(lines)


def plot_deflection(results: dict[str, Any]) -> "Figure":
    """Plot load over deflection, with marks at events.

    Args:
        results: result of :func:`deflection_of`.

    Returns:
        The figure.
    """
    from matplotlib.figure import Figure

    component = [name.lower() for name in WRENCH].index(results["along"])
    turns = component < 3
    figure = Figure(figsize=(6.0, 4.5), layout="constrained")
    axes = figure.subplots()
    moved, loads = 1e3 * np.asarray(results["deflection"]), results["loads"]
    axes.plot(moved, loads, ".-")
    for event in results["events"]:
        axes.plot([1e3 * event["deflection"]], [event["load"]], "x", color="black")
    axes.set_xlabel(f"{SCREW[component]} [{'mrad' if turns else 'mm'}]")
    axes.set_ylabel(f"{results['along']} [{'N m' if turns else 'N'}]")
    axes.set_title(plot_label(str(results["robot"])))
    return figure
