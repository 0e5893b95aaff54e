"""Ball joints as three rotations whose angles are zero in the home pose."""

from dataclasses import replace

import numpy as np

from forcefit.assembly.exchange.mechanism import Joint, motion


def balls_at_rest(joints: tuple[Joint, ...]) -> tuple[Joint, ...]:
    """Set the coordinates of passive ball joints to zero in the home pose.

    A ball joint consists of three rotations, which are singular if the second angle is
    90 degrees.  The rotation in the home pose is therefore included in the placement of
    the joint.

    Args:
        joints: joints in the home pose.

    Returns:
        Joints in the same pose, with changed coordinates of the ball joints.
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
    """Return whether three joints represent one passive ball joint."""
    name = turns[0].name.removesuffix(".rx")
    # names that chain() and the MJCF reader give to the first intermediate body
    made = {f"{name}.after_rx", f"{name}.rx.after"}
    return (
        turns[0].child in made
        and [turn.name for turn in turns] == [f"{name}.r{axis}" for axis in "xyz"]
        and all(turn.kind == "revolute" and not turn.actuated for turn in turns)
        and all(np.array_equal(turn.placement, np.eye(4)) for turn in turns[1:])
    )
