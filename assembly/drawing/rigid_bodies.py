"""Rigid bodies of a robot with frames and closures.

Frames without relative motion form one body.  Two bodies are connected by a joint, by a
fixed frame with an error, clearance or spring, or by a link.
"""

from dataclasses import dataclass

from forcefit.assembly.model.robot import Frame, Robot
from forcefit.inputs.table import BadInput, quoted


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Numbers of the rigid bodies of a robot; the base has the number 0.

    Attributes:
        before: parent body of the joint of each frame.
        after: child body of the joint of each frame.
        starts: body at the start of the link of each frame; ``before`` without a link.
    """

    before: tuple[int, ...]
    after: tuple[int, ...]
    starts: tuple[int, ...]


def connects(frame: Frame) -> bool:
    """Return whether a frame connects two different rigid bodies."""
    return (
        frame.joint != "fixed"
        or frame.clearance is not None
        or frame.locked_at is not None
        or frame.joint_stiffness is not None
        or bool(frame.geometric_error.any())
        or frame.tolerance is not None
    )


def rigid_bodies(robot: Robot) -> RigidBodies:
    """Find the rigid bodies of a robot.

    Args:
        robot: robot with frames and closures.

    Returns:
        Rigid bodies.

    Raises:
        BadInput: a closure, joint or link connects a rigid body with itself.
    """
    count = len(robot.frames)
    # union-find structure of bodies before and after each joint, and the base
    group = list(range(2 * count + 1))

    def root(node: int) -> int:
        while group[node] != node:
            group[node] = group[group[node]]
            node = group[node]
        return node

    def join(a: int, b: int) -> bool:
        a, b = root(a), root(b)
        group[max(a, b)] = min(a, b)
        return a != b

    start = [count + p if p >= 0 else 2 * count for p in robot.parents.tolist()]
    for i, frame in enumerate(robot.frames):
        if frame.link is None:
            join(start[i], i)
        if not connects(frame):
            join(i, count + i)
    for k, (a, b) in enumerate(robot.closures, 1):
        if not join(*(count + robot.index(name) for name in (a, b))):
            raise BadInput(_same(f'closure[{k}] ("{a}", "{b}")'))
    numbers = {root(2 * count): 0}
    found = [numbers.setdefault(root(n), len(numbers)) for n in range(2 * count)]
    starts = [numbers[root(node)] for node in start]
    for i, frame in enumerate(robot.frames):
        if connects(frame) and found[i] == found[count + i]:
            raise BadInput(_same(f"frame {quoted(frame.name)}"))
        if frame.link is not None and starts[i] == found[i]:
            raise BadInput(_same(f"frame {quoted(frame.name)}.link"))
    return RigidBodies(tuple(found[:count]), tuple(found[count:]), tuple(starts))


def _same(place: str) -> str:
    """Return the error message for a connection between frames of one body."""
    return (
        f"{place}: found a connection between two frames of the same rigid body, which "
        "a file with bodies and joints (format 2) cannot represent"
    )
