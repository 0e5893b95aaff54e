"""Recognition of joints with several degrees of freedom in a robot with frames.

Consecutive passive frames at the same point form a universal, spherical, cylindrical or
planar joint if there is no mass or link between them, and if this joint can have the
same clearance and springs in all postures.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.drawing.drawing import (
    DrawnBody,
    DrawnJoint,
    JointNumbers,
    perpendicular,
)
from forcefit.assembly.drawing.parts import parts_of
from forcefit.assembly.drawing.rigid_bodies import RigidBodies, connects
from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.model.robot import Clearance, Frame, Robot
from forcefit.inputs.table import BadInput, quoted

_SAME = 1e-12  # [sine, or fraction of the robot size] tolerance for equal poses
_PARALLEL = 1e-2  # smallest sine of the angle between the axes of a universal joint
_TURNS = ("revolute", "revolute")
# suffixes of the names of joint frames (``parts.py``)
_PARTS = {"first", "second", "third", "turn", "slide", "slide_x", "slide_y"}


@dataclass(frozen=True, eq=False)
class FoundJoint:
    """Joint between two rigid bodies of a robot with frames.

    Attributes:
        joint: the joint, without the names of its bodies.
        rows: indices of its frames from the first to the second body.  They decrease if
            the first body is the child.
        bodies: numbers of the first and the second body.
    """

    joint: DrawnJoint
    rows: tuple[int, ...]
    bodies: tuple[int, int]


def found_joints(
    posture: Posture, bodies: RigidBodies, several: bool
) -> list[FoundJoint]:
    """Return the joints of a robot, in the order of its frames.

    Args:
        posture: the robot in its home pose.
        bodies: rigid bodies of the robot.
        several: whether frames may be combined into joints with several degrees of
            freedom.

    Returns:
        Joints.  Each frame that connects two bodies is part of one joint.
    """
    robot = posture.robot
    following = _following(posture, bodies) if several else {}
    found: list[FoundJoint] = []
    done: set[int] = set()
    names: set[str] = set()
    for i, frame in enumerate(robot.frames):
        if not connects(frame) or i in done:
            continue
        rows = [i]
        while rows[-1] in following and len(rows) < 3:
            rows.append(following[rows[-1]])
        options = (_several(posture, rows[:n]) for n in (3, 2) if len(rows) >= n)
        joint, rows = next(filter(None, options), None) or (_single(posture, i), [i])
        others = {f.name for k, f in enumerate(robot.frames) if k not in rows}
        if joint.name in names or others & {part.name for part in parts_of(joint)}:
            joint = replace(joint, name=frame.name)
        names.add(joint.name)
        found.append(FoundJoint(joint, tuple(rows), _ends(bodies, rows)))
        done |= set(rows)
    return found


def _ends(bodies: RigidBodies, rows: list[int]) -> tuple[int, int]:
    """Return the numbers of the first and the second body of a joint."""
    if rows[0] > rows[-1]:
        return bodies.after[rows[0]], bodies.before[rows[-1]]
    return bodies.before[rows[0]], bodies.after[rows[-1]]


def _following(posture: Posture, bodies: RigidBodies) -> dict[int, int]:
    """Return consecutive frames at one point that have no mass between them."""
    robot, size = posture.robot, size_of(posture.robot)
    held = Counter(bodies.before[robot.index(robot.platform)] for _ in range(2))
    for i, frame in enumerate(robot.frames):
        held.update({bodies.before[i]} if has_mass(frame) else ())
        if frame.link is not None:
            held.update((bodies.starts[i], bodies.before[i]))
        if connects(frame):
            held.update((bodies.before[i], bodies.after[i]))
    at = posture.transforms[:, :3, 3]
    free = [i for i, f in enumerate(robot.frames) if f.passive and f.limits is None]
    return {
        i: j
        for i in free
        for j in free
        if i != j
        and bodies.after[i] == bodies.before[j] != 0
        and held[bodies.after[i]] == 2
        and np.abs(at[i] - at[j]).max() <= _SAME * size
    }


def has_mass(body: Frame | DrawnBody) -> bool:
    """Return whether a body has a mass or moments of inertia."""
    return bool(body.mass or body.inertia.any())


def _single(posture: Posture, i: int) -> DrawnJoint:
    """Return the joint that consists of one frame."""
    frame, T = posture.robot.frames[i], posture.transforms[i]
    return DrawnJoint(
        frame.name, frame.joint, "", "", T[:3, 3], T[:3, 2], T[:3, 0], T[:3, 0],
        frame.actuated, float(posture.coordinates[i]), frame.limits, frame.pitch,
        (_numbers(frame),),
    )  # fmt: skip


def _numbers(frame: Frame) -> JointNumbers:
    """Return the error, clearance and stiffness of a frame in its axes."""
    bolt, error = frame.locked_at, frame.geometric_error
    if bolt is not None:  # format 2 describes the robot before joints are bolted
        if {"rx", "ry", "rz"} & set(bolt.pose):
            raise BadInput(
                f"frame {quoted(frame.name)}.locked_at: found a rotation of the "
                "platform, whose axes are different in format 2; expected only a "
                "translation, or joint coordinates"
            )
        bolt, error = replace(bolt, screw=np.zeros(6)), error - bolt.screw
    return JointNumbers(
        frame.clearance, frame.joint_stiffness, error, frame.tolerance, locked_at=bolt
    )


def _several(posture: Posture, rows: list[int]) -> tuple[DrawnJoint, list[int]] | None:
    """Return the joint that two or three frames form, or None."""
    frames = [posture.robot.frames[i] for i in rows]
    kinds = tuple(frame.joint for frame in frames)
    axes = [posture.transforms[i][:3, :3] for i in rows]
    z = [R[:, 2] for R in axes]
    across = [float(a @ b) for a, b in pairwise(z)]
    right = all(abs(cosine) < _SAME for cosine in across)
    own = [_numbers(frame) for frame in frames]
    if kinds == _TURNS and abs(across[0]) < np.cos(_PARALLEL):
        found = _universal(axes, own)
    elif kinds == (*_TURNS, "revolute") and right:
        bounds: Sequence[str] = ("radial", "axial", "ball")
        back = _isotropic(own[-1]) and all(map(_empty, own[:-1]))
        ball = (axes[::-1], own[::-1]) if back else (axes, own)
        found = _with_one_contact("spherical", *ball, bounds)
    elif set(kinds) == {"revolute", "prismatic"} and len(kinds) == 2:
        same = np.abs(z[0] - z[1]).max() < _SAME
        bounds = ("radial", "tilt")
        found = _with_one_contact("cylindrical", axes, own, bounds) if same else None
    elif kinds == ("prismatic", "prismatic", "revolute"):
        flat = abs(across[0]) < _SAME and np.abs(np.cross(*z[:2]) - z[2]).max() < _SAME
        empty = flat and all(map(_empty, own))
        found = ("planar", axes[2], (JointNumbers(),)) if empty else None
    else:
        found = None
    if found is None:
        return None
    kind, R, numbers = found
    name = _common_name(posture.robot, rows)
    if R is not axes[0] and kind == "spherical":
        rows = rows[::-1]  # the last frame, with the clearance, becomes the first
    second = R[:, 0] if kind != "universal" else z[1]
    joint = DrawnJoint(
        name, kind, "", "", posture.transforms[rows[0]][:3, 3], R[:, 2],
        perpendicular(R[:, 2], second), second, numbers=numbers,
    )  # fmt: skip
    return joint, rows


_Found = tuple[str, NDArray, tuple[JointNumbers, ...]] | None


def _universal(axes: list[NDArray], own: list[JointNumbers]) -> _Found:
    """Return a universal joint with equal properties, or None."""
    z = [R[:, 2] for R in axes]
    numbers = []
    for k, other in ((0, 1), (1, 0)):
        x = perpendicular(z[k], z[other])
        new = np.column_stack([x, np.cross(z[k], x), z[k]])
        turned = _turned(own[k], new.T @ axes[k])
        if turned is None:
            return None
        numbers.append(turned)
    return "universal", axes[0], tuple(numbers)


def _turned(own: JointNumbers, R: NDArray) -> JointNumbers | None:
    """Express properties in axes that are rotated about z; None if impossible."""
    if np.abs(R - np.eye(3)).max() < _SAME:
        return own
    turn = np.kron(np.eye(2), R)
    K, sigma = own.stiffness, own.tolerance
    if sigma is not None and (sigma[0] != sigma[1] or sigma[3] != sigma[4]):
        return None
    if K is not None:
        rigid = np.isinf(np.diag(K))
        if rigid[0] != rigid[1] or rigid[3] != rigid[4]:
            return None
        K = turn @ np.where(np.isinf(K), 0.0, K) @ turn.T
        K = (K + K.T) / 2
        K[np.abs(K) < _SAME * np.abs(K).max()] = 0.0
        K[np.diag(rigid)] = np.inf
    return replace(own, stiffness=K, error=turn @ own.error)


def _with_one_contact(
    kind: str, axes: list[NDArray], own: list[JointNumbers], bounds: Sequence[str]
) -> _Found:
    """Return a joint if only its first frame has an error, clearance or spring."""
    if not all(map(_empty, own[1:])):
        return None
    clearance = own[0].clearance or Clearance()
    given = [key for key, bound in vars(clearance).items() if bound is not None]
    if not set(given) <= set(bounds):
        return None
    K = own[0].stiffness
    if K is not None:
        free = [0, 1, 2] if kind == "spherical" else [2, 5]
        others = K[free].copy()
        for row, k in enumerate(free):
            if K[k, k] not in (0.0, np.inf):
                return None
            others[row, k] = 0.0
        if others.any():
            return None
        K = K.copy()
        K[free, free] = 0.0
    return kind, axes[0], (replace(own[0], stiffness=K),)


def _isotropic(own: JointNumbers) -> bool:
    """Return whether the properties of a frame are symmetric about z."""
    K = own.stiffness
    even = K is None or (
        not (np.where(np.isinf(K), 0.0, K) - np.diag(np.where(
            np.isinf(np.diag(K)), 0.0, np.diag(K)))).any() and K[3, 3] == K[4, 4]
    )  # fmt: skip
    given = own.clearance is not None or K is not None
    return given and even and own.tolerance is None and not own.error.any()


def _empty(own: JointNumbers) -> bool:
    """Return whether a frame has no error, clearance, spring or tolerance."""
    return (
        own.clearance is None and own.stiffness is None and own.tolerance is None
        and not own.error.any()
    )  # fmt: skip


def _common_name(robot: Robot, rows: list[int]) -> str:
    """Return the common prefix of frame names, or the first name."""
    names = [robot.frames[i].name for i in rows]
    stems = {name.rpartition(".")[0] for name in names}
    if {name.rpartition(".")[2] for name in names} <= _PARTS and len(stems) == 1:
        return stems.pop()
    others = {f.name for f in robot.frames if connects(f)}
    common = "".join(_while_equal(names)).rstrip("._-")
    taken = not common or common in others
    return names[0] if taken or names[0].startswith(f"{common}.") else common


def _while_equal(names: list[str]) -> Iterator[str]:
    """Yield the letters of the common prefix of names."""
    for letters in zip(*names, strict=False):
        if len(set(letters)) > 1:
            return
        yield letters[0]
