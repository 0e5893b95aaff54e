"""Errors along a path as an xarray data set over time."""

from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from forcefit.assembly.kinematics.nominal import mobile
from forcefit.assembly.kinematics.posture import POSE, pose_components
from forcefit.assembly.model.link_stress import stressed_links
from forcefit.assembly.sweeps.identity import program_hash, robot_hash
from forcefit.results.quantities import LABELS, QUANTITIES

if TYPE_CHECKING:
    import xarray

    from forcefit.assembly.path.path_errors import PathErrors


def path_dataset(errors: "PathErrors", command: str = "") -> "xarray.Dataset":
    """Return the errors along a path as a data set.

    Args:
        errors: errors along a path.
        command: command line for the provenance, or an empty string.

    Returns:
        Data set over ``time`` that includes the unit and meaning of each variable.  Its
        attributes include the robot, the profile and the program.
    """
    import xarray

    robot, arrays = errors.robot, errors.arrays
    moves = mobile(robot)
    names = [frame.name for frame in robot.frames]
    values: dict[str, Any] = {
        name: arrays[name]
        for name in (
            "platform_velocity", "platform_acceleration", "platform_screw",
            "inertial_screw", "energy", "wrench", "drive_force", "stress", "compliance",
            "rotation_error", "translation_error",
        ) if name in arrays
    }  # fmt: skip
    values |= {
        "joint_coordinate": arrays["coordinates"][:, moves],
        "joint_velocity": arrays["rates"][:, moves],
        "joint_acceleration": arrays["second_rates"][:, moves],
        "pose": pose_components(arrays["platform"]),
        "status": errors.status, "reason": errors.reason,
    }  # fmt: skip
    own = {"wrench": ("frame", "wrench_component"), "stress": ("link",),
           "pose": ("component",)}  # fmt: skip
    data: dict[str, Any] = {}
    labels: dict[str, Any] = {
        "time": ("time", errors.trajectory.times, QUANTITIES["time"].attributes),
        "frame": names, "joint": [n for n, m in zip(names, moves, strict=True) if m],
        "component": list(POSE), "drive": list(errors.drives),
        "link": [link.frame for link in stressed_links(robot)],
    }  # fmt: skip
    for name, value in values.items():
        known = QUANTITIES[name]
        dims = own.get(name, known.dims)
        data[name] = (("time", *dims), np.asarray(value), known.attributes)
        labels |= {dim: list(LABELS[dim]) for dim in dims if dim in LABELS}
    about: dict[str, Any] = {
        "robot": robot.name,
        "robot_sha256": robot_hash(errors.declared),
        "program": f"forcefit {version('forcefit')}",
        "program_sha256": program_hash(),
        "path_law": errors.trajectory.law,
        "assumption": errors.assumption,
        "stiffness_state": errors.state,
        "first_frequency": errors.frequency,
    }
    about |= {"command": command} if command else {}
    return xarray.Dataset(data, labels, about)
