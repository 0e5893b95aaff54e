"""The quadratic upper bound against eigenvalues, closed forms and directions tried."""

import numpy as np
import pytest

from assembly.solvers.majorant import eigenvectors, largest_on_sphere, majorant_bound


def sphere(count=4000):
    """Directions all over the unit sphere, by a spiral."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - z * z)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


MATRICES = {
    "plain": [[2.0, 0.3, -0.7], [0.3, -1.0, 0.4], [-0.7, 0.4, 0.5]],
    "diagonal": [[3.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 1.0]],
    "twice the same": [[2.0, 1.0, 1.0], [1.0, 2.0, 1.0], [1.0, 1.0, 2.0]],
    "zero": [[0.0] * 3] * 3,
    "stiff": [[1e6, 1.0, 0.0], [1.0, 1e-3, 2e-4], [0.0, 2e-4, 1.0]],
}


@pytest.mark.parametrize("name", MATRICES)
def test_eigenvalues_are_numpys_and_vectors_are_theirs(name):
    Q = np.array(MATRICES[name])
    values, vectors = eigenvectors(Q.copy())
    size = np.abs(Q).max() or 1.0
    np.testing.assert_allclose(
        np.sort(values), np.linalg.eigvalsh(Q), atol=1e-14 * size
    )
    np.testing.assert_allclose(Q @ vectors, vectors * values, atol=1e-14 * size)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(3), atol=1e-14)


@pytest.mark.parametrize("name", MATRICES)
@pytest.mark.parametrize("g", [(0.0, 0.0, 0.0), (0.2, -0.5, 0.3), (4.0, 1.0, -2.0)])
def test_the_largest_value_on_the_sphere_is_that_of_directions_tried(name, g):
    Q, g = np.array(MATRICES[name]), np.array(g)
    d = sphere()
    for _ in range(300):  # on from the best: each step goes up, Q + m positive
        values = (d @ Q * d).sum(axis=1) / 2 + d @ g
        d = d[np.argsort(values)[-50:]]
        d = d @ Q + (2 * np.abs(Q).max() + 1e-3) * d + g
        d /= np.linalg.norm(d, axis=1)[:, None]
    tried = ((d @ Q * d).sum(axis=1) / 2 + d @ g).max()
    bound = largest_on_sphere(Q.copy(), g)
    size = np.abs(Q).max() + np.linalg.norm(g)
    assert bound >= tried - 1e-13 * size
    assert bound == pytest.approx(tried, abs=2e-4 * size + 1e-300)


def test_on_the_sphere_a_line_alone_is_its_length_and_a_ball_its_half():
    g = np.array([3.0, 0.0, -4.0])
    assert largest_on_sphere(np.zeros((3, 3)), g) == pytest.approx(5.0, rel=1e-12)
    assert largest_on_sphere(2 * np.eye(3), g) == pytest.approx(6.0, rel=1e-12)
    # the top direction has no line along it: d = (sin, 0, cos), 2 cos^2 + .. at its top
    Q = np.diag([0.0, 0.0, 4.0])
    g = np.array([1.0, 0.0, 0.0])
    angle = np.linspace(0, np.pi, 2_000_001)
    best = (2 * np.cos(angle) ** 2 + np.sin(angle)).max()
    assert largest_on_sphere(Q, g) == pytest.approx(best, rel=1e-11)


def bound_of(X, H, start, starts, d, n, centre=(0.0, 0.0, 0.0)):
    w = X.T @ d - H.T @ n
    return majorant_bound(np.array(centre), X, H, start, np.array(starts), w)


def test_of_an_ellipsoid_the_bound_is_its_longest_axis():
    """One cone of three components, X = diag: an ellipsoid about the centre."""
    X = np.diag([1.0, 3.0, 2.0])
    nothing = np.zeros((0, 3))
    d = np.array([0.0, 1.0, 0.0])
    bound = bound_of(X, nothing, np.zeros(3), [0, 3], d, np.zeros(0))
    assert bound == pytest.approx(3.0, rel=1e-12)
    # moved along its axis, and read from another of its points: the same body
    start = np.array([0.0, 0.5, 0.0])
    bound = bound_of(X, nothing, start, [0, 3], d, np.zeros(0), centre=X @ start)
    assert bound == pytest.approx(3.0, rel=1e-12)


def test_rows_cut_an_ellipsoid_in_an_ellipse():
    """v_y = v_z cuts the ellipsoid's longest reach to sqrt((3^2 + 2^2) / 2)."""
    X = np.diag([1.0, 3.0, 2.0])
    H = np.array([[0.0, 1.0, -1.0]]) / np.sqrt(2)
    d = np.array([0.0, 3.0, 2.0]) / np.sqrt(13)
    # the best n makes w perpendicular to the row
    n = H @ (X.T @ d)
    bound = bound_of(X, H, np.zeros(3), [0, 3], d, n)
    assert bound == pytest.approx(np.sqrt(13 / 2), rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_nothing_of_the_body_is_farther_than_the_bound(seed):
    """At any direction and any n: |v_k| <= 1 with rows, by points of the body."""
    rng = np.random.default_rng(seed)
    starts = [0, 2, 4, 5, 7, 8]
    X, centre = rng.normal(size=(3, 8)), rng.normal(size=3)
    H = np.linalg.qr(rng.normal(size=(8, 2)))[0].T
    start = 0.3 * rng.uniform(-1, 1, 8)
    farthest = 0.0
    kernel = np.eye(8) - H.T @ H
    for direction in (kernel @ rng.normal(size=(8, 400))).T:
        # as far along it as the cones let
        reach = np.inf
        for a, b in zip(starts, starts[1:], strict=False):
            p, q = direction[a:b] @ direction[a:b], start[a:b] @ direction[a:b]
            root = np.sqrt(q * q + p * (1 - start[a:b] @ start[a:b]))
            reach = min(reach, (root - q) / p)
        point = centre + X @ (reach * direction)
        farthest = max(farthest, np.linalg.norm(point))
    for _ in range(5):
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        n = rng.normal(size=2)
        bound = bound_of(X, H, start, starts, d, n, centre)
        assert bound >= farthest


def test_a_gradient_of_zero_bounds_nothing():
    X = np.zeros((3, 2))
    bound = bound_of(
        X, np.zeros((0, 2)), np.zeros(2), [0, 2], np.eye(3)[0], np.zeros(0)
    )
    assert bound == np.inf
