"""Compute the distance of a simulated machine from its target poses.

The true poses are used, without noise and device errors.  The distance therefore tests
corrected commands independently of the readings from which they were computed.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.model.robot import Robot
from forcefit.stiffness.screws import rotation_matrix, rotation_vector
from forcefit.validation.campaign.campaign import Campaign
from forcefit.validation.synthetic.effects import Row
from forcefit.validation.synthetic.machine import (
    Hidden,
    acts_on_machine,
    nominal_pose,
    simulate_readings,
    with_point,
)


def distances(
    robot: Robot,
    effects: Sequence[Hidden],
    targets: Campaign,
    coordinates: NDArray,
    program: str = "multibody",
) -> NDArray:
    """Return the distance between the true pose and the target pose of each command.

    Args:
        robot: the declared robot.
        effects: effects of the machine.  Effects that change only the readings are
            ignored.
        targets: commands at which the nominal robot reaches the target poses.
        coordinates: (R, n) [rad or m] joint coordinates of the nominal robot for the
            commands.
        program: name of the simulation program.

    Returns:
        Distance between actual and target reference point [m], and angle between actual
        and target orientation [rad], (R, 2).
    """
    names = [frame.name for frame in robot.frames]

    def rows(q: NDArray) -> list[Row]:
        return [
            Row(
                dict(zip(names, q[i].tolist(), strict=True)), targets.loads[i],
                {name: float(x[i]) for name, x in targets.covariates.items()},
            )
            for i in range(len(q))
        ]  # fmt: skip

    acting = [effect for effect in effects if acts_on_machine(effect.name)]
    point = targets.reference_point
    commanded = rows(coordinates)
    read = simulate_readings(robot, point, commanded, acting, program)
    pointed = with_point(robot, point)
    stands = np.array([nominal_pose(pointed, row) for row in commanded])
    wanted = np.array([nominal_pose(pointed, row) for row in rows(targets.coordinates)])
    R = rotation_matrix(read[:, :3]) @ stands[:, :3, :3]
    turn = rotation_vector(wanted[:, :3, :3] @ np.swapaxes(R, 1, 2))
    shift = wanted[:, :3, 3] - stands[:, :3, 3] - read[:, 3:]
    return np.column_stack([
        np.linalg.norm(shift, axis=1),
        np.linalg.norm(turn, axis=1),
    ])
