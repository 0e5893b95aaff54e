"""Triangles that cut each other, against edge and triangle as a linear system."""

import numpy as np
import pytest

from forcefit.inputs.table import BadInput
from stiffness.surface.interface import parse_interface
from stiffness.surface.intersections import crossing_triangles


def crosses(one, other):
    """Whether an edge of one triangle meets the inside of the other."""
    a, b, c = other
    for k in range(3):
        p, q = one[k], one[(k + 1) % 3]
        # p + t (q - p) = a + u (b - a) + v (c - a)
        t, u, v = np.linalg.solve(np.column_stack([p - q, b - a, c - a]), p - a)
        if 0 < t < 1 and u > 0 and v > 0 and u + v < 1:
            return True
    return False


def test_random_triangles_cut_each_other_where_a_linear_system_says_so(rng):
    """Far from the origin too, where sums of corners are no differences."""
    for away in (np.zeros(3), np.array([5.0, -3.0, 2.0])):
        corners = away + rng.normal(size=(40, 3, 3)) + rng.normal(size=(40, 1, 3))
        triangles = np.arange(120).reshape(40, 3)
        pairs = crossing_triangles(corners.reshape(-1, 3), triangles)
        expected = {
            (i, j)
            for i in range(40)
            for j in range(i)
            if crosses(corners[i], corners[j]) or crosses(corners[j], corners[i])
        }
        assert len(expected) > 20
        assert {(max(pair), min(pair)) for pair in pairs.tolist()} == expected


def test_a_plane_needs_three_numbers_twice():
    """Given as text: a point and a normal."""
    plane = parse_interface("plane=0,0,0.1/0,0,1")
    assert np.array_equal(plane.direction, [0.0, 0.0, 1.0])
    for text in ("plane=0,0,0.1", "plane=0,0/0,0,1", "plane=0,0,1/0,0,1/2"):
        with pytest.raises(BadInput, match="expected"):
            parse_interface(text)
