"""Import and export of robots in files of any kind, by their suffix."""

import os
from dataclasses import replace
from pathlib import Path

from assembly.files.robot_file import Closing
from assembly.files.robot_file import write_robot as write_robot_file
from assembly.files.solved_links import solve_links
from assembly.model.robot import Robot
from assembly.robots import load_robot as load_declared
from assembly.steps.bolted import bolt_joints
from forcefit.inputs.table import BadInput, read_bytes

OTHERS = (".urdf", ".xml", ".sdf")
_BLANKS = b"\xef\xbb\xbf \r\n\t"  # a byte order mark and blanks
# words in a remark which say that an omission may change results
_WEIGHTY = ("mimic:", "no platform", "no drive", "may carry load", "masses")


def load_robot(
    name: str | Path, close: Closing | None = None, *, links: bool = True
) -> Robot:
    """Return a built-in robot by its name, or the robot of a file of any kind.

    Args:
        name: name such as ``"irsbot2"``, or the path of a robot file, a URDF (with its
            loops next to it), MJCF or SDF file.
        close: function that makes the closures of a declared robot hold, as
            :mod:`assembly.kinematics.closing` does; none if absent.
        links: whether links given by a mesh or a library are solved or read now, which
            solvers need.  Without them a robot can be placed, written and converted,
            and its assembly zone can be computed.  A robot with joints that are bolted
            at a pose needs them always.

    Returns:
        The robot; its remarks include the assumptions and omissions for a file of
        another program.

    Raises:
        BadInput: neither a built-in name nor a file, the file breaks a rule, or a mesh
            or library that it names is not usable.
    """
    robot = _load_declared(name, close)
    try:
        if links or any(frame.locked_at for frame in robot.frames):
            robot = bolt_joints(solve_links(robot))
        return robot
    except BadInput as error:
        raise BadInput(f"{name}: {error}") from None


def _load_declared(name: str | Path, close: Closing | None) -> Robot:
    """Return the robot of a name or of a file, with links as declared."""
    path = Path(name)
    if path.suffix.lower() not in OTHERS:
        if os.path.isfile(path) and read_bytes(path).lstrip(_BLANKS)[:1] == b"<":
            raise BadInput(
                f"{path}: found XML, expected a robot file, or the ending .urdf, .xml "
                "(MJCF) or .sdf"
            )
        return load_declared(name, close)
    from assembly.exchange.foreign import robot_of_file

    conversion = robot_of_file(path, ask=False)[0]
    said = [*(f"taken: {line}" for line in conversion.taken)]
    said += [
        f"left out: {line}"
        for line in conversion.left_out
        if any(word in line for word in _WEIGHTY)
    ]
    remarks = tuple(f"{path.name}: {line}" for line in said)
    robot = replace(conversion.robot, remarks=(*conversion.robot.remarks, *remarks))
    return robot if close is None else close(robot)


def write_robot(robot: Robot, path: str | Path) -> None:
    """Write a robot to a file of the kind given by the suffix.

    Args:
        robot: to be written.
        path: ``.toml``: a robot file, which holds the complete robot; ``.urdf`` (and a
            YAML next to it) or ``.xml`` (MJCF): its rigid bodies and joints; see
            ``forcefit convert``, which reports what they leave out.

    Raises:
        BadInput: another suffix, a file of another program exists there, or it cannot
            be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".toml":
        write_robot_file(robot, path)
        return
    from assembly.exchange.convert import check_target, write_converted

    check_target(path)
    write_converted(robot, path)
