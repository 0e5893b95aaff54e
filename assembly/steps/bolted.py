"""Joints that are bolted at one pose and are rigid afterwards (``locked_at``).

Before a joint is bolted, it moves within its clearance, without loads, to the position
with minimum energy.  If there are several such positions, the position with the
smallest sum of squares is used, where motions are divided by the clearance.  At all
other poses, this motion is locked and acts like a geometric error.

Joints are bolted in the order of the frames.  Consecutive joints with the same pose are
bolted together.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.posture import Posture, place_robot
from forcefit.assembly.linear.reference.energy import CannotAssemble
from forcefit.assembly.model.contact_closures import contact_frames
from forcefit.assembly.model.error_distributions import draw_generator
from forcefit.assembly.model.joint_names import joint_of, moves
from forcefit.assembly.model.robot import Frame, LockedAt, Robot
from forcefit.assembly.solvers.conic import SolverFailed
from forcefit.assembly.steps.left_anywhere import positions_left_anywhere
from forcefit.assembly.steps.machine import Machine, machine_at
from forcefit.assembly.steps.plan import Plan
from forcefit.assembly.steps.state import State, first_state
from forcefit.inputs.table import BadInput, quoted
from forcefit.results.display import numbers

BOLT_STREAM = 4  # random number stream of the bolted positions, see draw_generator
_ROUNDED = 1e-12  # [-] tolerance for zero motions, relative to the clearance
_BOLTED = "is bolted at"  # words by which a remark on a bolted joint is recognised
_RULES = {
    "least": "",
    "uniform": "; random machines are bolted at random positions of minimum energy",
    "worst": '; "assembly error" bounds the error for all other positions',
}


class CannotBolt(BadInput):
    """Raised if a machine cannot be assembled at the pose where a joint is bolted."""


def bolt_joints(robot: Robot, rng: np.random.Generator | None = None) -> Robot:
    """Return a robot whose bolted joints are rigid.

    Args:
        robot: robot with known link stiffnesses.
        rng: random number generator for joints with ``left = "uniform"``, see
            :func:`bolted_errors`.

    Returns:
        The robot.  Its geometric errors include the locked motions of bolted joints.

    Raises:
        BadInput: the robot cannot reach the pose at which a joint is bolted, or it
            cannot be assembled there.
    """
    if not any(frame.locked_at for frame in robot.frames):
        return robot
    declared = robot.declared_errors
    rngs = None if rng is None else [rng]
    total = bolted_errors(robot, declared[None], rngs)[0]
    frames = []
    for frame, error, own in zip(robot.frames, total, declared, strict=True):
        bolt = frame.locked_at
        if bolt is not None:
            bolt = replace(bolt, screw=error - own)
        frames.append(replace(frame, geometric_error=error, locked_at=bolt))
    kept = [remark for remark in robot.remarks if _BOLTED not in remark]
    remarks = [_remark(frame) for frame in frames if frame.locked_at is not None]
    return replace(robot, frames=tuple(frames), remarks=(*kept, *remarks))


def _remark(frame: Frame) -> str:
    """Return a remark on the position at which a joint is bolted."""
    assert frame.locked_at is not None
    screw = numbers(frame.locked_at.screw)
    rule = _RULES[frame.locked_at.left]
    return f"joint {quoted(frame.name)} {_BOLTED} {screw} rad, m in its clearance{rule}"


def bolt_generators(
    robot: Robot, seed: int, draws: Sequence[int] | NDArray
) -> list[np.random.Generator] | None:
    """Return random number generators for the bolted positions of random machines.

    Args:
        robot: any robot.
        seed: seed of all draws.
        draws: indices of the draws.

    Returns:
        A generator for each draw, or None if no position is random.
    """
    bolts = [frame.locked_at for frame in robot.frames]
    if all(bolt is None or bolt.left != "uniform" for bolt in bolts):
        return None
    numbers = np.asarray(draws).tolist()
    return [draw_generator(seed, number, BOLT_STREAM) for number in numbers]


def bolted_errors(
    robot: Robot, errors: NDArray, rngs: Sequence[np.random.Generator] | None = None
) -> NDArray:
    """Return the errors of k machines, including the locked motions of bolted joints.

    Args:
        robot: robot with n frames and known link stiffnesses.  Its own errors are not
            used.
        errors: (k, n, 6) [rad, m] errors of the machines without bolted joints.
        rngs: k random number generators for joints with ``left = "uniform"``.  If None,
            these joints are bolted at the position with the smallest sum of squares.

    Returns:
        (k, n, 6) [rad, m] errors including the locked motions.

    Raises:
        CannotBolt: a machine cannot be assembled at the pose where it is bolted.
        BadInput: the robot cannot reach the pose at which a joint is bolted.
    """
    total = errors
    for frames, machine in _bolts(robot):
        state = _loose_state(robot, frames, machine, total)
        u = state.found.clearances
        bolt = robot.frames[frames[0]].locked_at
        if rngs is not None and bolt is not None and bolt.left == "uniform":
            u = positions_left_anywhere(machine, state, rngs)
        total = _with_locked(machine, frames, total, u)
    return total


def _loose_state(
    robot: Robot, frames: list[int], machine: Machine, errors: NDArray
) -> State:
    """Return the state of machines before joints are bolted, at the pose of bolting."""
    try:
        return first_state(machine, Plan(()), errors, None)
    except (CannotAssemble, SolverFailed) as error:
        place = f"{robot.name}: frame {quoted(robot.frames[frames[0]].name)}"
        raise CannotBolt(f"{place}.locked_at: {error}") from None


def _with_locked(
    machine: Machine, frames: list[int], errors: NDArray, u: NDArray
) -> NDArray:
    """Return errors to which the locked motions of bolted frames are added."""
    moved = np.where(np.abs(u) > _ROUNDED, u, 0.0) @ machine.cones.T
    total = errors.copy()
    total[:, frames] += moved.reshape(total.shape)[:, frames]
    return total


def last_bolt(robot: Robot) -> tuple[list[int], Machine, State]:
    """Return the joints that are bolted last, and the state before bolting them.

    Args:
        robot: robot with a joint that has ``left = "worst"``.

    Returns:
        Indices of the frames; and the machine and its state at the pose of bolting.

    Raises:
        BadInput: a joint with ``left = "worst"`` is not bolted last, or the robot
            cannot be assembled at that pose.
    """
    total = robot.declared_errors[None]
    *before, (frames, machine) = _bolts(robot)
    for earlier, own in before:
        first = robot.frames[earlier[0]]
        if first.locked_at is not None and first.locked_at.left == "worst":
            raise BadInput(
                f"{robot.name}: frame {quoted(first.name)}.locked_at.left: found "
                '"worst" for a joint that is not bolted last; expected "least", or the '
                'same pose for all joints with "worst", which must be last in the file'
            )
        state = _loose_state(robot, earlier, own, total)
        total = _with_locked(own, earlier, total, state.found.clearances)
    return frames, machine, _loose_state(robot, frames, machine, total)


@lru_cache(maxsize=16)
def _bolts(robot: Robot) -> list[tuple[list[int], Machine]]:
    """Return the frames that are bolted at each pose, and the machine there."""
    rows = [i for i, frame in enumerate(robot.frames) if frame.locked_at is not None]
    bolts, open_ = [], set(rows)
    for _, group in groupby(rows, lambda i: _pose(robot.frames[i])):
        frames = list(group)
        bolts.append((frames, machine_at(_posture(robot, frames[0], open_))))
        open_ -= set(frames)
    return bolts


def _pose(frame: Frame) -> tuple:
    """Return the pose at which a frame is bolted, as a key for comparison."""
    bolt = frame.locked_at
    assert bolt is not None
    return sorted(bolt.pose.items()), sorted(bolt.joints.items()), bolt.left


def _posture(robot: Robot, row: int, open_: set[int]) -> Posture:
    """Return the posture for bolting a joint, while ``open_`` are still loose."""
    frames = tuple(
        _loose(frame) if i in open_ else frame for i, frame in enumerate(robot.frames)
    )
    bolt = robot.frames[row].locked_at
    assert isinstance(bolt, LockedAt)
    try:
        loose = replace(robot, frames=frames).with_errors(np.zeros((len(frames), 6)))
        return place_robot(loose, dict(bolt.pose) or None, dict(bolt.joints) or None)
    except BadInput as error:
        place = f"frame {quoted(robot.frames[row].name)}.locked_at"
        raise BadInput(f"{place}: {error}") from None


def _loose(frame: Frame) -> Frame:
    """Return a frame with the clearance that its joint has before bolting."""
    bolt = frame.locked_at
    assert bolt is not None
    return replace(frame, clearance=bolt.clearance, locked_at=None)


def refuse_bolted(robot: Robot, what: str) -> None:
    """Raise BadInput for a robot with bolted joints.

    Args:
        robot: any robot.
        what: name of the computation, for messages.

    Raises:
        BadInput: a joint is bolted at a pose.
    """
    bolted = [frame.name for frame in robot.frames if frame.locked_at is not None]
    if bolted:
        raise BadInput(
            f"{robot.name}: frame {quoted(bolted[0])}.locked_at: found a joint that is "
            f"bolted at a pose, which the {what} does not support; expected a robot "
            'without bolted joints, or "assembly statistics", which supports them'
        )


def loose_over_poses(robot: Robot) -> list[str]:
    """Return a remark on fixed joints that have a clearance but are not bolted.

    Args:
        robot: robot that is solved at several poses.

    Returns:
        A list with a sentence, or an empty list.
    """
    contacts = contact_frames(robot)
    owners = dict.fromkeys(
        joint_of(robot, row) for row, f in enumerate(robot.frames)
        if f.joint == "fixed" and f.clearance and f.name not in contacts
    )  # fmt: skip
    loose = [name for name in owners if not moves(robot, name)]
    if not loose:
        return []
    return [
        (
            f"the clearance of the fixed joint {', '.join(map(quoted, loose))} is "
            'loose at every pose; expected "locked_at" if the joint is bolted at one '
            "pose"
        )
    ]
