"""The diagnosis of chains by its textbook formulas, and Dikin's ellipsoid of boxes."""

import numpy as np
import pytest

from assembly.model.error_distributions import draw_generator
from assembly.statistics.uniform_clearance import (
    _ellipsoid,
    diagnose,
    is_mixed,
    sample_uniform_position,
)


def by_the_textbook(x):
    """Split R-hat and effective size, sum by sum (Gelman et al. 2013, 11.4-11.5)."""
    n = x.shape[1] // 2
    chains = [row[i * n : (i + 1) * n] for row in x for i in (0, 1)]
    m = len(chains)
    W = np.mean([np.var(chain, ddof=1) for chain in chains])
    B = n * np.var([chain.mean() for chain in chains], ddof=1)
    plus = (n - 1) / n * W + B / n
    rho = []
    for t in range(n):
        shared = [
            sum((c[: n - t] - c.mean()) * (c[t:] - c.mean())) / (n - 1) for c in chains
        ]
        rho.append(1 - (W - np.mean(shared)) / plus)
    pairs = [rho[t] + rho[t + 1] for t in range(0, n - 1, 2)]
    total, least = -1.0, np.inf
    for pair in pairs:
        least = min(least, pair)
        if least <= 0:
            break
        total += 2 * least
    return np.sqrt(plus / W), m * n / max(total, 1 / np.log10(m * n))


@pytest.mark.parametrize("length", [8, 9, 12, 64])
@pytest.mark.parametrize("correlation", [-0.5, 0.0, 0.7, 0.95])
def test_the_diagnosis_is_that_of_the_textbook(length, correlation, rng):
    x = rng.normal(size=(4, length)) + rng.normal(size=(4, 1))
    for t in range(1, length):
        x[:, t] += correlation * x[:, t - 1]
    np.testing.assert_allclose(diagnose(x), by_the_textbook(x), rtol=1e-9)
    # in any unit, about any value
    np.testing.assert_allclose(diagnose(1e-6 * x + 1e-3), diagnose(x), rtol=1e-6)


def test_chains_are_mixed_where_every_component_that_varies_is(rng):
    """Criteria: an R-hat of 1.05 at most, 100 independent points at least."""
    apart = 0.05 * np.array([-1.5, -0.5, 0.5, 1.5])[:, None]
    slow = rng.normal(size=(4, 64))
    for t in range(1, 64):
        slow[:, t] += 0.6 * slow[:, t - 1]
    good = rng.normal(size=(4, 64))
    assert diagnose(slow)[0] < 1.05 < diagnose(good + 20 * apart)[0]
    assert diagnose(slow)[1] < 100 < diagnose(good)[1]
    assert diagnose(good + 20 * apart)[1] < 256
    for one, mixed in ((good, True), (slow, False), (good + 20 * apart, False)):
        for size in (1.0, 1e-9):
            trace = np.zeros((4, 64, 6))
            trace[:, :, 0] = size * good
            trace[:, :, 3] = size * one
            trace[:, :, 4] = 7.0 + 1e-14 * slow  # rounding
            assert is_mixed(trace) == mixed
    assert is_mixed(np.ones((4, 64, 6)))
    assert not is_mixed(np.where(np.arange(6) == 2, np.nan, trace))


def test_chains_that_are_each_stuck_elsewhere_are_not_mixed():
    """Nothing varies within a chain, as in corners of the set: R-hat is infinite."""
    trace = np.zeros((4, 64, 6))
    trace[:, :, 1] = np.arange(4)[:, None]
    assert not is_mixed(trace)
    assert diagnose(trace[:, :, 1])[0] == np.inf


@pytest.mark.parametrize("dimensions", [1, 2, 5])
@pytest.mark.parametrize("start", [0.0, 0.6, 0.95, 1.0])
def test_the_ellipsoid_of_a_box_is_a_ball_about_its_middle(dimensions, start):
    """-sum log(1 - u_i^2) has the Hessian 2 I at 0: axes of 1 / sqrt 2."""
    u, M = _ellipsoid(
        np.eye(dimensions), np.arange(dimensions + 1), np.full(dimensions, start)
    )
    np.testing.assert_allclose(u, 0.0, atol=2e-3)
    np.testing.assert_allclose(M @ M.T, np.eye(dimensions) / 2, atol=1e-4)


