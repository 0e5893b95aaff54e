"""Closures between parallel contacts of one joint, which are no loops of a mechanism.

A guide and a pad are two chains of fixed frames with clearances between the same two
bodies (:mod:`forcefit.assembly.drawing.contacts`).  A closure joins the ends of the chains.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Frame, Robot


@lru_cache(maxsize=64)
def contact_closures(robot: Robot) -> NDArray:
    """Return which closures join the contacts of one joint.

    Args:
        robot: any robot.

    Returns:
        (closures,) bool: whether nothing but clearances moves the two frames of the
        closure against each other, and one of these clearances has no bound.
    """
    found = [_joins_contacts(robot, *pair) for pair in robot.closures]
    marks = np.array(found, dtype=bool)
    marks.setflags(write=False)
    return marks


def _joins_contacts(robot: Robot, first: str, second: str) -> bool:
    """Whether the chains to two frames consist of clearances, one without a bound."""
    paths = robot.on_path[[robot.index(first), robot.index(second)]]
    apart = [robot.frames[i] for i in np.flatnonzero(paths[0] != paths[1])]
    unbounded = any(
        bound is not None and np.isinf(bound)
        for frame in apart if frame.clearance for bound in vars(frame.clearance).values()
    )  # fmt: skip
    return unbounded and all(map(_moves_by_clearance, apart))


def _moves_by_clearance(frame: Frame) -> bool:
    """Whether nothing moves a frame against its parent but its clearance."""
    moved = frame.joint != "fixed", frame.locked_at, frame.link, frame.joint_stiffness
    return not any(one is not None and one is not False for one in moved)


def loops(robot: Robot) -> tuple[tuple[str, str], ...]:
    """Return the closures of the mechanism, without those of contacts."""
    pairs = zip(robot.closures, contact_closures(robot), strict=True)
    return tuple(closure for closure, of_contacts in pairs if not of_contacts)


def without_contact_closures(robot: Robot) -> Robot:
    """Return the robot without the closures of contacts; itself if it has none."""
    if not contact_closures(robot).any():
        return robot
    return replace(robot, closures=loops(robot))
