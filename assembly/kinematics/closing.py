"""Close robots whose nominal loops are open.

Published dimensions and coordinates of redundant drives are rounded, so loops may not
close exactly.  The mismatch becomes either a geometric error of a body or a preload of
the elastic drives.  The loops of the nominal geometry then close.  Nominal geometry and
geometric errors together are equivalent to the given robot.
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

_OPEN = 1e-9  # [rad, m] largest mismatch of a closed loop
_SMALL = 0.1  # [rad, m] largest mismatch that is treated as a small motion


def closing_of(
    rest: str | None = None,
    mismatch: str | None = None,
    joints: Mapping[str, float] | None = None,
    own_errors: bool = True,
) -> Callable[[Robot], Robot] | None:
    """Return the function selected by ``--rest`` or ``--mismatch`` to close a robot.

    Args:
        rest: name of a frame, see :func:`rest_in`.
        mismatch: ``"spring"``, see :func:`preloaded`.
        joints: coordinates of drives for ``mismatch``.
        own_errors: whether to retain the geometric errors of the robot. If False, only
            the errors that close the loops are retained.

    Returns:
        A function that closes a robot; None if neither ``rest`` nor ``mismatch`` is
        given.

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
    """Assign the closure mismatch to a frame as a geometric error.

    Args:
        robot: any robot, with drives at their ``position``.  Its passive joints
            minimise the mismatch.
        name: name of a frame or joint in the open loop.  For a universal joint, the
            mismatch is assigned to its first bearing.

    Returns:
        A robot whose nominal loops close.  Including its geometric errors, it is
        equivalent to the given robot.

    Raises:
        BadInput: there is no such frame, it is not in an open loop, or the mismatch is
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
        "a frame between the two frames of an open closure"
    )


def _corrected(robot: Robot, row: int, X: NDArray) -> Robot:
    """Move a frame by X and assign the inverse of X as its geometric error."""
    frame = robot.frames[row]
    body = transform(frame.translation, rotation_matrix(frame.rotation)) @ X
    error = frame.geometric_error
    D = np.linalg.inv(X) @ transform(error[3:], rotation_matrix(error[:3]))
    screw = np.concatenate([rotation_vector(D[:3, :3]), D[:3, 3]])
    if np.abs(screw).max() > _SMALL:
        raise BadInput(
            f"--rest: frame {frame.name}: closing the loop requires a motion of "
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
    """Preload the elastic drives of a robot with its closure mismatch.

    Args:
        robot: robot with redundant drives that are elastic.
        joints: coordinates [rad or m] of drives by frame; other drives stay at their
            ``position``.

    Returns:
        A robot whose home pose is the nearest pose at which all loops close.  The
        geometric error of each drive is the difference from its requested coordinate.
        The drive spring compensates this difference.

    Raises:
        BadInput: a drive is unknown, the loops do not close at nearby coordinates, or a
            drive that must deform is rigid.
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
            f"{robot.name}: the loops do not close near these drive coordinates; "
            "expected coordinates at which all loops close up to rounded digits"
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
    """Return the robot with home coordinates q."""
    moves = mobile(robot)
    frames = tuple(
        replace(frame, position=float(value)) if moving else frame
        for frame, value, moving in zip(robot.frames, q, moves, strict=True)
    )
    return replace(robot, frames=frames)


def _independent(robot: Robot, T: NDArray) -> NDArray:
    """Return a mask (n,) of non-redundant drives."""
    A = closure_matrices(robot, T)[0][0]
    driven = np.array([f.actuated for f in robot.frames])[mobile(robot)]
    loose = ~driven
    for column in np.flatnonzero(driven)[::-1]:
        # A drive is redundant if the other drives determine its coordinate.
        others = np.append(np.flatnonzero(loose), column)
        if _rank(A[:, others]) > _rank(A[:, loose]):
            loose[column] = True
    chosen = np.zeros(len(robot.frames), dtype=bool)
    chosen[np.flatnonzero(mobile(robot))[~loose]] = True
    return chosen


def _rank(A: NDArray) -> int:
    """Return the number of singular values above round-off."""
    return int(np.linalg.matrix_rank(A, tol=1e-6)) if A.size else 0
