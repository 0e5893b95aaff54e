"""Model a pin in two bushes instead of independent bounds on translation and tilt.

In the paper, the translation |(TX, TY)| <= c and the tilt |(RX, RY)| <= t of a pin have
independent bounds.  For a pin in two bushes of clearance c, at z = +-h with h = c / t,
the position of the pin's axis is bounded in each bush:

    |(TX + h RY, TY - h RX)| <= c   and   |(TX - h RY, TY + h RX)| <= c

A motion that satisfies these bounds also satisfies the paper's bounds. A motion that
satisfies the paper's bounds with half the clearances satisfies these bounds. Therefore,
the energy with bushes is at least the energy with the paper's bounds, and at most the
energy with the paper's bounds and half the clearances. The margin of the assembly zone
with bushes is at most twice the margin with the paper's bounds.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.linear.assembled import Assembly
from forcefit.assembly.linear.closure import VirtualJoints, linearise, virtual_joints
from forcefit.assembly.linear.load import loads_on_frames
from forcefit.assembly.linear.reference.energy import solve_with


def bush_joints(joints: VirtualJoints) -> VirtualJoints:
    """Return virtual joints with two bushes for each pin with clearance and tilt.

    Args:
        joints: virtual joints with the paper's bounds.

    Returns:
        The virtual joints with the bounds of bushes.
    """
    cones = joints.cones.copy()
    # Each column of the matrix contains a single nonzero entry, the inverse of a bound.
    rows = np.abs(joints.cones).argmax(axis=0)
    column = {int(row): k for k, row in enumerate(rows)}
    for i in range(len(joints.robot.frames)):
        if not all(6 * i + r in column for r in (0, 1, 3, 4)):
            continue
        tilt_x, tilt_y, shift_x, shift_y = (column[6 * i + r] for r in (0, 1, 3, 4))
        c, t = joints.cones[6 * i + 3, shift_x], joints.cones[6 * i, tilt_x]
        for first, second, side in ((shift_x, shift_y, 1.0), (tilt_x, tilt_y, -1.0)):
            cones[:, [first, second]] = 0.0
            cones[6 * i + 3, first] = cones[6 * i + 4, second] = c / 2
            cones[6 * i + 1, first] = side * t / 2
            cones[6 * i, second] = -side * t / 2
    return replace(joints, cones=cones)


def solve_bushes(posture: Posture, load: ArrayLike | None = None) -> Assembly:
    """Return the minimum-energy assembly with each pin in two bushes.

    Args:
        posture: the robot's configuration.  Limits of passive joints are ignored.
        load: (6,) [N m, N] load on the platform at its origin, base axes.

    Returns:
        The assembly.  Its ``clearance_excess`` is computed with the paper's bounds.

    Raises:
        CannotAssemble: no motion of the virtual joints closes the kinematic loops.
        FreeMotion: the load acts along a motion without stiffness.
        SolverFailed: the cone solver failed.
    """
    wrench = np.zeros(6) if load is None else np.array(load, dtype=float)
    joints = bush_joints(virtual_joints(posture.robot))
    return solve_with(
        linearise(posture), joints, wrench, loads_on_frames(posture, wrench)
    )
