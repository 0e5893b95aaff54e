"""Rotations against scipy's, and the Jacobian against differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly.kinematics.compiled_rotations import (
    inverse_left_jacobian,
    rotation_between,
    rotation_exp,
    rotation_log,
)

AXES = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, -0.48, 0.64)]
# about each axis the largest component of the quaternion is another
ANGLES = [1e-12, 1e-7, 1e-3, 0.7, 2.0, 3.0, np.pi - 1e-9]


@pytest.mark.parametrize("angle", [0.0, *ANGLES, 1.5, 1.6])
def test_the_rotation_between_two(angle, rng):
    """Near none, beyond a quarter turn, near half a turn."""
    axis = rng.standard_normal(3)
    turn = angle * axis / np.linalg.norm(axis)
    B = Rotation.random(random_state=1).as_matrix()
    A = Rotation.from_rotvec(turn).as_matrix() @ B
    between = np.zeros(5)
    rotation_between(A[None], 0, np.stack([A, B]), 1, between, 1)
    np.testing.assert_allclose(between[1:4], turn, rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(between[[0, 4]], 0.0)


def test_what_is_no_number_stays_none():
    between = np.zeros(3)
    nowhere = np.full((1, 3, 3), np.nan)
    rotation_between(np.eye(3)[None], 0, nowhere, 0, between, 0)
    assert np.isnan(between).all()


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("axis", AXES)
def test_vectors_and_matrices_are_scipys(axis, angle):
    r = angle * np.array(axis)
    R = Rotation.from_rotvec(r).as_matrix()
    np.testing.assert_allclose(rotation_exp(*r)[0], R, atol=3e-16)
    np.testing.assert_allclose(rotation_log(R), r, rtol=1e-13, atol=2e-16)
    np.testing.assert_allclose(rotation_log(R.T.copy()), -r, rtol=1e-13, atol=2e-16)


def test_no_turn_and_half_a_turn():
    np.testing.assert_array_equal(rotation_exp(0.0, 0.0, 0.0)[0], np.eye(3))
    np.testing.assert_array_equal(rotation_log(np.eye(3)), np.zeros(3))
    turn = rotation_log(np.diag([-1.0, 1.0, -1.0]))
    np.testing.assert_allclose(np.abs(turn), [0.0, np.pi, 0.0], atol=1e-15)


@pytest.mark.parametrize("r", [(0.3, -0.2, 0.5), (1.5, 1.0, -1.2), (1e-4, 0.0, 2e-4)])
def test_the_jacobian_is_the_change_of_the_vector_per_turn(r):
    """log(exp(t) R) by central differences, from scipy."""
    R, h = Rotation.from_rotvec(r), 1e-5
    slopes = np.stack(
        [
            ((Rotation.from_rotvec(h * e) * R).as_rotvec()
             - (Rotation.from_rotvec(-h * e) * R).as_rotvec()) / (2 * h)
            for e in np.eye(3)
        ],
        axis=1,
    )  # fmt: skip
    np.testing.assert_allclose(inverse_left_jacobian(*r)[0], slopes, atol=1e-9)


def test_of_no_turn_the_jacobian_is_one():
    np.testing.assert_allclose(
        inverse_left_jacobian(0.0, 0.0, 0.0)[0], np.eye(3), atol=1e-9
    )
