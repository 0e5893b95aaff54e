"""Drives that apply a prescribed force and do not control the joint coordinate."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from forcefit.assembly.model.frame import Frame
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, nearest, quoted


def with_drive_forces(robot: Robot, forces: Mapping[str, float]) -> Robot:
    """Return a robot in which the named drives apply a given force and move freely.

    The joint of such a drive becomes passive.  Stiffness and clearance of the drive do
    not act along its motion.  The force acts between its body and the part that its
    joint carries.

    Args:
        robot: any robot.
        forces: [N m or N] forces by the name of the drive's frame, positive in the
            direction of increasing coordinate.

    Returns:
        The robot; the stiffness of its joints in other directions is unchanged.

    Raises:
        BadInput: there is no drive of this name, or its stiffness couples its motion
            with another direction.
    """
    drives = [f.name for f in robot.frames if f.actuated or f.drive_force]
    for name in forces:
        if name not in drives:
            raise BadInput(
                f"{robot.name}: drive force: no drive {quoted(name[:60])}"
                f"{nearest(name, drives) if drives else '; the robot has none'}"
            )
    frames = (
        _released(f, float(forces[f.name])) if f.name in forces else f
        for f in robot.frames
    )
    texts = (
        f"{name} {force:g} {'N' if robot.frame(name).joint == 'prismatic' else 'N m'}"
        for name, force in forces.items()
    )
    remark = f"drives that apply a force and hold no coordinate: {', '.join(texts)}"
    return replace(robot, frames=tuple(frames), remarks=(remark, *robot.remarks))


def _released(frame: Frame, force: float) -> Frame:
    """Return a frame whose joint moves freely under a constant force."""
    if not frame.actuated:
        return replace(frame, drive_force=force)
    own, K, clearance = frame.own_axis, frame.joint_stiffness, frame.clearance
    if K is not None:
        others = np.arange(6) != own
        if K[own, others].any():
            raise BadInput(
                f"frame {quoted(frame.name)}.joint_stiffness: found the drive's motion "
                "coupled with other directions; expected zeros in its row and column "
                "for a drive that applies a force"
            )
        K = K.copy()
        K[own, own] = 0.0
    if clearance is not None:
        key = "axial" if frame.joint == "prismatic" else "spin"
        clearance = replace(clearance, **{key: None})
    return replace(
        frame, actuated=False, joint_stiffness=K, clearance=clearance, drive_force=force
    )
