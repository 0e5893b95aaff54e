"""Writing of robot files with ``format = 2``: bodies and joints in the home pose.

Start with :func:`drawing_text`.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.drawing.drawing import (
    Drawing,
    DrawnBody,
    DrawnJoint,
    JointNumbers,
)
from forcefit.assembly.files.effect_file import effect_tables
from forcefit.assembly.files.joint_file import joint_table
from forcefit.assembly.files.link_file import link_table
from forcefit.assembly.files.robot_file import root_table
from forcefit.assembly.files.toml_text import file_text
from forcefit.assembly.model.inertia import six_moments
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput

# components below this fraction of the largest component are written as 0
_ROUNDING = 1e-15
_AT_ZERO = 1e-12  # [rad or m] smaller joint coordinates are omitted


def drawing_text(robot: Robot, drawing: Drawing, folder: Path) -> str:
    """Return the text of a robot file with bodies and joints.

    Args:
        robot: robot whose effects, reference point and diagnosis are written.
        drawing: bodies and joints of the robot.
        folder: folder of the output file, to which paths are made relative.

    Returns:
        Text of the file.

    Raises:
        BadInput: the robot has tolerance callouts or fits.
    """
    if robot.callouts or robot.fits:
        raise BadInput(
            f"{robot.name}: found [[tolerance]] or a fit, which cannot be written to a "
            "file with bodies and joints; use --format 1 instead"
        )
    table = root_table(robot, folder)
    diagnosis = table.pop("diagnosis", {})
    table |= {"platform": drawing.platform, "platform_at": _point(drawing.platform_at)}
    kinds = {"body": [_body_table(body, folder) for body in drawing.bodies]}
    kinds["joint"] = [_joint_table(joint) for joint in drawing.joints]
    kinds["effect"] = effect_tables(robot) if robot.has_effects else []
    return file_text({"format": 2, **table}, kinds, diagnosis)


def _point(values: NDArray) -> list[float]:
    """Return the components of a vector, with rounding errors replaced by 0."""
    least = _ROUNDING * max(1.0, float(np.abs(values).max()))
    return [float(v) if abs(v) > least else 0.0 for v in values]


def _body_table(body: DrawnBody, folder: Path) -> dict[str, Any]:
    """Return the keys of a body."""
    table: dict[str, Any] = {"name": body.name}
    if body.mass:
        table["mass"] = body.mass
    if body.mass or body.inertia.any():
        table["centre"] = _point(body.centre)
    if body.inertia.any():
        table["inertia"] = six_moments(body.inertia)
    if body.link is not None and body.ends is not None:
        link = link_table(body.link, folder)
        beam = link["link"].get("beam", {})
        # the default beam theory is omitted
        if beam.get("theory") == "timoshenko":
            del beam["theory"]
        for key in ("axis", "up"):
            if key in beam:
                beam[key] = _point(np.array(beam[key]))
        table |= link | {"from": body.ends[0], "to": body.ends[1]}
    return table


def _joint_table(joint: DrawnJoint) -> dict[str, Any]:
    """Return the keys of a joint."""
    table: dict[str, Any] = {"name": joint.name, "type": joint.kind}
    table |= {"between": [joint.first, joint.second], "at": _point(joint.at)}
    table |= {"axis": _point(joint.axis), "axis2": _point(joint.axis2)}
    if joint.pitch:
        table["pitch"] = joint.pitch
    if joint.actuated:
        table["actuated"] = True
    if abs(joint.position) > _AT_ZERO:
        table["position"] = joint.position
    if joint.limits is not None:
        table["limits"] = list(joint.limits)
    numbers = [_numbers_table(each) for each in joint.numbers]
    drive = _drive_stiffness(joint)
    if drive is not None:
        numbers[0].pop("joint_stiffness")
        table["drive_stiffness"] = drive
    if len(numbers) == 1:
        return table | numbers[0]
    for key in dict.fromkeys(key for each in numbers for key in each):
        table[key] = [each.get(key, _none(key)) for each in numbers]
    return table


def _drive_stiffness(joint: DrawnJoint) -> float | None:
    """Return the drive stiffness if all other directions are rigid, or None."""
    K = joint.numbers[0].stiffness
    if K is None or not joint.actuated:
        return None
    row = 5 if joint.kind == "prismatic" else 2
    rigid = np.isinf(np.diag(K))
    alone = rigid.sum() == 5 and not rigid[row]
    return float(K[row, row]) if alone else None


def _none(key: str) -> Any:
    """Return the value of a key for a bearing without clearance, spring or error."""
    free = [np.inf, np.inf, 0.0, np.inf, np.inf, np.inf]
    return {"clearance": {}, "joint_stiffness": free}.get(key, [0.0] * 6)


def _numbers_table(own: JointNumbers) -> dict[str, Any]:
    """Return the keys of the error, clearance and stiffness of a joint or bearing."""
    table = joint_table(own.clearance, own.locked_at, own.stiffness)
    if own.error.any():
        table["geometric_error"] = own.error.tolist()
    if own.tolerance is not None:
        table["tolerance"] = own.tolerance.tolist()
    return table
