"""Tests of the search for intersecting triangles."""

import numpy as np
import pytest

from forcefit.stiffness.surface.intersections import crossing_triangles


def crosses(one, other):
    """Return whether an edge of one triangle passes through the other."""
    a, b, c = other
    for k in range(3):
        p, q = one[k], one[(k + 1) % 3]
        # solve p + t (q - p) = a + u (b - a) + v (c - a)
        t, u, v = np.linalg.solve(np.column_stack([p - q, b - a, c - a]), p - a)
        if 0 < t < 1 and u > 0 and v > 0 and u + v < 1:
            return True
    return False


@pytest.mark.parametrize("along", [0, 1, 2])
def test_intersecting_pairs_do_not_depend_on_order_or_unit(along):
    """Triangles with a common corner are not included."""
    rng = np.random.default_rng(along)
    corners = 0.3 * rng.uniform(-1, 1, (40, 3, 3))
    corners[:, :, along] += 0.05 * rng.permutation(40)[:, None]
    points, triangles = corners.reshape(-1, 3), np.arange(120).reshape(40, 3)
    triangles[1:5, 0] = triangles[0, 0]
    corners = points[triangles]
    expected = {
        (j, i)
        for i in range(40)
        for j in range(i)
        if not set(triangles[i]) & set(triangles[j])
        and (crosses(corners[i], corners[j]) or crosses(corners[j], corners[i]))
    }
    assert len(expected) > 10
    some = rng.permutation(40)
    # offset, so that sums of coordinates differ from differences
    away = np.array([5.0, -3.0, 2.0])
    for scale, shift in ((1.0, 0.0), (1e3, 0.0), (1.0, away)):
        turned = triangles[some][:, [1, 2, 0]]
        pairs = some[crossing_triangles(scale * points + shift, turned)]
        assert len(pairs) == len(expected)
        assert {tuple(sorted(pair)) for pair in pairs.tolist()} == expected


def test_intersecting_pairs_are_found_among_many_triangles():
    """Several batches are needed, and the last two triangles intersect."""
    rng = np.random.default_rng(1)
    corners = 1e-3 * rng.normal(size=(1100, 3, 3))
    corners[:, :, 1] += 5.0 * rng.permutation(1100)[:, None]
    corners[-2] = [[-1, 0, 0], [1, 1, 0], [1, -1, 0]]
    corners[-1] = [[0, 0, -1], [0, 0.1, 1], [0.2, 0, 1]]
    points, triangles = corners.reshape(-1, 3), np.arange(3300).reshape(-1, 3)
    found = crossing_triangles(points + [9.0, 0, 0], triangles)
    assert np.sort(found, axis=1).tolist()[-1] == [1098, 1099]
    one = crossing_triangles(points[:3300:1100], np.array([[0, 1, 2]]))
    assert one.shape == (0, 2)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("way", [1, -1])
def test_touching_triangles_do_not_intersect(unit, way):
    """A long thin triangle touches another triangle. They intersect after a
    displacement of 1e-9.
    """
    base = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])[::way]

    def crossing(at, low, high, third):
        points = np.array([*base, [at, 0.4, low], [at, 0.4, high], third])
        points = unit * (points + [3.0, -2.0, 1.0])
        return len(crossing_triangles(points, np.array([[0, 1, 2], [3, 4, 5]])))

    for deep, count in ((0.0, 0), (2e-10, 0), (1e-8, 1), (0.3, 1)):
        assert crossing(0.2, -deep, 2.0, [0.2, 0.5, 5.0]) == count
        assert crossing(0.2, -2.0, deep, [0.2, 0.5, -5.0]) == count
        assert crossing(deep, -1.0, 1.0, [-1.0, 0.4, 3.0]) == count
        assert crossing(0.6 - deep / 2, -1.0, 1.0, [2.0, 0.4, 3.0]) == count
    for side in (-1e-8, 0.6 + 1e-8):
        assert crossing(side, -1.0, 1.0, [10 * side - 3.0, 0.4, 3.0]) == 0
