"""Tolerance zones, compared with hand calculations and linear programming."""

import numpy as np
import pytest
from scipy.optimize import linprog

from forcefit.assembly.callouts.zone import Zone, intersection
from forcefit.assembly.callouts.zones_of_features import (
    axis_orientation,
    axis_position,
    axis_position_along,
    offset_rows,
    plane_orientation,
    plane_position,
    point_position,
    round_plane_orientation,
    round_plane_position,
    shift_along,
)

LENGTH, WIDTH = 0.020, 50e-6  # [m] length of a bore, and its position tolerance
POSITION = axis_position(WIDTH, LENGTH)
BOTH = intersection([POSITION, axis_orientation(20e-6, LENGTH)])


def numbers_of(zone, count=200_000, seed=1):
    return lambda attempt: np.random.default_rng([seed, attempt]).random((
        count,
        zone.words,
    ))


def drawn(zone, distribution="uniform", cp=1.0, count=100_000):
    return zone.draw(numbers_of(zone, count), distribution, cp) @ zone.columns.T


def reach(zone, height):
    """Return the largest displacement of the axis at a height."""
    angles = np.linspace(0, np.pi, 13)
    rows = [np.array([np.cos(a), np.sin(a)]) @ offset_rows(height) for a in angles]
    return max(zone.support(row) for row in rows)


def test_perpendicularity_reduces_largest_displacement_of_a_bore():
    """At h = 200 mm, the displacement is R + (h - L/2) t/L = 25 + 190 = 215 um."""
    assert BOTH.support(np.eye(6)[1]) == pytest.approx(1e-3, rel=1e-7)
    assert reach(BOTH, 0.200) == pytest.approx(215e-6, rel=1e-7)


def test_farthest_screw_attains_support_function():
    rng = np.random.default_rng(3)
    for zone in (POSITION, BOTH, plane_position(4e-5, 0.04, 0.03)):
        for _ in range(5):
            w = rng.normal(size=6) * [1e-2, 1e-2, 1, 1, 1, 1]
            screw = zone.farthest(w)
            assert w @ screw == pytest.approx(zone.support(w), rel=1e-7)
            sizes = [np.linalg.norm(b @ screw) for b in zone.bounds]
            assert max(sizes) <= 1 + 1e-9


def test_covariance_of_position_zone_equals_hand_calculation():
    """Standard deviations for ends that are uniformly distributed in discs of radius R.

    The shift is R / (2 sqrt 2), the tilt is R / (sqrt 2 L), and the displacement at a
    height h is R sqrt(1/8 + (h/L)^2 / 2).
    """
    C = POSITION.covariance()
    assert np.sqrt(C[3, 3]) * 1e6 == pytest.approx(8.839, abs=1e-3)
    assert np.sqrt(C[0, 0]) * 1e3 == pytest.approx(0.8839, abs=1e-4)
    row = offset_rows(0.050)[0]
    assert np.sqrt(row @ C @ row) * 1e6 == pytest.approx(45.07, abs=0.01)
    assert np.allclose(np.cov(drawn(POSITION).T)[0, 0], C[0, 0], rtol=0.01)
    assert C[1, 3] == pytest.approx(0, abs=1e-20)


def test_perpendicularity_accepts_43_percent_of_position_draws():
    all_screws = drawn(POSITION)
    kept = np.linalg.norm(all_screws[:, :2], axis=1) <= 1e-3
    assert kept.mean() == pytest.approx(0.43, abs=0.005)
    screws = drawn(BOTH)
    assert screws[:, 0].std() * 1e3 == pytest.approx(0.474, abs=0.003)
    assert screws[:, 3].std() * 1e6 == pytest.approx(10.5, abs=0.06)
    # equal to the standard deviation of the draws of POSITION inside this zone
    assert screws[:, 3].std() == pytest.approx(all_screws[kept, 3].std(), rel=0.01)


def test_draw_does_not_depend_on_number_of_draws():
    few = BOTH.draw(lambda a: numbers_of(BOTH, 200)(a)[:50])
    many = BOTH.draw(numbers_of(BOTH, 200))
    assert np.array_equal(few, many[:50])


