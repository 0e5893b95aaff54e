"""Robots whose nominal closures do not hold: the mismatch becomes a geometric error.

Published dimensions and coordinates of redundant drives are rounded, so closures can be
open.  The mismatch is assigned to the body of a frame as a geometric error, or to the
elastic drives as a preload.  The nominal geometry of the returned robot closes.
Nominal geometry and geometric errors together equal the given robot.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.closure_rates import (
    closure_matrices,
    redundant_drives,
)
from forcefit.assembly.kinematics.nominal import Target, follow, mobile
from forcefit.assembly.kinematics.posture import joint_target
from forcefit.assembly.model.joint_names import error_rows, names_of
from forcefit.assembly.model.links import own_screw
from forcefit.assembly.model.robot import Robot
from forcefit.inputs.table import BadInput, nearest
from forcefit.stiffness.screws import rotation_matrix, rotation_vector, transform

_OPEN = 1e-9  # [rad, m] mismatch up to which a closure counts as closed
_SMALL = 0.1  # [rad, m] limit below which a mismatch counts as a small motion


def closing_of(
    rest: str | None = None,
    mismatch: str | None = None,
    joints: Mapping[str, float] | None = None,
    own_errors: bool = True,
) -> Callable[[Robot], Robot] | None:
    """Return a function that closes a robot, as ``--rest`` and ``--mismatch`` specify.

    Args:
        rest: name of a frame, see :func:`rest_in`.
        mismatch: ``"spring"``, see :func:`preloaded`.
        joints: coordinates of drives for ``mismatch``.
        own_errors: whether the robot keeps its geometric errors.  If not, it keeps only
            the errors due to its closures, because randomly drawn errors replace the
            others.

    Returns:
        A function that returns the closed robot for a declared robot; None if neither
        ``rest`` nor ``mismatch`` is given.

    Raises:
        BadInput: ``mismatch`` is not ``"spring"``.
    """
    if mismatch not in {None, "spring"}:
        raise BadInput(
            f'--mismatch: found "{str(mismatch)[:60]}", expected the word spring'
        )
    if rest is None and mismatch is None:
        return None

    def close(robot: Robot) -> Robot:
        if not own_errors:
            robot = robot.with_errors(np.zeros((len(robot.frames), 6)))
        if rest is not None:
            robot = rest_in(robot, rest)
        return robot if mismatch is None else preloaded(robot, joints)

    return close


def rest_in(robot: Robot, name: str) -> Robot:
    """Return the robot with its closure's mismatch as a geometric error of a frame.

    Args:
        robot: any robot.  Its drives are at their ``position``, and its passive joints
            are moved as near to closing as possible.
        name: name of a frame, or of a joint of several frames, in the loop that does
            not close.  For a universal joint, the mismatch is assigned to its first
            bearing.

    Returns:
        A robot whose nominal geometry closes.  With its geometric errors, it equals the
        given robot.

    Raises:
        BadInput: there is no such frame, no loop through it is open, or the mismatch is
            not a small motion.
    """
    if name not in (names := names_of(robot)):
        raise BadInput(f'--rest: no frame "{name[:60]}"{nearest(name, names)}')
    driven = [f.actuated for f in robot.frames]
    held = np.where(driven, robot.positions, np.nan)
    track = follow(robot, robot.positions, Target(coordinates=held[None]), guess=True)
    T, row = track.transforms[0], error_rows(robot, name)[0][0]
    robot = _positioned(robot, track.coordinates[0])
    for k, pair in enumerate(robot.closures):
        a, b = (robot.index(end) for end in pair)
        sides = robot.on_path[a, row], robot.on_path[b, row]
        if track.closure_mismatch[0, k] > _OPEN and sides[0] != sides[1]:
            to, at = (T[b], T[a]) if sides[0] else (T[a], T[b])
            own = np.linalg.inv(T[row])
            return _corrected(robot, row, own @ to @ np.linalg.inv(at) @ T[row])
    raise BadInput(
        f'--rest: frame "{name[:60]}": found no open loop through it; expected '
        "a frame between the two frames of a closure that does not hold"
    )


def _corrected(robot: Robot, row: int, X: NDArray) -> Robot:
    """Return the robot with a frame moved by X, and the inverse of X as its error."""
    frame = robot.frames[row]
    body = transform(frame.translation, rotation_matrix(frame.rotation)) @ X
    error = frame.geometric_error
    D = np.linalg.inv(X) @ transform(error[3:], rotation_matrix(error[:3]))
    screw = np.concatenate([rotation_vector(D[:3, :3]), D[:3, 3]])
    if np.abs(screw).max() > _SMALL:
        raise BadInput(
            f"--rest: frame {frame.name}: closing the loop needs a motion of "
            f"{np.abs(screw).max():.3g} rad or m, expected a small motion, < "
            f"{_SMALL:g}"
        )
    moved = replace(
        frame, translation=body[:3, 3], rotation=rotation_vector(body[:3, :3]),
        geometric_error=screw,
    )  # fmt: skip
    frames = (*robot.frames[:row], moved, *robot.frames[row + 1 :])
    turned = float(np.abs(rotation_vector(X[:3, :3])).max())
    remark = (
        f"the gap of the closure, {np.abs(X[:3, 3]).max():.3g} m and "
        f"{turned:.3g} rad, becomes a geometric error of {frame.name}"
    )
    return replace(robot, frames=frames, remarks=(*robot.remarks, remark))


def preloaded(robot: Robot, joints: Mapping[str, float] | None = None) -> Robot:
    """Return a robot whose elastic drives are preloaded by the closures' mismatch.

    Args:
        robot: robot with redundant drives that are elastic.
        joints: coordinates [rad or m] of drives by frame; other drives keep their
            ``position``.

    Returns:
        A robot whose home pose is the nearest pose that closes.  The error of each
        drive is the difference from its requested coordinate; the drive's spring takes
        up this difference.

    Raises:
        BadInput: a drive is unknown; there are no closing coordinates nearby; or a
            drive with a difference is rigid.
    """
    target = joint_target(robot, joints or {})
    assert target.coordinates is not None
    asked = target.coordinates[0]
    driven = np.array([f.actuated for f in robot.frames])
    free = Target(coordinates=np.full((1, len(asked)), np.nan))
    home = follow(robot, robot.positions, free, guess=True)
    leading = np.where(_independent(robot, home.transforms), asked, np.nan)
    near = follow(robot, home.coordinates[0], Target(coordinates=leading[None]))
    start = np.where(driven, asked, near.coordinates[0])
    there = follow(robot, start, free, guess=True)
    differs = np.where(driven, asked - there.coordinates[0], 0.0)
    closes = near.reached[0] and there.mismatch[0] <= _OPEN
    if not closes or np.abs(differs).max() > _SMALL:
        raise BadInput(
            f"{robot.name}: no posture near these drive coordinates closes; "
            "expected coordinates at which all loops close except for their "
            "rounding"
        )
    closed = _positioned(robot, there.coordinates[0])
    frames = []
    for frame, value in zip(closed.frames, differs.tolist(), strict=True):
        error = frame.geometric_error.copy()
        error += value * own_screw(frame)
        own = frame.own_stiffness
        if abs(value) > _OPEN and (own is None or np.isinf(own)):
            raise BadInput(
                f"--mismatch spring: drive {frame.name}: found a rigid drive "
                f"whose coordinate must change by {value:.3g} rad or m; expected a "
                "joint_stiffness about its own axis"
            )
        frames.append(replace(frame, geometric_error=error))
    count = redundant_drives(robot, there.transforms[0])
    most = int(np.abs(differs).argmax())
    remark = (
        f"{count} of {int(driven.sum())} drives redundant; their springs take up to "
        f"{abs(differs[most]):.3g} rad or m, at {robot.frames[most].name}"
    )
    return replace(closed, frames=tuple(frames), remarks=(*robot.remarks, remark))


def _positioned(robot: Robot, q: NDArray) -> Robot:
    """Return the robot with the coordinates q in its home pose."""
    moves = mobile(robot)
    frames = tuple(
        replace(frame, position=float(value)) if moving else frame
        for frame, value, moving in zip(robot.frames, q, moves, strict=True)
    )
    return replace(robot, frames=frames)


def _independent(robot: Robot, T: NDArray) -> NDArray:
    """Return (n,) bool, True for the first drives in the file that fix the robot."""
    A = closure_matrices(robot, T)[0][0]
    driven = np.array([f.actuated for f in robot.frames])[mobile(robot)]
    loose = ~driven
    for column in np.flatnonzero(driven)[::-1]:
        # a drive is redundant if the other drives fix it through the closures
        others = np.append(np.flatnonzero(loose), column)
        if _rank(A[:, others]) > _rank(A[:, loose]):
            loose[column] = True
    chosen = np.zeros(len(robot.frames), dtype=bool)
    chosen[np.flatnonzero(mobile(robot))[~loose]] = True
    return chosen


def _rank(A: NDArray) -> int:
    """Return the number of singular values above rounding."""
    return int(np.linalg.matrix_rank(A, tol=1e-6)) if A.size else 0
