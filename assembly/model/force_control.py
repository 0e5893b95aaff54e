"""Force-controlled drives, which apply a prescribed force at a free joint."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from forcefit.assembly.model.frame import Frame
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, nearest, quoted


def with_drive_forces(robot: Robot, forces: Mapping[str, float]) -> Robot:
    """Switch the named drives to force control.

    The joint of a force-controlled drive becomes passive, and its stiffness and
    clearance along the joint motion are removed.  The force acts between the two bodies
    that the joint connects.

    Args:
        robot: robot with the drives.
        forces: mapping from frame names of drives to forces [N m or N], positive in the
            direction of increasing joint coordinate.

    Returns:
        Robot with force-controlled drives.  The joint stiffness in all remaining
        directions stays unchanged.

    Raises:
        BadInput: there is no drive with this name, or its stiffness couples the joint
            motion with a different direction.
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
    """Return the frame with a joint that moves freely under a constant force."""
    if not frame.actuated:
        return replace(frame, drive_force=force)
    own, K, clearance = frame.own_axis, frame.joint_stiffness, frame.clearance
    if K is not None:
        others = np.arange(6) != own
        if K[own, others].any():
            raise BadInput(
                f"frame {quoted(frame.name)}.joint_stiffness: found coupling between "
                "the drive's motion and other directions; expected zeros in its row "
                "and column for a force-controlled drive"
            )
        K = K.copy()
        K[own, own] = 0.0
    if clearance is not None:
        key = "axial" if frame.joint == "prismatic" else "spin"
        clearance = replace(clearance, **{key: None})
    return replace(
        frame, actuated=False, joint_stiffness=K, clearance=clearance, drive_force=force
    )
