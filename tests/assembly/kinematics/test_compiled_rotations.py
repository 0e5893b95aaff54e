"""Rotations of compiled continuation, against SciPy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.kinematics.compiled_rotations import rotation_between, rotation_log


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 1.5, 1.6, 3.0, np.pi - 1e-9])
def test_the_rotation_between_two(angle, rng):
    """Near none, beyond a quarter turn, near half a turn."""
    axis = rng.standard_normal(3)
    turn = angle * axis / np.linalg.norm(axis)
    B = Rotation.random(random_state=1).as_matrix()
    A = Rotation.from_rotvec(turn).as_matrix() @ B
    between = np.zeros(5)
    rotation_between(A[None], 0, np.stack([A, B]), 1, between, 1)
    assert between[1:4] == pytest.approx(turn, rel=1e-9, abs=1e-15)
    assert between[[0, 4]] == pytest.approx(0.0, abs=0)
    assert rotation_log(A @ B.T) == pytest.approx(turn, rel=1e-9, abs=1e-15)


def test_what_is_no_number_stays_none():
    between = np.zeros(3)
    nowhere = np.full((1, 3, 3), np.nan)
    rotation_between(np.eye(3)[None], 0, nowhere, 0, between, 0)
    assert np.isnan(between).all()
