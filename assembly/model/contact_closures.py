"""Closures between parallel contacts of one joint.

A guide or a pad is modelled by two chains between the same two bodies
(:mod:`forcefit.assembly.drawing.contacts`).  Each chain consists of fixed frames with
clearances, and a closure connects the ends of both chains.  This closure is not a loop
of the mechanism.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Frame, Robot


@lru_cache(maxsize=64)
def contact_closures(robot: Robot) -> NDArray:
    """Identify the closures between contacts of the same joint.

    Args:
        robot: robot whose closures are classified.

    Returns:
        Mask (closures,), True if the two frames of the closure can move relative to
        each other only within clearances, at least one of which is unbounded.
    """
    found = [_joins_contacts(robot, *pair) for pair in robot.closures]
    marks = np.array(found, dtype=bool)
    marks.setflags(write=False)
    return marks


@lru_cache(maxsize=64)
def contact_frames(robot: Robot) -> frozenset[str]:
    """Return the names of the frames in both chains of each contact closure."""
    pairs = zip(robot.closures, contact_closures(robot), strict=True)
    chains = [_apart(robot, *pair) for pair, of_contacts in pairs if of_contacts]
    return frozenset(frame.name for chain in chains for frame in chain)


def _apart(robot: Robot, first: str, second: str) -> list[Frame]:
    """Return the frames on the path from the base to exactly one of two frames."""
    paths = robot.on_path[[robot.index(first), robot.index(second)]]
    return [robot.frames[i] for i in np.flatnonzero(paths[0] != paths[1])]


def _joins_contacts(robot: Robot, first: str, second: str) -> bool:
    """Return whether a closure connects two contacts of the same joint."""
    apart = _apart(robot, first, second)
    return all(map(_moves_by_clearance, apart)) and any(map(_is_unbounded, apart))


def _is_unbounded(frame: Frame) -> bool:
    """Return whether the frame has an unbounded clearance."""
    return frame.clearance is not None and np.inf in vars(frame.clearance).values()


def _moves_by_clearance(frame: Frame) -> bool:
    """Return whether clearance is the only motion of a frame."""
    others = frame.locked_at, frame.link, frame.joint_stiffness
    return frame.joint == "fixed" and all(other is None for other in others)


def loops(robot: Robot) -> tuple[tuple[str, str], ...]:
    """Return the closures of the mechanism, excluding those between contacts."""
    pairs = zip(robot.closures, contact_closures(robot), strict=True)
    return tuple(closure for closure, of_contacts in pairs if not of_contacts)
