"""Mesh links put into place: rotations from mesh axes to frame axes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from assembly.mesh_link import mesh_rotation
from stiffness.screws import rotation_vector

numbers = st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(
    lambda v: np.linalg.norm(v) > 1e-3
)


@given(a=numbers, b=numbers)
def test_the_rotation_lays_one_span_along_the_other_and_is_the_smallest(a, b):
    a, b = np.array(a), np.array(b)
    R = mesh_rotation(a, b)
    assert np.allclose(R @ a / np.linalg.norm(a), b / np.linalg.norm(b), atol=1e-9)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
    angle = np.linalg.norm(rotation_vector(R))
    assert np.cos(angle) == pytest.approx(np.clip(cosine, -1, 1), abs=1e-9)


@pytest.mark.parametrize("b", [[0, 0, 2.0], [0, 0, -2.0]])
def test_parallel_and_opposite_spans(b):
    R = mesh_rotation(np.array([0, 0, 0.5]), np.array(b))
    assert np.allclose(R @ [0, 0, 1], np.array(b) / 2, atol=1e-15)


def test_up_fixes_the_roll():
    """Mesh z along the frame's x, mesh x up along the frame's z: worked by hand."""
    R = mesh_rotation(
        np.array([0, 0, 1.0]), np.array([2.0, 0, 0]), (1, 0, 0), (0, 0, 1)
    )
    assert np.allclose(R, [[0, 0, 1], [0, 1, 0], [1, 0, 0]] @ np.diag([1, -1, 1]))
    assert np.allclose(R @ [1, 0, 0], [0, 0, 1])
    assert np.allclose(R @ [0, 0, 1], [1, 0, 0])
