"""Triangles by reflections against their definition and numpy's QR."""

import numpy as np
import pytest

from assembly.solvers.householder import triangulate, turn, turn_all, turn_back

RELATIVE, FLOOR, ANY = 1e-9, 0.0, -1.0


def triangle_of(rows, relative=RELATIVE, floor=FLOOR, clean=ANY):
    F, p = rows.copy(), len(rows)
    turns, diagonal, order = np.zeros(p), np.zeros(p), np.zeros(p, np.int64)
    rank = triangulate(F, turns, diagonal, order, relative, floor, clean)
    L = np.tril(F[:, :p], -1)[:, : rows.shape[1]]
    k = min(p, rows.shape[1])
    L[range(k), range(k)] = diagonal[:k]
    return F, turns, diagonal, order, rank, L


@pytest.mark.parametrize("shape", [(4, 4), (3, 7), (1, 5), (5, 17)])
def test_the_triangle_turned_is_the_rows_in_their_order(rng, shape):
    rows = rng.normal(size=shape)
    F, turns, diagonal, order, rank, L = triangle_of(rows)
    assert rank == shape[0]
    padded = np.zeros(shape)
    padded[:, : L.shape[1]] = L
    columns = padded.T.copy()
    turn_all(F, turns, rank, columns)
    np.testing.assert_allclose(columns.T, rows[order], atol=1e-14)
    for k in range(shape[0]):
        x = padded[k].copy()
        turn(F, turns, rank, x)
        np.testing.assert_allclose(x, rows[order[k]], atol=1e-14)
        turn_back(F, turns, rank, x)
        np.testing.assert_allclose(x, padded[k], atol=1e-14)


def test_the_diagonal_is_that_of_qr_with_pivoting(rng):
    from scipy.linalg import qr

    rows = rng.normal(size=(5, 9)) * np.array([1.0, 10.0, 0.1, 3.0, 30.0])[:, None]
    R, pivots = qr(rows.T, mode="r", pivoting=True)
    _, _, diagonal, order, _, _ = triangle_of(rows)
    np.testing.assert_array_equal(order, pivots)
    np.testing.assert_allclose(np.abs(diagonal), np.abs(np.diag(R)), rtol=1e-12)
    assert (np.diff(np.abs(diagonal)) <= 0).all()


def test_turns_of_fewer_reflectors_are_orthogonal(rng):
    F, turns, _, _, _, _ = triangle_of(rng.normal(size=(3, 6)))
    for rank in range(4):
        Q = np.eye(6)
        turn_all(F, turns, rank, Q)
        np.testing.assert_allclose(Q.T @ Q, np.eye(6), atol=1e-14)


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        (1e-7, 2),  # beyond ten times the threshold
        (0.5e-8, -1),  # within ten times, from above ..
        (2e-10, -1),  # .. and from below
        (0.5e-10, 1),  # a tenth of it: nothing new
    ],
)
def test_a_row_is_new_old_or_ambiguous_by_ten_times_the_threshold(second, expected):
    rows = np.array([[3.0, 0.0, 0.0], [0.0, 3.0 * second, 0.0]])
    assert triangle_of(rows)[4] == expected


def test_a_floor_holds_for_rows_that_are_all_small():
    rows = np.diag([1.0, 0.5]) * 1e-6
    assert triangle_of(rows)[4] == 2
    assert triangle_of(rows, floor=1e-4)[4] == 0
    assert triangle_of(rows, floor=1e-6)[4] == -1


@pytest.mark.parametrize(("size", "rank"), [(2e-11, -1), (0.5e-11, 1)])
def test_rows_that_add_nothing_are_clean_or_ambiguous(size, rank):
    rows = np.array([[1.0, 0.0], [0.0, size]])
    assert triangle_of(rows)[4] == 1
    assert triangle_of(rows, clean=1e-11)[4] == rank


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_numbers_that_are_none_have_no_rank():
    assert triangle_of(np.full((2, 2), np.nan))[4] == -1
