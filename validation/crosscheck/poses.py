"""Run a cross-check at every pose of a grid and record failures."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import POSE, Posture, place_many
from forcefit.assembly.kinematics.verdict import limits_passed
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.model.statuses import (
    BEYOND_LIMITS,
    NO_SIGNAL,
    NOT_DECIDED,
    OK,
    OUT_OF_REACH,
    PASSED,
)
from forcefit.validation.crosscheck.crosscheck import Crosscheck, attempt

_VERDICTS = {
    PASSED: "passed",
    NOT_DECIDED: "NOT DECIDED",
    NO_SIGNAL: "NOT CHECKED, no difference exceeds the noise",
}


def check_poses(
    robot: Robot,
    axes: Mapping[str, NDArray],
    check: Callable[[Posture], Crosscheck],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict[str, Any]]:
    """Run a check at every reachable pose of a grid.

    Args:
        robot: robot with its errors.
        axes: mapping from pose component to its values [m or rad].  Other components
            are free.
        check: function that runs a check at a posture.
        progress: function called after each pose with the number of finished poses and
            the total.

    Returns:
        One mapping per pose with the requested pose ``asked``, ``passed``, ``status``
        and the results of the check.  ``passed`` is None if the pose is unreachable
        (status ``"out of reach"``) or violates a joint limit (status
        ``"beyond_limits"``).

    Raises:
        BadInput: the kinematic loops of the robot do not close in its home pose.
    """
    mesh = np.meshgrid(*axes.values(), indexing="ij")
    poses = np.full((mesh[0].size, 6), np.nan)
    for name, values in zip(axes, mesh, strict=True):
        poses[:, POSE.index(name)] = values.ravel()
    postures, reasons = place_many(robot, poses)
    rows = []
    for i, (posture, reason) in enumerate(zip(postures, reasons, strict=True)):
        asked = {name: float(poses[i, POSE.index(name)]) for name in axes}
        rows.append({"asked": asked} | _row(robot, posture, reason, check))
        progress(i + 1, len(poses))
    return rows


def _row(
    robot: Robot,
    posture: Posture | None,
    reason: str,
    check: Callable[[Posture], Crosscheck],
) -> dict[str, Any]:
    """Return the result at one pose."""
    if posture is None:
        return {"status": OUT_OF_REACH, "reason": reason, "passed": None}
    if passed := limits_passed(robot, posture.coordinates):
        return {"status": BEYOND_LIMITS, "reason": passed, "passed": None}
    result, failure = attempt(robot.name, lambda: check(posture))
    return failure if result is None else {"status": OK} | result.table()


def poses_table(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Convert results to plain values, with the outcome over all reachable poses."""
    reached = [row for row in rows if row["passed"] is not None]
    passed = bool(reached) and all(row["passed"] for row in reached)
    return {"poses": rows, "passed": passed, "reached": len(reached)}


def outcome_text(row: Mapping[str, Any]) -> str:
    """Format the outcome of :func:`check_poses` at one pose."""
    outcome = _VERDICTS.get(row.get("verdict", ""), "FAILED")
    if row["passed"] is None:
        outcome = "not checked"
    return outcome if row["status"] == OK else f"{outcome} ({row['status']})"


def poses_text(rows: list[dict[str, Any]]) -> str:
    """Format the outcome at each pose, and the number of poses that passed."""
    lines = []
    for row in rows:
        where = ", ".join(f"{k}={v:.6g}" for k, v in row["asked"].items())
        slope = row.get("slope")
        known = slope is not None and np.isfinite(slope)
        measured = f"slope {slope:.4f}, " if known else ""
        lines.append(f"{where}: {measured}{outcome_text(row)}")
    reached = poses_table(rows)["reached"]
    lines.append(
        f"{sum(row['passed'] is True for row in rows)} of {reached} reachable "
        f"poses passed"
    )
    return "\n".join(lines)
