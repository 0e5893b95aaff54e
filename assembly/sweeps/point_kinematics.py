"""Results at the points of a sweep that depend only on the nominal geometry.

These are joint coordinates, distances to singularities, and a status. The status
reports singular postures, postures outside joint limits, and postures that are
separated from the home posture by a singularity.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forcefit.assembly.kinematics.nominal import Target, mobile
from forcefit.assembly.kinematics.posture import Posture
from forcefit.assembly.kinematics.singularity import KINDS, find_singularities
from forcefit.assembly.kinematics.verdict import verdicts
from forcefit.assembly.model.robot import Robot
from forcefit.assembly.sweeps.quantities import Question
from forcefit.assembly.sweeps.targets import of_joints

# distance to a singularity below which more tests are performed
_NEAR = 1e-4


def note_geometry(
    question: Question, robot: Robot, goals: NDArray, postures: Sequence[Posture],
    rows: Sequence[range], records: NDArray, near_singularity: dict[int, str],
) -> list[tuple[str, str]]:  # fmt: skip
    """Store joint coordinates and distances to singularities, and return the status.

    Args:
        question: quantities of the sweep.
        robot: robot of the design.
        goals: poses (k, 6) or joint coordinates (k, n) of the k postures.
        postures: the reachable postures.
        rows: for each posture, the indices of its records.
        records: records of the points, which are modified.
        near_singularity: names of nearby singularities by index of the record, which
            are modified.

    Returns:
        Status and reason for each posture, as in
        :func:`forcefit.assembly.kinematics.verdict.verdicts`.
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
