"""What governs the worst case: the certified bound with one part made perfect."""

from dataclasses import replace
from typing import Any

import numpy as np

from assembly.kinematics.posture import Posture
from assembly.linear.energy import CannotAssemble, solve_assembly
from assembly.linear.pose_error import bound_pose_error
from assembly.linear.reference.reduction import FreeMotion
from assembly.model.clearance import own_cone
from assembly.model.robot import Frame, Robot
from assembly.solvers.conic import SolverFailed

ERROR, CLEARANCE = "geometric error", "clearance"
_KEYS = ("tilt", "spin", "radial", "axial")  # as the bounds of clearance_bounds


def governing(posture: Posture, assumption: str = "frozen") -> list[dict[str, Any]]:
    """Largest pose error (27) with one frame's error or one joint's clearance removed.

    The errors are those that the robot has: two of them may cancel each other, and then
    the bound rises when one is removed.

    Args:
        posture: of a robot with errors or clearances.
        assumption: of problem (27).

    Returns:
        For each frame with errors and each joint with clearances its name (``part``),
        ``what`` is removed, and the upper bounds ``rotation`` [rad] and ``translation``
        [m] without it, the smallest translation first; None where there is no answer.
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
    """Return the smallest bound first, those without an answer last."""
    if row["translation"] is None:
        return (np.inf, np.inf)
    return (row["translation"], row["rotation"])


def _improved(robot: Robot) -> list[tuple[str, str, Robot]]:
    """Return the robot with each of its imperfections removed, one at a time."""
    cases = []
    for i, frame in enumerate(robot.frames):
        if robot.errors[i].any():
            errors = robot.errors.copy()
            errors[i] = 0.0
            cases.append((frame.name, ERROR, robot.with_errors(errors)))
    for i, frame in enumerate(robot.frames):
        tight = _tight(frame)
        if tight is not None:
            frames = (*robot.frames[:i], tight, *robot.frames[i + 1 :])
            cases.append((frame.name, CLEARANCE, replace(robot, frames=frames)))
    return cases


def _tight(frame: Frame) -> Frame | None:
    """A joint without its clearances, its own motion left; None if it has none."""
    own = own_cone(frame)
    clearances = [key for k, key in enumerate(_KEYS) if k != own]
    if not any(getattr(frame.clearance, key, None) for key in clearances):
        return None
    assert frame.clearance is not None
    tight = replace(frame.clearance, **dict.fromkeys(clearances))
    return replace(frame, clearance=tight)