def test_standard_deviation_of_uniform_disc_is_half_its_radius():
    disc = Zone((np.array([[0, 0, 0, 1.0, 0, 0], [0, 0, 0, 0, 1.0, 0]]) / 25e-6,))
    assert np.sqrt(disc.covariance()[3, 3]) * 1e6 == pytest.approx(12.5, rel=1e-12)
    # a fraction 1 - pi / 4 of a square is outside the inscribed disc
    square = np.random.default_rng(1).uniform(-1, 1, (200_000, 2))
    assert 1 - disc.inside(square).mean() == pytest.approx(0.215, abs=0.003)


def test_normal_distribution_has_0_27_percent_outside_a_disc():
    """Radii have a Rayleigh distribution, with exp(-R^2 / (2 s^2)) = 0.0027.

    The solution is s = 0.2908 R = 7.27 um.
    """
    disc = Zone((np.array([[0, 0, 0, 1.0, 0, 0], [0, 0, 0, 0, 1.0, 0]]) / 25e-6,))
    assert disc.deviation() == pytest.approx(0.2908, abs=1e-4)
    sigma = np.sqrt(disc.covariance("normal")[3, 3])
    assert sigma * 1e6 == pytest.approx(7.27, abs=0.005)
    radii = np.linalg.norm(drawn(disc, "normal")[:, 3:5], axis=1)
    assert np.mean(radii > 25e-6) == pytest.approx(0.0027, abs=4e-4)
    assert np.mean(radii * (1 / 3) / 0.2908 > 25e-6) == pytest.approx(0.0111, abs=8e-4)


@pytest.mark.parametrize("cp", [1.0, 1.33])
def test_half_width_of_interval_is_three_cp_standard_deviations(cp):
    assert shift_along(1e-4, [1, 0, 0]).deviation(cp) == pytest.approx(1 / (3 * cp))


@pytest.mark.parametrize("zone", [
    POSITION, BOTH,
    pytest.param(round_plane_position(4e-5, 0.04), marks=pytest.mark.slow),
    pytest.param(plane_position(4e-5, 0.04, 0.03), marks=pytest.mark.slow),
])  # fmt: skip
def test_truncated_draws_have_covariance_of_the_zone(zone):
    screws = drawn(zone, "truncated", 0.6)
    sizes = [np.linalg.norm(screws @ b.T, axis=1).max() for b in zone.bounds]
    assert max(sizes) <= 1 + 1e-9
    C = zone.covariance("truncated", 0.6)
    for i in np.flatnonzero(np.diag(C)):
        assert screws[:, i].var() == pytest.approx(C[i, i], rel=0.02)


@pytest.mark.parametrize("zone", [POSITION, BOTH, round_plane_position(4e-5, 0.04)])
def test_probability_outside_zone_does_not_depend_on_its_shape(
    zone,
):
    u = zone.draw(numbers_of(zone), "normal", 0.7)
    # the probability is 2 Phi(-2.1) = 3.57 %
    assert 1 - zone.inside(u).mean() == pytest.approx(0.0357, abs=0.0015)


def test_zone_of_a_rectangular_face_is_an_octahedron():
    """The support function is g max(|w_TZ|, |w_RX| / B, |w_RY| / A).

    The variance of a uniform distribution in an octahedron is g^2 / 10 along each axis.
    """
    g, A, B = 20e-6, 0.020, 0.015
    zone = plane_position(2 * g, 2 * A, 2 * B)
    rng = np.random.default_rng(1)
    for _ in range(10):
        w = rng.normal(size=6) * [B, A, 0, 1, 1, 1]
        expected = g * max(abs(w[5]), abs(w[0]) / B, abs(w[1]) / A)
        assert zone.support(w) == pytest.approx(expected, rel=1e-7)
    C = zone.covariance()
    assert C[5, 5] == pytest.approx(g**2 / 10, rel=0.01)
    assert C[0, 0] == pytest.approx((g / B) ** 2 / 10, rel=0.01)


