"""Compute bounds of the pose error if one frame or joint has no imperfection."""

from dataclasses import replace
from typing import Any

import numpy as np

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.clearance import BOUNDS, own_cone
from forcefit.assembly.model.joint_names import (
    joint_of,
    names_of,
    owner_of_contact,
    shown_name,
)
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.steps.bolted import bolt_joints

ERROR, CLEARANCE = "geometric error", "clearance"


def governing(posture: Posture, assumption: str = "frozen") -> list[dict[str, Any]]:
    """Return the bounds of problem (27) with each imperfection removed in turn.

    If two errors compensate each other, removing one of them increases the bound.

    Args:
        posture: configuration of a robot with errors or clearances.
        assumption: assumption of problem (27).

    Returns:
        One mapping for each frame with errors and each joint with clearances, with the
        smallest translation first.  It contains the name of the frame or joint
        (``part``), the removed imperfection (``what``), and the upper bounds
        ``rotation`` [rad] and ``translation`` [m], or None without a solution.
    """
    rows: list[dict[str, Any]] = []
    for part, what, robot in _improved(posture.robot):
        try:
            assembly = solve_assembly(replace(posture, robot=robot))
            bound = bound_pose_error(assembly, assumption)
        except (CannotAssemble, FreeMotion, SolverFailed):
            rows.append({"part": part, "what": what, "rotation": None,
                         "translation": None})  # fmt: skip
            continue
        rows.append({
            "part": part, "what": what, "rotation": float(bound.rotation_error[1]),
            "translation": float(bound.translation_error[1]),
        })  # fmt: skip
    return sorted(rows, key=_by_translation)


def _by_translation(row: dict[str, Any]) -> tuple[float, float]:
    """Return a sort key, with the smallest bound first and missing bounds last."""
    if row["translation"] is None:
        return (np.inf, np.inf)
    return (row["translation"], row["rotation"])


def _improved(robot: Robot) -> list[tuple[str, str, Robot]]:
    """Return copies of the robot without one of its imperfections."""
    cases = []
    declared = robot.declared_errors
    for i, frame in enumerate(robot.frames):
        if declared[i].any():
            errors = declared.copy()
            errors[i] = 0.0
            cases.append((frame.name, ERROR, bolt_joints(robot.with_errors(errors))))
    for part, rows in _loose_parts(robot).items():
        frames = list(robot.frames)
        for i in rows:
            frames[i] = _tight(frames[i])
        cases.append((part, CLEARANCE, replace(robot, frames=tuple(frames))))
    return cases


def _loose_parts(robot: Robot) -> dict[str, list[int]]:
    """Return the frame indices of each joint with clearance."""
    parts: dict[str, list[int]] = {}
    names = names_of(robot)
    for i, frame in enumerate(robot.frames):
        if _finite_bounds(frame):
            contact = owner_of_contact(frame.name, names)
            part = joint_of(robot, i) if contact else shown_name(robot, i)
            parts.setdefault(part, []).append(i)
    return parts


def _finite_bounds(frame: Frame) -> dict[str, float]:
    """Return the finite clearances of a joint."""
    if frame.clearance is None:
        return {}
    own = own_cone(frame)
    bounds = {
        key: getattr(frame.clearance, key, None) or 0.0
        for k, key in enumerate(BOUNDS) if k != own
    }  # fmt: skip
    return {key: bound for key, bound in bounds.items() if 0.0 < bound < np.inf}


def _tight(frame: Frame) -> Frame:
    """Return the frame without the finite clearances of its joint."""
    assert frame.clearance is not None
    tight = replace(frame.clearance, **dict.fromkeys(_finite_bounds(frame)))
    return replace(frame, clearance=tight)
