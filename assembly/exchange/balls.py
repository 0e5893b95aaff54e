"""Conversion of ball joints to three rotations that are zero at the home pose."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.exchange.mechanism import Joint, motion


def balls_at_rest(joints: tuple[Joint, ...]) -> tuple[Joint, ...]:
    """Return joints in which passive ball joints have zero coordinates at home.

    A ball joint consists of three rotations, which lose a degree of freedom if the
    second angle is 90 degrees. The rotation at home is therefore included in the
    placement of the joint.

    Args:
        joints: joints at home.

    Returns:
        Joints in the same pose.  Only the coordinates of ball joints that were
        converted to three consecutive rotations are changed.
    """
    at_rest = list(joints)
    for i in range(len(joints) - 2):
        turns = joints[i : i + 3]
        if _is_ball(turns) and any(turn.position for turn in turns):
            T = joints[i].placement
            for turn in turns:
                T = T @ motion(turn, turn.position)
            at_rest[i : i + 3] = (replace(turn, position=0.0) for turn in turns)
            at_rest[i] = replace(at_rest[i], placement=T)
    return tuple(at_rest)


def _is_ball(turns: tuple[Joint, ...]) -> bool:
    """Return whether three joints are the rotations of a file's passive ball joint."""
    name = turns[0].name.removesuffix(".rx")
    made = {f"{name}.after_rx", f"{name}.rx.after"}  # names from chain() and from MJCF
    return (
        turns[0].child in made
        and [turn.name for turn in turns] == [f"{name}.r{axis}" for axis in "xyz"]
        and all(turn.kind == "revolute" and not turn.actuated for turn in turns)
        and all(np.array_equal(turn.placement, np.eye(4)) for turn in turns[1:])
    )