@pytest.mark.parametrize("cut", [0.0, 1.0, 1.9])
def test_the_ellipsoid_of_a_segment_has_its_middle_and_its_curvature(cut):
    """u0 + u1 = cut from corner to corner of a square: u0 = u1 = c = cut / 2.

    Along s: -2 log(1 - (c + s / sqrt 2)^2) and its mirror have together the second
    derivative (2 / q + 4 c^2 / q^2) with q = 1 - c^2, both halved, twice.
    """
    along = np.array([[1.0], [-1.0]]) / np.sqrt(2)
    c = cut / 2
    start = np.array([1.0, cut - 1.0]) if cut else np.array([0.3, -0.3])
    u, M = _ellipsoid(along, np.arange(3), 0.98 * (start - c) + c)
    np.testing.assert_allclose(u, c, atol=2e-3)
    q = 1 - c**2
    curvature = 2 / q + 4 * c**2 / q**2
    np.testing.assert_allclose((M.T @ M).item(), 1 / curvature, rtol=2e-2)
    np.testing.assert_allclose(M[0], -M[1], rtol=1e-9)


def barrier(starts, u):
    """-sum log(1 - |u_k|^2) over the cones."""
    squares = [u[a:b] @ u[a:b] for a, b in zip(starts[:-1], starts[1:], strict=True)]
    return -np.log1p(-np.array(squares)).sum()


@pytest.mark.parametrize("thin", [1e-1, 1e-3, 1e-5])
@pytest.mark.parametrize("part", [-0.5, -1.0, 0.9, 1.0])
def test_at_the_centre_the_barrier_is_flat_and_bends_as_the_ellipsoid(thin, part, rng):
    """Wherever it begins, on the edge too: of the cap u0 = 1 + thin u2 of a disc.

    Along axes of the ellipsoid the barrier rises by half the square of the way.
    """
    starts = np.array([0, 2, 3, 4, 5])
    rows = np.array([[1.0, 0.0, -thin, 0.0, 0.0]])
    Z = np.ascontiguousarray(np.linalg.svd(rows)[2][1:].T)
    # within the disc u2 is negative, and u1 at most sqrt(1 - u0^2)
    u2 = -abs(part)
    u0 = 1 + thin * u2
    u1 = 0.5 * part * np.sqrt(1 - u0**2)
    start = np.array([u0, u1, u2, part, -part])
    u, M = _ellipsoid(Z, starts, start)
    assert abs((rows @ u).item() - 1.0) < 1e-12
    there = barrier(starts, u)
    for _ in range(10):
        way = rng.normal(size=4)
        way *= 0.02 / np.linalg.norm(way)
        ahead, back = (barrier(starts, u + s * M @ way) for s in (1, -1))
        # flat to a decrement of 1e-3
        assert abs(ahead - back) / 2 < 2e-3 * 0.02
        assert (ahead + back) / 2 - there == pytest.approx(0.02**2 / 2, rel=0.02)


@pytest.mark.parametrize("gap", [0.0, 1e-5, 1e-3, 1.0])
@pytest.mark.parametrize("end", [0.0, 1.0])
def test_a_segment_in_a_corner_has_an_inside_unless_it_is_a_point(gap, end):
    """u0 + u1 = 2 - gap within a square, from its middle and from an end."""
    along = np.array([[1.0], [-1.0]]) / np.sqrt(2)
    start = 1.0 - gap / 2 * np.array([1 - end, 1 + end])
    found = _ellipsoid(along, np.arange(3), start)
    assert (found is None) == (gap == 0.0)
    if found is not None:
        np.testing.assert_allclose(found[0], 1 - gap / 2, atol=2e-3 * gap)


def test_a_point_that_may_not_move_is_mixed_and_stays():
    u, to_screw = np.array([0.3, 0.4]), np.eye(6)[:, :2].copy()
    rng = draw_generator(1, 0, 9)
    assert sample_uniform_position(np.zeros((2, 0)), np.array([0, 2]), to_screw, u, rng)
    np.testing.assert_array_equal(u, [0.3, 0.4])
