"""Import and export of robots in all supported file formats."""

import logging
import os
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Union

from forcefit.assembly.exchange.other_readers import has_reader, read_by_other
from forcefit.assembly.files.robot_file import Closing
from forcefit.assembly.files.robot_file import write_robot as write_robot_file
from forcefit.assembly.files.solved_links import solve_links
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.robots import load_robot as load_declared
from forcefit.assembly.steps.bolted import bolt_joints
from forcefit.inputs.errors import BadInput, describe
from forcefit.inputs.table import read_bytes

if TYPE_CHECKING:
    import mujoco
    import pinocchio

_LOG = logging.getLogger("forcefit.load")
OTHERS = (".urdf", ".xml", ".sdf")
_BLANKS = b"\xef\xbb\xbf \r\n\t"  # byte order mark and whitespace
# phrases in the descriptions of omissions that may change results
_WEIGHTY = ("mimic:", "no platform", "no drive", "may carry load", "masses")


def load_robot(
    name: Union[str, Path, "mujoco.MjModel", "mujoco.MjSpec", "pinocchio.Model"],
    close: Closing | None = None,
    *,
    links: bool = True,
) -> Robot:
    """Load a built-in robot, a robot from a file or a model in memory.

    Args:
        name: name of a built-in robot, for example ``"irsbot2"``; path of a robot file,
            MJCF file, SDF file or URDF (with its loops file in the same folder);
            ``mujoco.MjModel``; ``mujoco.MjSpec``; or ``pinocchio.Model``, whose joints
            with one degree of freedom are assumed to be driven.
        close: function that closes the loops of a robot file, as in
            :mod:`forcefit.assembly.kinematics.closing`, or None.
        links: whether to solve link meshes and read link libraries, as solvers require.
            Without them, the robot can only be placed, written and converted, and its
            zone margin can be computed.  Links are always solved for a robot with
            joints that are bolted at a pose.

    Returns:
        Robot. If it was imported from another program, its remarks list assumptions and
        omissions.

    Raises:
        BadInput: the name is not a built-in robot, a file or a model, the robot is
            invalid, or one of its meshes or libraries is unusable.
    """
    declared = isinstance(name, str | Path)
    robot = _load_declared(name, close) if declared else _robot_of_model(name, close)
    for remark in robot.remarks:
        _LOG.info("%s: %s", robot.name, remark)
    try:
        if links or any(frame.locked_at for frame in robot.frames):
            robot = bolt_joints(solve_links(robot))
        return robot
    except BadInput as error:
        raise BadInput(f"{name}: {error}") from None


def _load_declared(name: str | Path, close: Closing | None) -> Robot:
    """Load a robot by name or from a file, without computing link stiffnesses."""
    path = Path(name)
    if path.suffix.lower() not in OTHERS:
        if _is_of_other(path):
            robot = read_by_other(path)
            return robot if close is None else close(robot)
        if os.path.isfile(path) and read_bytes(path).lstrip(_BLANKS)[:1] == b"<":
            raise BadInput(
                f"{path}: found XML, expected a robot file, or the suffix .urdf, .xml "
                "(MJCF) or .sdf"
            )
        return load_declared(name, close)
    return _robot_of_foreign(path, path.name, close)


def is_robot_file(path: Path) -> bool:
    """Return whether a file is a robot file of forcefit (TOML)."""
    return path.suffix.lower() not in OTHERS and not _is_of_other(path)


def _is_of_other(path: Path) -> bool:
    """Return whether another package provides a reader for a file."""
    return path.suffix not in {"", ".toml"} and path.is_file() and has_reader(path)


def _robot_of_foreign(path: Path, title: str, close: Closing | None) -> Robot:
    """Read a robot from a file of another program; its remarks begin with a title."""
    from forcefit.assembly.exchange.foreign import robot_of_file

    conversion = robot_of_file(path, ask=False)[0]
    said = [*(f"taken: {line}" for line in conversion.taken)]
    said += [
        f"left out: {line}"
        for line in conversion.left_out
        if any(word in line for word in _WEIGHTY)
    ]
    remarks = tuple(f"{title}: {line}" for line in said)
    robot = replace(conversion.robot, remarks=(*conversion.robot.remarks, *remarks))
    return robot if close is None else close(robot)


def _robot_of_model(model: object, close: Closing | None) -> Robot:
    """Convert a model in memory to a robot."""
    from forcefit.assembly.exchange.mujoco_model import is_mujoco, mjcf_of_model
    from forcefit.assembly.exchange.pinocchio_model import (
        ASSUMED,
        is_pinocchio,
        mjcf_of_pinocchio,
    )

    kind, assumed = type(model).__name__, tuple[str, ...]()
    if is_mujoco(model):
        text = mjcf_of_model(model)
    elif is_pinocchio(model):
        text, assumed = mjcf_of_pinocchio(model), (f"{kind}: taken: {ASSUMED}",)
    else:
        expected = "expected a name, a path, an MjModel, MjSpec or pinocchio.Model"
        raise BadInput(f"load_robot: found {describe(model)} ({kind}), {expected}")
    with TemporaryDirectory() as folder:
        path = Path(folder, f"{kind}.xml")
        path.write_text(text, encoding="utf-8")
        try:
            robot = _robot_of_foreign(path, kind, close)
        except BadInput as error:
            raise BadInput(str(error).replace(str(path), kind)) from None
    return replace(robot, remarks=(*assumed, *robot.remarks)) if assumed else robot


def write_robot(robot: Robot, path: str | Path) -> None:
    """Write a robot to a file; the suffix determines the format.

    Args:
        robot: robot to write.
        path: path with the suffix ``.toml`` for a robot file, which contains the
            complete robot.  The suffixes ``.urdf`` (with a YAML file in the same
            folder) and ``.xml`` (MJCF) are for rigid bodies and joints only.  The
            command ``forcefit convert`` reports what these formats omit.

    Raises:
        BadInput: the suffix is not supported, a file of another program exists at this
            path, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".toml":
        write_robot_file(robot, path)
        return
    from forcefit.assembly.exchange.convert import check_target, write_converted

    check_target(path)
    write_converted(robot, path)
