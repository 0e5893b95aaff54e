"""Conversion of joint springs that are unloaded in the home pose."""

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.exchange.mechanism import Joint, Mechanism
from forcefit.assembly.exchange.xml_file import counted

_AT_REST = 1e-9  # [rad or m] largest deflection of an unloaded spring
_OWN = {"revolute": 2, "prismatic": 5}  # screw component of the joint motion


def springs_at_rest(mechanism: Mechanism) -> dict[str, NDArray]:
    """Return the stiffness of passive joints with springs that are unloaded at home.

    Args:
        mechanism: mechanism in the home pose.

    Returns:
        Stiffness by joint name, (6, 6) [N m/rad .. N/m]. It is infinite in all
        directions except along the joint motion.
    """
    matrices = {}
    for joint in mechanism.joints:
        if _is_spring(joint) and not joint.actuated and _at_rest(joint):
            diagonal = np.full(6, np.inf)
            diagonal[_OWN[joint.kind]] = joint.stiffness
            matrices[joint.name] = np.diag(diagonal)
    return matrices


def other_springs(mechanism: Mechanism) -> tuple[str, ...]:
    """Return descriptions of springs that are not converted.

    Args:
        mechanism: mechanism in the home pose.

    Returns:
        A line about springs at drives and a line about springs that are loaded.
    """
    springs = [joint for joint in mechanism.joints if _is_spring(joint)]
    driven = [joint.name for joint in springs if joint.actuated]
    loaded = [
        f"{joint.name} by {joint.position - joint.rest:.3g} rad or m"
        for joint in springs
        if not joint.actuated and not _at_rest(joint)
    ]
    what = "springs preloaded at home, not converted, though they may carry load"
    return counted("springs parallel to drives", driven) + counted(what, loaded)


def _is_spring(joint: Joint) -> bool:
    """Return whether a joint has a spring along its motion."""
    return joint.stiffness > 0 and joint.kind in _OWN


def _at_rest(joint: Joint) -> bool:
    """Return whether the spring of a joint is unloaded in the home pose."""
    return abs(joint.position - joint.rest) < _AT_REST
