"""Compute certified error bounds of a robot after making one part perfect."""

from dataclasses import replace
from typing import Any

import numpy as np

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.energy import CannotAssemble, solve_assembly
from forcefit.assembly.linear.pose_error import bound_pose_error
from forcefit.assembly.linear.reference.reduction import FreeMotion
from forcefit.assembly.model.clearance import BOUNDS, own_cone
from forcefit.assembly.model.robot import Frame, Robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.steps.bolted import bolt_joints

ERROR, CLEARANCE = "geometric error", "clearance"


def governing(posture: Posture, assumption: str = "frozen") -> list[dict[str, Any]]:
    """Return the bounds of problem (27) without one part's error or clearance.

    The given errors of the robot are used.  Two errors may compensate each other.
    Removing one of them then increases the bound.

    Args:
        posture: configuration of a robot with errors or clearances.
        assumption: assumption of problem (27).

    Returns:
        A mapping for each frame with errors and each joint with clearances.  It
        contains the name (``part``), the removed imperfection (``what``), and the upper
        bounds ``rotation`` [rad] and ``translation`` [m] without this imperfection.
        The mapping with the smallest translation is first.  Bounds are None without a
        solution.
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
    """Return the sort key: smallest bound first, missing bounds last."""
    if row["translation"] is None:
        return (np.inf, np.inf)
    return (row["translation"], row["rotation"])


def _improved(robot: Robot) -> list[tuple[str, str, Robot]]:
    """Yield copies of the robot, each without one of its imperfections."""
    cases = []
    declared = robot.declared_errors
    for i, frame in enumerate(robot.frames):
        if declared[i].any():
            errors = declared.copy()
            errors[i] = 0.0
            cases.append((frame.name, ERROR, bolt_joints(robot.with_errors(errors))))
    for i, frame in enumerate(robot.frames):
        tight = _tight(frame)
        if tight is not None:
            frames = (*robot.frames[:i], tight, *robot.frames[i + 1 :])
            cases.append((frame.name, CLEARANCE, replace(robot, frames=frames)))
    return cases


def _tight(frame: Frame) -> Frame | None:
    """Return the joint without its clearances; None if there are no clearances."""
    own = own_cone(frame)
    clearances = [key for k, key in enumerate(BOUNDS) if k != own]
    bounds = [getattr(frame.clearance, key, None) or 0.0 for key in clearances]
    if not any(bounds) or np.isinf(bounds).any():  # inf is free, not a clearance
        return None
    assert frame.clearance is not None
    tight = replace(frame.clearance, **dict.fromkeys(clearances))
    return replace(frame, clearance=tight)