def test_zone_of_a_round_face_is_a_double_cone():
    """The support function is g max(|w_TZ|, |(w_RX, w_RY)| / r).

    The cross section at TZ is a disc with the radius (g - |TZ|) / r, so that the
    variances are g^2 / 10 and 3 (g/r)^2 / 20.
    """
    g, r = 20e-6, 0.020
    zone = round_plane_position(2 * g, 2 * r)
    rng = np.random.default_rng(1)
    for _ in range(10):
        w = rng.normal(size=6) * [r, r, 0, 1, 1, 1]
        expected = g * max(abs(w[5]), np.hypot(w[0], w[1]) / r)
        assert zone.support(w) == pytest.approx(expected, rel=1e-7)
        screw = zone.farthest(w)
        assert w @ screw == pytest.approx(expected, rel=1e-7)
        assert abs(screw[5]) + r * np.hypot(screw[0], screw[1]) <= g * (1 + 1e-9)
    C = zone.covariance()
    assert C[5, 5] == pytest.approx(g**2 / 10, rel=0.01)
    assert C[0, 0] == pytest.approx(3 / 20 * (g / r) ** 2, rel=0.01)
    screws = drawn(zone, count=20_000)
    gauge = abs(screws[:, 5]) + r * np.hypot(screws[:, 0], screws[:, 1])
    # scaling the zone by 0.5 scales its volume by 0.5^3
    assert np.mean(gauge < 0.5 * g) == pytest.approx(0.125, abs=0.01)
    assert gauge.max() <= g * (1 + 1e-9)


def test_parallelism_limits_tilt_of_a_round_face():
    """The extreme points are the tip (g, 0) and the circle (g - r b, b)."""
    g, r, b = 20e-6, 0.020, 0.4e-3
    zone = intersection([
        round_plane_position(2 * g, 2 * r), round_plane_orientation(2 * r * b, 2 * r)
    ])  # fmt: skip
    rng = np.random.default_rng(2)
    for _ in range(10):
        w = rng.normal(size=6) * [r, r, 0, 1, 1, 1]
        circle = (g - r * b) * abs(w[5]) + b * np.hypot(w[0], w[1])
        expected = max(g * abs(w[5]), circle)
        assert zone.support(w) == pytest.approx(expected, rel=1e-7)
    assert zone.support(np.eye(6)[0]) == pytest.approx(b, rel=1e-7)


@pytest.mark.parametrize("size", [0.0, 0.4, 1.0])
def test_draws_in_a_growing_zone_equal_those_for_fixed_size(size):
    """The hole size is drawn first, then the position in the zone for this size."""
    zone = intersection([
        axis_position(WIDTH, LENGTH, bonus=18e-6), axis_orientation(20e-6, LENGTH)
    ])  # fmt: skip
    fixed = intersection([
        axis_position(WIDTH + size * 18e-6, LENGTH), axis_orientation(20e-6, LENGTH)
    ])  # fmt: skip

    def numbers(attempt):
        uniform = numbers_of(zone, 40_000)(attempt)
        if attempt == 0:  # the hole size is drawn only in the first attempt
            uniform[:, -1] = size
        return uniform

    screws = zone.draw(numbers) @ zone.columns.T
    C = fixed.covariance()
    assert screws.var(axis=0)[[0, 3]] == pytest.approx(np.diag(C)[[0, 3]], rel=0.03)


def test_support_function_of_a_polyhedron_agrees_with_linear_programme():
    zone = intersection([
        plane_position(5e-5, 0.04, 0.03),
        plane_orientation(2e-5, 0.04, 0.03),
    ])
    rows = np.vstack(zone.bounds)[:, [0, 1, 5]] * [1e-3, 1e-3, 1e-5]
    rng = np.random.default_rng(2)
    for _ in range(10):
        w = rng.normal(size=3)
        found = linprog(
            -w, np.vstack([rows, -rows]), np.ones(2 * len(rows)), bounds=(None, None)
        )
        full = np.zeros(6)
        full[[0, 1, 5]] = w / [1e-3, 1e-3, 1e-5]
        assert zone.support(full) == pytest.approx(-found.fun, rel=1e-7)


def test_directed_position_tolerance_permits_no_perpendicular_displacement():
    zone = axis_position_along(WIDTH, LENGTH, np.array([1.0, 0.0]))
    assert zone.support(np.eye(6)[3]) == pytest.approx(25e-6)
    assert zone.support(np.eye(6)[1]) == pytest.approx(2.5e-3)
    assert zone.support(np.eye(6)[4]) == pytest.approx(0, abs=1e-15)
    assert zone.support(np.eye(6)[0]) == pytest.approx(0, abs=1e-15)


