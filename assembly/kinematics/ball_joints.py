"""Detect ball joints that are modelled as three revolute frames.

In the home pose, the three axes are at right angles.  If the middle joint rotates by 90
degrees, two axes coincide, and the model loses a degree of freedom.  A real ball joint
has no such singularity.  Such frames are therefore treated as a ball joint at every
posture.
"""

from collections import Counter
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import size_of
from forcefit.assembly.model.robot import Robot
from forcefit.stiffness.screws import rotation_matrix

# largest accepted distance between intersecting axes [reference lengths], and largest
# accepted cosine of a right angle
_SAME = 1e-9


@lru_cache(maxsize=64)
def ball_joints(robot: Robot) -> tuple[tuple[int, int, int], ...]:
    """Return the indices of three revolute frames that form a ball joint.

    Args:
        robot: any robot.

    Returns:
        Three indices for each ball joint.  The frames are passive and without springs,
        each is the only child of the previous frame, their axes pass through one point,
        and adjacent axes are at right angles.  The bodies between them have no mass,
        link, closure or platform.
    """
    children = Counter(f.parent for f in robot.frames)
    used = {robot.platform, *(name for pair in robot.closures for name in pair)}
    bare = {f.name for f in robot.frames if children[f.name] == 1} - used
    least = _SAME * size_of(robot)

    def follows(i: int) -> bool:
        frame = robot.frames[i]
        tilted = rotation_matrix(frame.rotation)[2, 2]
        return (
            frame.parent in bare and _turns(robot, i) and not frame.mass
            and not frame.inertia.any() and frame.link is None
            and bool(np.abs(frame.translation).max() <= least)
            and abs(tilted) <= _SAME
        )  # fmt: skip

    found: list[tuple[int, int, int]] = []
    for k in range(len(robot.frames)):
        j = robot.parents[k]
        i = robot.parents[j] if j >= 0 else -1
        if i < 0 or any(row in ball for ball in found for row in (i, j)):
            continue
        if _turns(robot, i) and follows(j) and follows(k):
            found.append((int(i), int(j), k))
    return tuple(found)


def _turns(robot: Robot, i: int) -> bool:
    """Return whether the joint of a frame rotates freely, without spring or drive."""
    frame = robot.frames[i]
    return frame.joint == "revolute" and frame.passive and not frame.compliant


def with_balls(robot: Robot, T: NDArray, screws: NDArray) -> NDArray:
    """Replace the joint screws of ball joints by rotations about the base axes.

    Args:
        robot: robot of n frames.
        T: (n, 4, 4) frames seen from the base.
        screws: (n, 6) screws of unit joint motions, at the base's origin.

    Returns:
        (n, 6) screws with three independent rotations for every ball joint.
    """
    screws = screws.copy()
    for ball in ball_joints(robot):
        screws[list(ball), :3] = np.eye(3)
        screws[list(ball), 3:] = np.cross(T[ball[0], :3, 3], np.eye(3))
    return screws
