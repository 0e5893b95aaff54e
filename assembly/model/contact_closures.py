"""Closures between parallel contacts of one joint, which are no loops of a mechanism.

A guide and a pad are two chains of fixed frames with clearances between the same two
bodies (:mod:`forcefit.assembly.drawing.contacts`).  A closure joins the ends of the
chains.
"""

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


@lru_cache(maxsize=64)
def contact_frames(robot: Robot) -> frozenset[str]:
    """Return the names of the frames in the two chains of every such closure."""
    pairs = zip(robot.closures, contact_closures(robot), strict=True)
    chains = [_apart(robot, *pair) for pair, of_contacts in pairs if of_contacts]
    return frozenset(frame.name for chain in chains for frame in chain)


def _apart(robot: Robot, first: str, second: str) -> list[Frame]:
    """Frames on the path to one of two frames, but not on that to the other."""
    paths = robot.on_path[[robot.index(first), robot.index(second)]]
    return [robot.frames[i] for i in np.flatnonzero(paths[0] != paths[1])]


def _joins_contacts(robot: Robot, first: str, second: str) -> bool:
    """Whether the chains to two frames consist of clearances, one without a bound."""
    apart = _apart(robot, first, second)
    return all(map(_moves_by_clearance, apart)) and any(map(_is_unbounded, apart))


def _is_unbounded(frame: Frame) -> bool:
    """Whether a clearance of a frame has no bound."""
    return frame.clearance is not None and np.inf in vars(frame.clearance).values()


def _moves_by_clearance(frame: Frame) -> bool:
    """Whether nothing moves a frame against its parent but its clearance."""
    others = frame.locked_at, frame.link, frame.joint_stiffness
    return frame.joint == "fixed" and all(other is None for other in others)


def loops(robot: Robot) -> tuple[tuple[str, str], ...]:
    """Return the closures of the mechanism, without those of contacts."""
    pairs = zip(robot.closures, contact_closures(robot), strict=True)
    return tuple(closure for closure, of_contacts in pairs if not of_contacts)
