"""Compute statistics and the worst case of drawing tolerances at a study's pose.

The table ``[statistics]`` of a study file overrides the defaults.  In the statistics,
random errors within the tolerances replace the errors of the study file.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from forcefit.assembly.effects.robot_effects import (
    errors_of_effects,
    with_effects_applied,
)
from forcefit.assembly.kinematics.posture import Posture, place_robot
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import OK
from forcefit.assembly.statistics.callout_sources import sources_of
from forcefit.assembly.statistics.experiment import Experiment, precision_for
from forcefit.assembly.statistics.importance_table import ImportanceOptions
from forcefit.assembly.statistics.linear_response import linear_response
from forcefit.assembly.statistics.monte_carlo import run_draws
from forcefit.assembly.statistics.quantities import POSE_ERRORS, UNITS, limit_names
from forcefit.assembly.statistics.summary import summarise
from forcefit.assembly.statistics.worst_pose import bound_worst_pose
from forcefit.assembly.statistics.worst_pose_report import worst_results
from forcefit.inputs.table import BadInput, Table, nearest

if TYPE_CHECKING:
    import xarray

_LEAST_BASE_DRAWS = 16  # smallest number of base draws for Sobol indices
_MOST_DRAWS = 1_000_000
IN_BOUNDS = (
    "tolerances of the drawing and the largest clearances of fits are in the certified "
    "worst case and in the statistics; equation (27), energies and margins use the "
    "errors above alone, and the mean clearance of fits"
)
DRAWN_ERRORS = {key: f"drawn_{key}_error" for key in POSE_ERRORS}
# [-] Relative accuracy of the certified bounds at each map point.
_MAP_TOLERANCE = 1e-3


@dataclass(frozen=True)
class DrawnTolerances:
    """Results requested for the robot's drawing tolerances.

    Attributes:
        draws: number of random machines.
        seed: seed of the random numbers.
        importance: number of base draws for Sobol indices; 0 for no indices.
        limits: mapping from quantity to its limit [rad, m, J, ..].
    """

    draws: int = 1000
    seed: int = 1
    importance: int = 64
    limits: dict[str, float] = field(default_factory=dict)


def read_statistics(root: Table, robot: Robot) -> DrawnTolerances | None:
    """Read the table ``[statistics]`` of a study file.

    Args:
        root: root table of the file.
        robot: robot of the study.

    Returns:
        The requested results.  None if the robot has no drawing tolerances, or if the
        table is absent and the study file contains ``rest`` or ``mismatch``.

    Raises:
        BadInput: the table is invalid, the robot has no tolerances, or the study file
            also contains ``rest`` or ``mismatch``.
    """
    drawn = bool(robot.callouts or robot.fits)
    closing = [key for key in ("rest", "mismatch") if root.has(key)]
    if not root.has("statistics"):
        return DrawnTolerances() if drawn and not closing else None
    if closing:
        fault = f'found this table and "{closing[0]}", which adds other errors'
        raise root.bad("statistics", f"{fault}; expected only one of the two")
    table = root.table("statistics")
    if not drawn:
        fault = "found this table for a robot without fits and [[tolerance]] entries"
        raise root.bad("statistics", f"{fault}, expected no such table")
    draws = _count(table, "draws", 1000, 2)
    importance = _count(table, "importance", 64, 0)
    if 0 < importance < _LEAST_BASE_DRAWS:
        expected = f"expected 0 or at least {_LEAST_BASE_DRAWS}"
        raise table.bad("importance", f"found {importance}, {expected}")
    asked = DrawnTolerances(draws, table.integer("seed", 1), importance, _limits(table))
    table.finish()
    return asked


def _count(table: Table, key: str, default: int, least: int) -> int:
    """Read a number of random draws."""
    value = table.integer(key, default)
    if not least <= value <= _MOST_DRAWS:
        raise table.bad(key, f"found {value}, expected {least} to {_MOST_DRAWS}")
    return value


def _limits(table: Table) -> dict[str, float]:
    """Read the limit of each quantity in SI units."""
    if not table.has("limits"):
        return {}
    given, names = table.table("limits"), limit_names()
    for name in given.content:
        if name not in names:
            fault = f"found a limit of an unknown quantity{nearest(name, names)}"
            raise given.bad(name, fault)
    limits = {name: given.number(name, "SI unit", above=0.0) for name in given.content}
    given.finish()
    return limits


def drawn_at_pose(
    posture: Posture, asked: DrawnTolerances, progress: Callable[[int, int], None]
) -> tuple[dict[str, Any], "xarray.Dataset"]:
    """Return statistics and worst case of parts within the tolerances at a pose.

    Args:
        posture: the declared robot's configuration.  Its geometric errors are not
            used.
        asked: requested results.
        progress: function called with the number of finished draws and the number of
            all draws.

    Returns:
        The summary, with the keys of ``assembly statistics``, and the draws.  If no
        worst case can be computed, ``worst_case_left_out`` contains the reason.

    Raises:
        BadInput: a limit refers to a quantity that is not computed for this robot.
    """
    declared, posture = posture, with_effects_applied(posture)
    fixed = errors_of_effects(declared, posture)
    sources = sources_of(posture.robot, fixed=fixed)
    experiment = Experiment(
        posture, sources, asked.seed, precision=precision_for(asked.limits)
    )
    experiment.check_limits(asked.limits)
    options = None
    if asked.importance:
        options = ImportanceOptions(asked.importance, "source")
    data = run_draws(
        experiment, asked.draws, progress=progress, importance=options
    )  # fmt: skip
    summary = {
        "robot": posture.robot.name, "pose": posture.pose(), "seed": asked.seed,
        "load": None, "gravity": None,
        **summarise(data, asked.limits, capable=bool(asked.limits)),
    }  # fmt: skip
    try:
        worst = {"worst_case": worst_results(experiment.energies, sources, asked.seed)}
    except BadInput as error:
        return summary | {"worst_case_left_out": str(error)}, data
    return summary | worst, data


def bounds_over_grid(
    maps: "xarray.Dataset", robot: Robot, progress: Callable[[int, int], None]
) -> "xarray.Dataset":
    """Add bounds over all parts within tolerance to the maps of a study.

    Args:
        maps: data set over the grid.
        robot: robot of the study, with drawing tolerances or fits.
        progress: function called with the number of finished points and the number of
            all points.

    Returns:
        The maps with certified upper bounds on rotation and translation over all parts
        and clearances.  Bounds are NaN at points without a solution.
    """
    common, axes = sources_of(robot), [str(axis) for axis in maps["status"].dims]
    bounds = np.full((maps["status"].size, len(POSE_ERRORS)), np.nan)
    values = [maps[axis].values for axis in axes]
    points = np.stack(np.meshgrid(*values, indexing="ij"), -1).reshape(-1, len(axes))
    solved = maps["status"].values.ravel() == OK
    for k, point in enumerate(points):
        if solved[k]:
            pose = dict(zip(axes, map(float, point), strict=True))
            declared = place_robot(robot, pose=pose)
            posture = with_effects_applied(declared)
            fixed = errors_of_effects(declared, posture)
            sources = (
                common if fixed is None else sources_of(posture.robot, fixed=fixed)
            )
            prepared = linear_response(posture)
            found = bound_worst_pose(prepared, sources, _MAP_TOLERANCE)[1]
            bounds[k] = [found[key] for key in POSE_ERRORS]
        progress(k + 1, len(points))
    new = {}
    for key, column in zip(POSE_ERRORS, bounds.T, strict=True):
        attributes = {
            "units": UNITS[key],
            "long_name": f"bound of the {key} over all parts within the tolerances",
        }
        shaped = column.reshape(maps["status"].shape)
        new[DRAWN_ERRORS[key]] = (axes, shaped, attributes)
    return maps.assign(new)
