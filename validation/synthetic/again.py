"""A simulated machine commanded again: how far it stands from where it should.

The distance is measured at the machine, without noise and without what the measuring
device adds, so that a correction is judged by something that it was not fitted to.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.model.robot import Robot
from stiffness.screws import rotation_matrix, rotation_vector
from validation.campaign.campaign import Campaign
from validation.synthetic.effects import Row
from validation.synthetic.machine import (
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
    """Return how far a machine stands from the poses wanted.

    Args:
        robot: declared.
        effects: that the machine has; those of the device alone do not count.
        targets: commands at which the nominal robot would stand as wanted.
        coordinates: (R, n) [rad or m] nominal coordinates of what is commanded.
        program: that simulates.

    Returns:
        (R, 2) distance of the reference points [m], and angle [rad].
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
