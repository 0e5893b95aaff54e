"""The robot at work: its platform under load and weight, its stiffness, frequencies.

A study file asks for them under ``[service]``.  At the study's pose they are answered
in full; over the grid they are further variables of the maps.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.posture import Posture
from assembly.model.robot import Robot
from assembly.model.statuses import OK
from assembly.platform_stiffness.vibration import check_masses
from assembly.report.results import solution_of
from assembly.report.vibration import vibration_of
from assembly.sweeps.plan import Sweep
from assembly.sweeps.quantities import Question
from assembly.sweeps.sweep import sweep_in_memory
from assembly.sweeps.targets import grid_targets
from forcefit.inputs.table import BadInput, Table

if TYPE_CHECKING:
    import xarray

_MODES = 1000  # that can be asked for, as on the command line
_KEPT = ("stiffness", "eigen_stiffness", "stiffness_condition", "share", "frequency")


@dataclass(frozen=True, eq=False)
class Service:
    """What a study asks of the robot at work.

    Attributes:
        load: (6,) [N m, N] on the platform at its origin, base axes.
        gravity: (3,) [m/s^2] base axes.
        stiffness: whether over the grid too, along each axis.
        frequencies: how many natural frequencies.
    """

    load: NDArray
    gravity: NDArray
    stiffness: bool
    frequencies: int

    @property
    def loaded(self) -> bool:
        """Whether there is a load or weight."""
        return bool(self.load.any() or self.gravity.any())


def read_service(root: Table, robot: Robot) -> Service | None:
    """Return the table ``[service]`` of a study file; None where there is none.

    Args:
        root: of the file.
        robot: of the study.

    Returns:
        What is asked.

    Raises:
        BadInput: it breaks a rule, or asks for frequencies of what has no mass.
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
    if service.frequencies:
        try:
            check_masses(robot)
        except BadInput as error:
            raise table.bad("frequencies", str(error)) from None
    return service


def at_pose(posture: Posture, service: Service, unloaded: Mapping) -> dict[str, Any]:
    """Return the robot at work at one pose.

    Args:
        posture: of the robot.
        service: what is asked.
        unloaded: its solution without loads, keys of ``assembly solve``.

    Returns:
        ``status`` and perhaps ``reason``; ``load`` and ``gravity``; where they are not
        zero ``solution``, the keys of ``assembly solve`` under them, and
        ``deflection``, (6,) the platform's screw with them minus without, clearances
        at least energy; ``frequencies``, keys of ``assembly frequencies``.
    """
    found: dict[str, Any] = {
        "status": OK, "load": service.load, "gravity": service.gravity
    }  # fmt: skip
    if service.loaded:
        solution = solution_of(posture, service.load, service.gravity)
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
    """Return the maps of a study with those of the robot at work.

    Args:
        maps: without loads.
        robot: of the study.
        service: what is asked.
        grid: axes of the maps.
        progress: called with the number of points done, and of all.

    Returns:
        The maps with ``deflection``, as in :func:`at_pose`, and ``loaded_status``;
        with ``stiffness`` and its further variables, and ``frequency``.
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
            units="rad, m", long_name="platform's screw with load and weight minus "
            "without, clearances at least energy",
        )  # fmt: skip
        new["loaded_status"] = data["status"]
    return maps.assign(new)
