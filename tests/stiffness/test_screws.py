"""Tests of screws and wrenches."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.stiffness.screws import (
    rotation_matrix,
    rotation_vector,
    screw_map,
)


def test_rotation_about_z_moves_a_point_on_the_x_axis_along_y():
    """For p = q + x, the offset is q - p = -x, and t_p = t_q + r x (p - q) = z x x =
    y."""
    moved = screw_map([-1.0, 0, 0]) @ [0, 0, 1e-3, 0, 0, 0]
    np.testing.assert_allclose(moved, [0, 0, 1e-3, 0, 1e-3, 0], atol=0)


def test_power_of_a_wrench_does_not_depend_on_the_reference_point(rng):
    """The transposed matrix transforms wrenches in the opposite direction."""
    A = screw_map(rng.normal(size=3), rotation_matrix(rng.normal(size=3)))
    screw, wrench = rng.normal(size=(2, 6))
    assert (A.T @ wrench) @ screw == pytest.approx(wrench @ (A @ screw), rel=1e-13)


def test_moment_of_a_force_equals_lever_arm_times_force():
    """A force along y at p = x has the moment mz = 1 about q = 0."""
    wrench_at_q = screw_map([-1.0, 0, 0]).T @ [0, 0, 0, 0, 1.0, 0]
    np.testing.assert_allclose(wrench_at_q, [0, 0, 1, 0, 1, 0], atol=0)


def test_product_of_two_screw_maps_is_the_map_of_the_composed_motion(rng):
    a, b = rng.normal(size=(2, 3))
    R, S = rotation_matrix(rng.normal(size=(2, 3)))
    np.testing.assert_allclose(
        screw_map(b, S) @ screw_map(a, R), screw_map(b + S @ a, S @ R), atol=1e-14
    )


@pytest.mark.parametrize("size", [1e-6, 1e-4, 1.0])
def test_small_screws_are_derivatives_of_finite_motions(rng, size):
    """The error is of second order."""
    turn, point = size * rng.normal(size=3), rng.normal(size=3)
    moved = (rotation_matrix(turn) - np.eye(3)) @ point
    screw = screw_map(-point) @ np.r_[turn, 0, 0, 0]
    angle = np.linalg.norm(turn)
    assert np.linalg.norm(moved - screw[3:]) <= angle**2 * np.linalg.norm(point)


@pytest.mark.parametrize("angle", [1e-14, 1e-7, 1e-3, 0.5, 2.1, 3.1, np.pi - 1e-9])
def test_rotations_agree_with_scipy(rng, angle):
    """The results agree to machine precision."""
    axes = rng.normal(size=(200, 3))
    vectors = angle * axes / np.linalg.norm(axes, axis=-1)[:, None]
    matrices, theirs = rotation_matrix(vectors), Rotation.from_rotvec(vectors)
    np.testing.assert_allclose(matrices, theirs.as_matrix(), rtol=0, atol=5e-15)
    ours = rotation_vector(theirs.as_matrix())
    np.testing.assert_allclose(ours, vectors, rtol=0, atol=2e-14 * angle)


def test_rotation_vector_is_exact_for_half_turns_and_the_identity():
    """The scalar part or the vector part of the quaternion is zero."""
    for axis in (*np.eye(3), np.array([3, 0, -4]) / 5, np.array([1, 2, 2]) / 3):
        turn = 2 * np.outer(axis, axis) - np.eye(3)
        np.testing.assert_allclose(abs(rotation_vector(turn)), np.pi * abs(axis))
    assert not rotation_vector(np.eye(3)).any()
