"""Properties of a sweep's points that follow from the nominal geometry alone.

They are joint coordinates, distances to singularities, and whether the posture is
usable: within the joints' limits, regular, and on home's side of all singularities.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.kinematics.nominal import Target, mobile
from assembly.kinematics.posture import Posture
from assembly.kinematics.singularity import KINDS, find_singularities
from assembly.kinematics.verdict import verdicts
from assembly.model.robot import Robot
from assembly.sweeps.quantities import Question
from assembly.sweeps.targets import of_joints

_NEAR = 1e-4  # distance below which a posture is examined more closely


def note_geometry(
    question: Question, robot: Robot, goals: NDArray, postures: Sequence[Posture],
    rows: Sequence[range], records: NDArray, near_singularity: dict[int, str],
) -> list[tuple[str, str]]:  # fmt: skip
    """Record the geometry of postures; return which of them are not usable.

    Args:
        question: question of the sweep.
        robot: robot of the design.
        goals: (k, 6) or (k, n) of the k postures, as they were reached.
        postures: the postures reached.
        rows: indices of each posture's records.
        records: records of the points, to fill.
        near_singularity: by row, the names of nearby singularities, to fill.

    Returns:
        Status and reason of each, as :func:`assembly.kinematics.verdict.verdicts`.
    """
    if not postures:
        return []
    q = np.array([posture.coordinates for posture in postures])
    T = np.array([posture.transforms for posture in postures])
    found = find_singularities(robot, T)
    names, condition = found.names(robot, question.near), found.condition
    distances = np.stack([getattr(found, kind) for kind in KINDS], axis=1)
    for i, own in enumerate(rows):
        some = records[own.start : own.stop]
        some["joint_coordinate"] = q[i, mobile(robot)]
        some["singular_distance"], some["condition"] = distances[i], condition[i]
        if names[i]:
            near_singularity.update(dict.fromkeys(own, names[i]))
    joints = of_joints(question.components)
    target = Target(coordinates=goals) if joints else Target(goals)
    near = (found.parallel < _NEAR) | (found.closure < _NEAR)
    return verdicts(robot, target, q, T, near)
