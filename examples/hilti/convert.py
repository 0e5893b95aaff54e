"""Write the robot file and the campaign folders of Hilti's construction robot.

The robot file is derived from the published URDF, whose licence (CC BY-NC-SA 3.0)
applies to it.  It is therefore not part of this repository.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import yaml  # type: ignore[import-untyped]
from numpy.typing import NDArray

from examples.campaign_folder import (
    base_pose,
    data_folder,
    deviation_columns,
    from_command_line,
    write_campaign,
)
from forcefit.assembly.kinematics.nominal import Target, follow
from forcefit.assembly.kinematics.posture import home_posture
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.inputs.table import BadInput
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform

NAME = "hilti_trailblazer"
FILES = ("flat", "pallet", "orthogonal_wood")
# [m] offsets of the column segments, from the README of the data
SEGMENTS = {"column_middle_joint": -0.706, "column_top_joint": -0.736}
ARM = tuple(f"dsr_joint{k}" for k in range(1, 7))
G = 9.80665  # [m/s^2] gravity
SIGMA = 0.75e-3  # [m] sigma of the total station along an axis
STATIONING = ("stationing_measurements", "evaluation_measurements")


def urdf_robot(path: Path, tip: str = "prism") -> Robot:
    """Return the chain of a URDF from its root to a link, which is the platform.

    A link of a URDF begins at its joint, whereas a body of forcefit ends at its joint.
    The mass of a link therefore belongs to the next frame.  Other branches of the URDF
    and their masses are omitted.

    Args:
        path: path of the file.
        tip: name of the last link.

    Returns:
        The robot, in which every movable joint of the chain is actuated.

    Raises:
        BadInput: the axis of a joint is not its z axis.
    """
    root = ET.parse(path).getroot()
    links = {attribute(link, "name"): link for link in root.findall("link")}
    above = {attribute(j, "link", "child"): j for j in root.findall("joint")}
    chain = []
    while tip in above:
        chain.append(above[tip])
        tip = attribute(above[tip], "link", "parent")
    frames, parent = [], "base"
    for joint in reversed(chain):
        name, kind, place = (
            attribute(joint, "name"),
            attribute(joint, "type"),
            _origin(joint),
        )
        inertial = links[attribute(joint, "link", "parent")].find("inertial")
        mass, centre = 0.0, np.zeros(3)
        if inertial is not None:
            mass = float(attribute(inertial, "value", "mass"))
            centre = np.linalg.solve(place, _origin(inertial))[:3, 3]
        if kind != "fixed" and attribute(joint, "xyz", "axis") != "0 0 1":
            raise BadInput(f"{path}: joint {name}: expected its axis to be 0 0 1")
        frames.append(
            Frame(
                name, parent, place[:3, 3], rotation_vector(place[:3, :3]), joint=kind,
                actuated=kind != "fixed", mass=mass, centre_of_mass=centre,
            )
        )  # fmt: skip
        parent = name
    return Robot(attribute(root, "name"), parent, tuple(frames), (), "from a URDF")


def attribute(
    element: ET.Element, key: str, inside: str = "", default: str = ""
) -> str:
    """Return an attribute of an XML element or of its child."""
    found = element.find(inside) if inside else element
    return default if found is None else found.get(key) or default


def _origin(element: ET.Element) -> NDArray:
    """Return the transform, (4, 4), of an ``origin`` (rotations about fixed axes)."""
    xyz = [float(x) for x in attribute(element, "xyz", "origin", "0 0 0").split()]
    rpy = attribute(element, "rpy", "origin", "0 0 0").split()
    r, p, y = (float(x) for x in rpy)
    turn = rotation_matrix([[0, 0, y], [0, p, 0], [r, 0, 0]])
    return transform(xyz, turn[0] @ turn[1] @ turn[2])


def convert(out: Path, data: Path | None = None) -> dict[str, Path]:
    """Write a campaign folder for each file of waypoints.

    Args:
        out: folder of the campaigns.
        data: folder of all data sets.

    Returns:
        The folder of each file.
    """
    source = data_folder(NAME, data)
    robot = urdf_robot(source / "trailblazer.urdf")
    return {file: _convert(robot, source, file, out / file) for file in FILES}


def _convert(robot: Robot, source: Path, file: str, folder: Path) -> Path:
    """Write the campaign folder of one file of waypoints."""
    text = (source / f"{file}.yaml").read_text()
    rows = list(_rows(yaml.load(text, yaml.CSafeLoader)))
    rows.sort(key=lambda row: row["time"])
    joints = np.array([row["joint_states"] for row in rows])
    q = np.zeros((len(rows), len(robot.frames)))
    for name, offset in SEGMENTS.items():
        q[:, robot.index(name)] = 0.5 * joints[:, 0] + offset
    q[:, [robot.index(name) for name in ARM]] = joints[:, 1:]
    home = home_posture(robot).coordinates
    T = follow(robot, home, Target(coordinates=q), guess=True).transforms[:, -1]
    measured = transform([row["prism_position"] for row in rows], T[:, :3, :3])
    columns = {f"q.{n}": q[:, robot.index(n)] for n in (*SEGMENTS, *ARM)}
    columns |= deviation_columns(T, measured, turn=False)
    time = np.array([row["time"] for row in rows])
    columns["cov.time"] = time - time[0]
    for name in ("stationing", "height", "space"):
        columns[f"cov.{name}"] = np.array([float(row[name]) for row in rows])
    # The mean tilt of the base is subtracted, because it is the tilt of the floor.
    rocking = _up(rows, "base") - _up(rows, "base").mean(axis=0)
    lean = _up(rows, "column") - _up(rows, "base")
    for name, up in (("column", lean), ("base", rocking)):
        columns[f"cov.{name}_rx"], columns[f"cov.{name}_ry"] = up[:, 1], -up[:, 0]
    # The z axis of the total station is vertical, and the accelerometer of the base
    # measures the changes between rows.
    vertical = base_pose(T, measured)[2, :3] + rocking
    for k, axis in enumerate("xyz"):
        columns[f"cov.gravity.{axis}"] = -G * vertical[:, k]
    return write_campaign(folder, robot, columns, (1.0, SIGMA))


def _up(rows: list[dict], place: str) -> NDArray:
    """Return upward unit vectors, (k, 3), in the axes of an accelerometer."""
    accel = np.array([row[f"tilt_sensor_{place}_accel"] for row in rows])
    return accel / np.linalg.norm(accel, axis=1)[:, None]


def _rows(content: dict) -> list[dict]:
    """Return all waypoints with column height, solution space, and stationing."""
    found = []
    for height, at_height in content["column_heights"].items():
        for space, station in at_height["solution_spaces"].items():
            for kind in STATIONING:
                marks = {"height": height, "space": space}
                marks["stationing"] = kind == STATIONING[0]
                found += [row | marks for row in station[kind]]
    return found


if __name__ == "__main__":
    from_command_line(convert, __doc__)
