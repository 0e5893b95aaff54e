"""Compute deflection, stiffness and natural frequencies of a robot under load.

The table ``[service]`` of a study file requests these results.  They are computed at
the pose of the study. If the study contains a grid of poses, they are additional
variables of the maps.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.effects.robot_effects import AppliedEffects
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import OK
from forcefit.assembly.platform_stiffness.vibration import check_masses
from forcefit.assembly.report.results import solution_of
from forcefit.assembly.report.vibration import vibration_of
from forcefit.assembly.sweeps.plan import Sweep
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.sweep import sweep_in_memory
from forcefit.assembly.sweeps.targets import grid_targets
from forcefit.inputs.table import BadInput, Table

if TYPE_CHECKING:
    import xarray

_MODES = 1000  # largest accepted number of frequencies
_KEPT = ("stiffness", "eigen_stiffness", "stiffness_condition", "share", "frequency")


@dataclass(frozen=True, eq=False)
class Service:
    """Results requested for the robot under load.

    Attributes:
        load: (6,) [N m, N] load on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] gravity in base axes.
        stiffness: whether to compute the stiffness along each axis over the grid.
        frequencies: number of natural frequencies to compute.
    """

    load: NDArray
    gravity: NDArray
    stiffness: bool
    frequencies: int

    @property
    def loaded(self) -> bool:
        """Whether a load or gravity acts on the robot."""
        return bool(self.load.any() or self.gravity.any())


def read_service(root: Table, robot: Robot, links: bool = True) -> Service | None:
    """Return the table ``[service]`` of a study file, or None if it is absent.

    Args:
        root: root table of the file.
        robot: robot of the study.
        links: whether the stiffness and mass of meshed links are computed.

    Returns:
        The requested results.

    Raises:
        BadInput: the table is invalid, or requests frequencies of a robot without mass.
    """
    if not root.has("service"):
        return None
    table = root.table("service")
    service = Service(
        table.array("load", (6,), "N m, N", np.zeros(6)),
        table.array("gravity", (3,), "m/s^2", np.zeros(3)),
        table.boolean("stiffness", False),
        table.integer("frequencies", 0),
    )
    table.finish()
    if service.frequencies > _MODES:
        raise table.bad(
            "frequencies", f"found {service.frequencies}, expected at most {_MODES}"
        )
    if service.frequencies and links:
        try:
            check_masses(robot)
        except BadInput as error:
            raise table.bad("frequencies", str(error)) from None
    return service


def at_pose(
    applied: AppliedEffects, service: Service, unloaded: Mapping
) -> dict[str, Any]:
    """Return the results for the robot under load at a pose.

    Args:
        applied: the robot's configuration, load and gravity after applying effects.
        service: the requested results.
        unloaded: solution without loads, with the keys of ``assembly solve``.

    Returns:
        Mapping with ``status``, ``reason`` on failure, ``load``, ``gravity``, and
        ``frequencies`` with the keys of ``assembly frequencies``.  With a load or
        gravity, it also contains ``solution`` with the keys of ``assembly solve``, and
        ``deflection`` (6,), the difference of the platform screws with and without
        loads.
    """
    posture = applied.posture
    found: dict[str, Any] = {
        "status": OK, "load": service.load, "gravity": service.gravity
    }  # fmt: skip
    if service.loaded:
        solution = solution_of(posture, applied.load, applied.gravity)
        found |= {"solution": solution, "status": solution["status"]}
        if "reason" in solution:
            found["reason"] = solution["reason"]
        if None not in {solution["energy"], unloaded["energy"]}:
            with_loads, without = (
                np.asarray(one["platform_screw"]) for one in (solution, unloaded)
            )
            found["deflection"] = with_loads - without
    if service.frequencies:
        found["frequencies"] = vibration_of(posture, service.frequencies)
    return found


def over_grid(
    maps: "xarray.Dataset", robot: Robot, service: Service,
    grid: Mapping[str, NDArray], progress: Callable[[int, int], None],
) -> "xarray.Dataset":  # fmt: skip
    """Add maps of the robot under load to the maps of a study.

    Args:
        maps: maps without loads.
        robot: robot of the study.
        service: the requested results.
        grid: axes of the maps.
        progress: function called with the number of finished points and the number of
            all points.

    Returns:
        The maps with ``deflection`` as in :func:`at_pose`, ``loaded_status``, and, if
        requested, ``stiffness`` and ``frequency``.
    """
    targets = grid_targets(grid)
    question = Question(
        robot, components=targets.names, load=tuple(service.load),
        gravity=tuple(service.gravity), frequencies=service.frequencies,
        stiffness="nominal" if service.stiffness else "",
    )  # fmt: skip
    data = sweep_in_memory(Sweep(question, targets), progress)
    new = {name: data[name] for name in _KEPT if name in data}
    if service.loaded:
        moved = data["platform_screw"] - maps["platform_screw"]
        new["deflection"] = moved.assign_attrs(
            units="rad, m", long_name="platform screw with load and weight minus "
            "without, minimum-energy solution",
        )  # fmt: skip
        new["loaded_status"] = data["status"]
    return maps.assign(new)
