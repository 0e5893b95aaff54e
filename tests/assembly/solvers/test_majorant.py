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
    "only xy": [[1.0, -0.5, 0.0], [-0.5, 2.0, 0.0], [0.0, 0.0, 3.0]],
    "only xz": [[1.0, 0.0, -0.5], [0.0, 2.0, 0.0], [-0.5, 0.0, 3.0]],
    "only yz": [[1.0, 0.0, 0.0], [0.0, 2.0, -0.5], [0.0, -0.5, 3.0]],
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


def largest_by_eigenvalues(Q, g):
    """The multiplier m of the sphere is the last real eigenvalue of a block matrix.

    Gander, Golub, von Matt (1989): ((Q - m)^2 - g g') x = 0 at the solution.
    """
    blocks = np.block([[Q, -np.eye(3)], [-np.outer(g, g), Q]])
    m = np.linalg.eigvals(blocks).real.max()
    values, V = np.linalg.eigh(Q)
    # from above, as rounding moves a double root by its square root
    return min(
        k / 2 + ((V.T @ g) ** 2 / (2 * (k - values))).sum()
        for k in m + np.abs([*Q.ravel(), *g]).max() * np.array([1e-8, 1e-10, 1e-12])
        if k > values.max()
    )


@pytest.mark.parametrize("units", [1e-7, 1.0, 1e5])
@pytest.mark.parametrize("name", [name for name in MATRICES if name != "zero"])
@pytest.mark.parametrize(
    "g", [(0.2, -0.5, 0.3), (4.0, 1.0, -2.0), (1e-3, 1e-2, -1e-3), (0.0, 0.0, 7.0)]
)
def test_the_largest_value_on_the_sphere_is_that_of_an_eigenvalue(name, g, units):
    """In any unit; 1e-8 of the size is what a double root loses."""
    Q, g = np.array(MATRICES[name]), np.array(g)
    size = np.abs(Q).max() + np.linalg.norm(g)
    found = largest_on_sphere(units * Q, units * g)
    expected = largest_by_eigenvalues(Q, g)
    assert found == pytest.approx(units * expected, rel=0, abs=1e-7 * size * units)


def quadratic_above(X, H, start, starts, w, centre, d):
    """At d: |w_k|^2 / (2 s_k) + s_k / 2 for each cone, with the best n for the rows."""
    group = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    s = np.sqrt(np.bincount(group, w**2))
    s = np.maximum(s, 1e-9 * s.max())
    root = 1 / np.sqrt(s[group])
    # min over n of |root (X'd - H'n)|^2 / 2 + n.H start
    A = (root[:, None] * H.T).T
    n = np.linalg.solve(A @ A.T, A @ (root * (X.T @ d)) - H @ start)
    v = X.T @ d - H.T @ n
    return (
        d @ (centre - X @ start)
        + n @ H @ start
        + ((root * v) @ (root * v) + s.sum()) / 2
    )


@pytest.mark.parametrize("rows", [0, 1, 3])
@pytest.mark.parametrize("seed", range(3))
def test_the_bound_is_the_largest_value_of_the_quadratic_with_the_best_rows(seed, rows):
    """Ten values on the sphere determine a quadratic; its largest by eigenvalues."""
    rng = np.random.default_rng(seed)
    starts = np.array([0, 2, 4, 5, 7, 8])
    X, centre = rng.normal(size=(3, 8)), rng.normal(size=3)
    H = np.linalg.qr(rng.normal(size=(8, rows)))[0].T
    start = 0.3 * rng.uniform(-1, 1, 8)
    d = rng.normal(size=(40, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    w = X.T @ d[0] - H.T @ rng.normal(size=rows)
    values = [quadratic_above(X, H, start, starts, w, centre, one) for one in d]
    pairs = d[:, [0, 1, 2, 0, 0, 1]] * d[:, [0, 1, 2, 1, 2, 2]]
    terms = np.hstack([d, pairs])  # |d|^2 = 1 is the constant
    found = np.linalg.lstsq(terms, np.array(values))[0]
    xx, yy, zz, xy, xz, yz = found[3:]
    Q = np.array([[2 * xx, xy, xz], [xy, 2 * yy, yz], [xz, yz, 2 * zz]])
    bound = majorant_bound(centre, X, H, start, starts, w)
    assert bound == pytest.approx(largest_by_eigenvalues(Q, found[:3]), rel=1e-6)


def test_a_cone_that_the_gradient_misses_counts_as_a_billionth_of_the_largest():
    """Interval and disc, d along the interval: d_y^2 / (2 1e-9 w) outweighs all."""
    X = np.array([[3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    bound = bound_of(
        X, np.zeros((0, 3)), np.zeros(3), [0, 1, 3], np.eye(3)[0], np.zeros(0)
    )
    assert bound == pytest.approx(1 / (2 * 3e-9), rel=1e-7)
    # and a gradient that is small in whatever unit is no zero
    small = bound_of(
        1e-6 * X, np.zeros((0, 3)), np.zeros(3), [0, 3], np.eye(3)[0], np.zeros(0)
    )
    assert small == pytest.approx(3e-6, rel=1e-9)


def test_rows_that_depend_on_each_other_bound_nothing():
    X, H = np.eye(3), np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    w = np.array([1.0, 0.0, 0.0])
    bound = majorant_bound(np.zeros(3), X, H, np.zeros(3), np.array([0, 3]), w)
    assert bound == np.inf