def test_directed_position_zone_at_maximum_material_grows_with_hole():
    """The displacement x of an end has the variance E[x^2] = E[R^2] / 3.

    It is uniform in -R to R, and R is uniform in 25 to 34 um.
    """
    zone = axis_position_along(WIDTH, LENGTH, np.array([1.0, 0.0]), bonus=18e-6)
    assert zone.support(np.eye(6)[3]) == pytest.approx(34e-6)
    ends = drawn(zone, count=400_000) @ offset_rows(LENGTH / 2)[0]
    assert 33.9e-6 < abs(ends).max() <= 34e-6
    mean_square = (34e-6**3 - 25e-6**3) / (3 * 9e-6) / 3
    assert np.mean(ends**2) == pytest.approx(mean_square, rel=0.01)


def test_directed_orientation_zone_is_an_interval():
    zone = axis_orientation(20e-6, LENGTH, np.array([1.0, 0.0]))
    assert zone.support(np.eye(6)[1]) == pytest.approx(1e-3)
    assert zone.support(np.eye(6)[0]) == pytest.approx(0, abs=1e-15)


def test_support_function_of_a_bore_is_sum_over_both_ends():
    """The support function is |B+^T w| + |B-^T w|, where B+ and B- map end points.

    The screw is (TX, TY) = c (u+ + u-) / 2 and (RY, -RX) = c (u+ - u-) / L.
    """
    c = WIDTH / 2
    columns = []
    for sign in (1, -1):
        B = np.zeros((6, 2))
        B[[3, 4], [0, 1]] = c / 2
        B[[1, 0], [0, 1]] = sign * np.array([c, -c]) / LENGTH
        columns.append(B)
    rng = np.random.default_rng(5)
    for w in rng.normal(size=(10, 6)) * [0.01, 0.01, 1, 1, 1, 1]:
        expected = sum(np.linalg.norm(B.T @ w) for B in columns)
        assert POSITION.support(w) == pytest.approx(expected, rel=1e-12)


def test_tolerance_zone_of_a_point_is_a_ball():
    zone = point_position(40e-6)
    w = np.array([1, 2, 3, 0.3, -0.4, 1.2])
    assert zone.support(w) == pytest.approx(20e-6 * 1.3)
    assert zone.covariance()[3, 3] == pytest.approx(20e-6**2 / 5)
    screws = drawn(zone)
    assert screws[:, 3:].var(axis=0) == pytest.approx([20e-6**2 / 5] * 3, rel=0.01)


def test_position_zone_at_maximum_material_grows_with_hole():
    """The zone width is 0.050 mm for the smallest and 0.068 mm for the largest hole."""
    zone = axis_position(WIDTH, LENGTH, bonus=18e-6)
    assert zone.support(np.eye(6)[3]) == pytest.approx(34e-6)
    screws = drawn(zone, count=400_000)
    ends = np.linalg.norm(screws @ offset_rows(LENGTH / 2).T, axis=1)
    assert 33.9e-6 < ends.max() <= 34e-6
    # E[r^2] = E[R^2] / 2, where the zone radius R is uniform in 25 to 34 um
    mean_square = (34e-6**3 - 25e-6**3) / (3 * 9e-6) / 2
    assert np.mean(ends**2) == pytest.approx(mean_square, rel=0.01)
    assert zone.covariance()[3, 3] == pytest.approx(screws[:, 3].var(), rel=0.01)


def test_length_tolerance_permits_no_perpendicular_displacement():
    along = np.array([0.5, np.sqrt(0.75), 0.0])
    zone = shift_along(1e-4, along)
    across = np.concatenate([np.zeros(3), [-along[1], along[0], 0]])
    assert zone.support(np.concatenate([np.zeros(3), along])) == pytest.approx(1e-4)
    assert zone.support(across) == pytest.approx(0, abs=1e-18)
    both = axis_position_along(WIDTH, LENGTH, along[:2])
    assert both.support(across) == pytest.approx(0, abs=1e-18)


def test_intersection_with_a_wide_zone_does_not_change_draws():
    """A tolerance of 20 mm has no effect together with a tolerance of 0.05 mm."""
    narrow = axis_position(WIDTH, LENGTH)
    zone = intersection([axis_position(20e-3, LENGTH), narrow])
    screws = drawn(zone, count=20_000)
    C = narrow.covariance()
    assert screws.var(axis=0)[[0, 3]] == pytest.approx(np.diag(C)[[0, 3]], rel=0.03)
