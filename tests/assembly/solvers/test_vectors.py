"""Small loops over rows, by hand."""

import numpy as np
import pytest

from assembly.solvers.vectors import copy, divide, fill, inner, into_cones


def test_only_what_is_longer_than_one_is_shortened():
    """Cones of 2, 1 and 3 components: 5 long, within, and longer by a little."""
    starts = np.array([0, 2, 3, 6])
    u = np.array([3.0, 4.0, -0.9, 0.8, 0.0, -0.7])
    into_cones(starts, u)
    longer = np.sqrt(0.64 + 0.49)
    wanted = [0.6, 0.8, -0.9, 0.8 / longer, 0.0, -0.7 / longer]
    assert u == pytest.approx(wanted, rel=1e-14)
    into_cones(starts, u)
    assert u == pytest.approx(wanted, rel=1e-14)


def test_rows_are_numpys(rng):
    a, b = rng.normal(size=(2, 5))
    assert inner(a, b) == pytest.approx(a @ b, rel=1e-14)
    assert divide(a, -2.5) == pytest.approx(a / -2.5, rel=1e-15)
    to = np.zeros(5)
    fill(to, 0.5)
    assert np.array_equal(to, np.full(5, 0.5))
    copy(a, to)
    assert np.array_equal(to, a)
    to[0] = 7.0
    assert a[0] != 7.0


def test_multipliers_that_are_not_unique_are_the_least_ones(rng):
    """Z'y without its part along rows of Z that nothing feels, however long these."""
    from assembly.linear.compiled_energy import _least_multipliers

    Z, y, rank = (
        rng.normal(size=(5, 9)) * [[1], [2], [0.5], [3], [0.1]],
        rng.normal(size=3),
        3,
    )
    unfelt = Z[rank:].copy()
    whole = Z[:rank].T @ y
    found = whole.copy()
    _least_multipliers(Z.copy(), rank, found)
    expected = whole - unfelt.T @ np.linalg.lstsq(unfelt.T, whole)[0]
    assert found == pytest.approx(expected, rel=1e-12)
    assert unfelt @ found == pytest.approx(np.zeros(2), abs=1e-13)
