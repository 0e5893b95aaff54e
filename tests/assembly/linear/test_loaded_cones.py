"""Which clearances are held, by their loads and what is left to their rims."""

import numpy as np
import pytest

from assembly.kinematics.posture import home_posture
from assembly.linear.compiled_reach import ClearanceLoads, loaded_cones
from assembly.linear.compiled_structure import paths_of
from assembly.linear.robot_structure import structure_of
from assembly.model.robot import Clearance
from tests.robots_for_tests import coaxial_beams

RADIUS = 1e-3


def judged(force, reach):
    """A pin in a hole pressed with a force [N] at so much of its radius; energy 1 J."""
    robot = coaxial_beams([0.0] * 6, clearance=Clearance(radial=RADIUS))
    structure, posture = structure_of(robot)[1], home_posture(robot)
    assert structure.starts.tolist() == [0, 2]
    assert structure.cone_size == pytest.approx([RADIUS, RADIUS])
    P = paths_of(posture.transforms, structure)
    # multipliers of the scaled closures: of x, what the cone's columns feel is this
    row = np.zeros(6 * len(robot.closures))
    columns = [P[structure.cone_frame[0], axis] for axis in structure.cone_axis]
    row[3] = force / abs(columns[0][3])
    loads = ClearanceLoads(
        structure=structure,
        multipliers=row[None],
        clearances=np.array([[0.6, 0.8]]) * reach,
        energy=np.ones(1),
        without_clearance=np.ones(1),
        cone_of=np.zeros(1, np.int64),
    )
    decided, loaded = loaded_cones(loads, P, 0)
    return bool(decided), bool(loaded[0])


@pytest.mark.parametrize(
    ("force", "reach", "expected"),
    [
        # load force x radius over energy, slack 1 - reach; apart by a hundred
        (1.0, 1.0, (True, True)),
        (1.0, 1.0 - 0.9e-5, (True, True)),
        (1.0, 1.0 - 1.1e-5, (False, True)),
        (1.0, 1.0 - 0.9e-3, (False, True)),
        (1.0, 1.0 - 1.1e-3, (False, False)),
        (1.0, 0.85, (True, False)),
        (0.0, 0.0, (True, False)),
        (0.0, 1.0, (True, False)),
        # both are rounding: nothing holds it, and that is no doubt
        (0.5e-6, 1.0 - 0.5e-9, (True, False)),
        (1.0, np.nan, (False, False)),
        (np.nan, 0.5, (False, False)),
    ],
)
def test_held_free_or_in_doubt_by_a_factor_of_a_hundred(force, reach, expected):
    assert judged(force, reach) == expected
