"""3D scenes of robots with geometric errors, and maps of margins over postures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.model.statuses import OUT_OF_REACH
from forcefit.assembly.report.scene import robot_scene
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.statistics.experiment import Experiment
from forcefit.assembly.statistics.plot import NAMES
from forcefit.assembly.steps.bolted import bolt_generators, bolt_joints
from forcefit.page.charts import Axis, Layer, value_map

if TYPE_CHECKING:
    import xarray
    from numpy.typing import ArrayLike

_QUANTILE = 0.95
_CAPTION = (
    "Nominal (grey) and forced robot. Red: elastic links; blue: rigid bodies; orange: "
    "driven joints."
)


def drawn_robot(experiment: Experiment, data: "xarray.Dataset") -> str:
    """Show the robot in the draw whose pose error is closest to the 95 % quantile.

    Args:
        experiment: experiment that produced the draws.
        data: data set of all draws.

    Returns:
        HTML of a scene with the assembled robot; empty if no draw can be assembled.
    """
    solved = data["status"].values == 0
    for key in ("translation", "energy"):
        values = np.where(solved, data[key].values, np.nan)
        known = np.isfinite(values)
        if known.any():
            break
    else:
        return ""
    level = float(np.quantile(values[known], _QUANTILE))
    draw = int(np.nanargmin(np.abs(np.where(known, values, np.nan) - level)))
    drawn = experiment.sources.draw(draw, 1, experiment.seed)
    errors = experiment.sources.errors(drawn)[0]
    robot = experiment.posture.robot.with_errors(errors)
    rngs = bolt_generators(robot, experiment.seed, [draw])
    robot = bolt_joints(robot, None if rngs is None else rngs[0])
    return _forced_robot(
        replace(experiment.posture, robot=robot), experiment.wrench, experiment.gravity,
        why=f"Draw {draw}, whose {NAMES[key]} is closest to the 95 % quantile.",
    )  # fmt: skip


def tightest_robot(postures: Sequence[Posture], present: Mapping[str, Any]) -> str:
    """Show a robot with its geometric errors at the posture of the largest margin.

    Args:
        postures: the assessed postures.
        present: result of
            :func:`forcefit.assembly.statistics.tolerances.present_errors`.

    Returns:
        HTML of a scene with the assembled robot; empty if it cannot be assembled.
    """
    worst = postures[int(np.nanargmax(present["margins"]))]
    why = "Posture of the largest margin, with the errors in the robot file."
    return _forced_robot(worst, why=why)


def _forced_robot(
    posture: Posture,
    load: "ArrayLike | None" = None,
    gravity: "ArrayLike | None" = None,
    *,
    why: str,
) -> str:
    """Return the scene of an assembled robot, or an empty text without a solution."""
    try:
        forced = solve_assembly(posture, load, gravity=gravity)
    except (CannotAssemble, SolverFailed):
        return ""
    return robot_scene(forced, None, None, f"{_CAPTION} {why}")


def margin_map(postures: Sequence[Posture], present: Mapping[str, Any]) -> str:
    """Plot margins over a grid of postures as an HTML map.

    Args:
        postures: the assessed postures.
        present: result of
            :func:`forcefit.assembly.statistics.tolerances.present_errors`.

    Returns:
        HTML of the map; empty unless the grid has one or two axes.
    """
    poses = [posture.pose() for posture in postures]
    values = {name: np.array([pose[name] for pose in poses]) for name in poses[0]}
    varied = {name: v.round(9) for name, v in values.items() if np.ptp(v) > 1e-9}
    if not 1 <= len(varied) <= 2:
        return ""
    ticks = {name: np.unique(v) for name, v in varied.items()}
    at = tuple(np.searchsorted(ticks[name], v) for name, v in varied.items())
    margins = np.full([len(v) for v in ticks.values()], np.nan)
    margins[at] = present["margins"]
    states = np.full(margins.shape, OUT_OF_REACH, dtype=object)
    states[at] = np.where(
        np.asarray(present["margins"]) <= 1.0, "assembles", "needs force"
    )
    axes = [
        (Axis(name, "m" if name.startswith("t") else "rad"), v)
        for name, v in ticks.items()
    ]
    title = f"{NAMES[present['quantity']]}, eq. (21)"
    layer = Layer("margin", title, "", margins)
    caption = "Up to a margin of 1, the robot assembles by clearances alone."
    return value_map(axes, [layer], states.astype(str), caption)
