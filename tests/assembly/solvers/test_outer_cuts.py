"""Farthest points of boxes, ellipsoids and flat sets by outer cuts."""

import numpy as np
import pytest

from forcefit.assembly.solvers.outer_cuts import farthest


def screw(point, half):
    """Return a screw with the point in one half and arbitrary numbers in the other."""
    return np.concatenate([point, [9.0] * 3] if half == 0 else [[9.0] * 3, point])


def ellipsoid(axes, centre, half):
    """Return the support function of {centre + axes v, |v| <= 1}."""

    def support(direction):
        along = axes.T @ direction
        size = np.linalg.norm(along)
        step = axes @ (along / size) if size else np.zeros(3)
        point = centre + step
        return float(direction @ point), screw(point, half), along

    return support


def box(sides, half):
    """Return the support function of a box about the origin."""

    def support(direction):
        point = np.sign(direction + 1e-300) * sides
        return float(direction @ point), screw(point, half), direction

    return support


@pytest.mark.parametrize("half", [0, 3])
@pytest.mark.parametrize(
    "sides", [[1e-3, 2e-3, 3e-3], [1e-3, 0.0, 2e-3], [0.0, 0.0, 3e-3], [0.0] * 3]
)
def test_farthest_point_of_a_box_is_its_corner(half, sides):
    """The boxes include flat boxes, a segment and a point."""
    sides = np.array(sides)
    (low, high), best, _ = farthest(np.zeros(6), half, 1e-7, box(sides, half))
    corner = np.linalg.norm(sides)
    assert low == pytest.approx(corner, abs=1e-18)
    assert corner <= high * (1 + 1e-12)
    assert high - low <= 1e-7
    assert np.linalg.norm(best[half : half + 3]) == low


@pytest.mark.parametrize("size", [1e-5, 1.0, 1e3])
def test_farthest_point_of_an_ellipsoid_is_on_its_longest_axis(size, rng):
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    axes = size * turned @ np.diag([1.0, 0.3, 0.1])
    support = ellipsoid(axes, np.zeros(3), 0)
    (low, high), best, supports = farthest(np.zeros(6), 0, 1e-3 * size, support)
    assert low <= size * (1 + 1e-12)
    assert high >= size * (1 - 1e-12)
    assert high - low <= 1e-3 * size
    assert supports < 400
    assert np.linalg.norm(best[:3]) == low


def test_farthest_point_of_a_ball_is_at_distance_plus_radius():
    """The centre is 5 mm from the origin, the radius is 1 mm."""
    centre = np.array([3e-3, 0.0, 4e-3])
    support = ellipsoid(1e-3 * np.eye(3), centre, 3)
    (low, high), best, _ = farthest(screw(centre, 3), 3, 1e-6, support)
    assert low <= 6e-3 <= high
    assert high - low <= 1e-6
    assert best[3:] == pytest.approx(1.2 * centre, abs=1e-4)
