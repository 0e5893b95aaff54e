"""Small unknowns behind a fit, and none at all, against dense matrices."""

import numpy as np
import pytest

from validation.diagnosis.background import NOTHING, background
from validation.diagnosis.evidence import Prior, sizes_of
from validation.diagnosis.small_terms import GEOMETRY, SPRINGS, SmallTerm

CELLS = 20


def test_nothing_behind_a_fit_changes_nothing(rng):
    z, columns = rng.normal(size=CELLS), rng.normal(size=(CELLS, 3))
    assert not NOTHING
    assert (NOTHING.unknowns, NOTHING.score, NOTHING.scales) == (0.0, 0.0, {})
    assert (NOTHING.size.shape, NOTHING.gains.shape) == ((0,), (0,))
    assert NOTHING.turn.shape == (0, 0)
    assert NOTHING.whitened(columns) is columns
    assert (NOTHING.raw(z) is z, NOTHING.left(z) is z) == (True, True)
    assert NOTHING.values(z) == NOTHING.deviations() == NOTHING.identified() == []
    assert NOTHING.lost(z, []) == pytest.approx(z @ z)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_two_terms_stand_behind_readings_as_their_covariance(size, rng):
    """C = 1 + J S^2 J': whitened, back again, most probable unknowns and how sure.

    One unknown is not in use, one of no size, and two that do the same share it.
    """
    J = rng.normal(size=(CELLS, 4))
    J[:, 1] = J[:, 0]
    terms = [
        SmallTerm(GEOMETRY, np.zeros(4, int), np.array([0, 1, 3, 4]), J,
                  np.array([np.nan, np.nan, 0.0, np.nan]), -np.inf),
        SmallTerm(SPRINGS, np.zeros(2, int), np.array([2, 5]),
                  rng.normal(size=(CELLS, 2)), np.full(2, np.nan), 0.0),
    ]  # fmt: skip
    scales = {GEOMETRY: (0.5 * size, 2.0 * size), SPRINGS: (0.3 * size, 1.0 * size)}
    used = np.array([True, True, True, True]), np.array([False, True])
    behind = background(terms, Prior(used, scales, -7.0, 3.0))
    S = np.concatenate([sizes_of(t, scales[t.name])[u] for t, u in zip(
        terms, used, strict=True)])  # fmt: skip
    A = np.hstack([t.columns[:, u] for t, u in zip(terms, used, strict=True)])
    C = np.eye(CELLS) + (A * S**2) @ A.T
    z = rng.normal(size=CELLS)
    whitened = behind.whitened(z.copy())
    values, vectors = np.linalg.eigh(C)
    half = (vectors / np.sqrt(values)) @ vectors.T
    np.testing.assert_allclose(whitened, half @ z, atol=1e-8)
    both = behind.whitened(np.column_stack([z, 2 * z]))
    np.testing.assert_allclose(both[:, 1], 2 * whitened, atol=1e-8)
    np.testing.assert_allclose(behind.raw(whitened), z, rtol=1e-6, atol=1e-8)
    x = S**2 * (A.T @ np.linalg.solve(C, z))
    found = behind.values(whitened)
    assert [len(own) for own in found] == [4, 1]
    np.testing.assert_allclose(np.concatenate(found), x, rtol=1e-5, atol=1e-9 * size)
    np.testing.assert_allclose(behind.left(whitened), z - A @ x, atol=1e-7)
    shown = (A * S).T @ np.linalg.solve(C, A * S)
    share = np.diag(shown)
    np.testing.assert_allclose(np.concatenate(behind.identified()), share, atol=1e-7)
    std = S * np.sqrt(1 - share)
    found = np.concatenate(behind.deviations())
    np.testing.assert_allclose(found, std, rtol=1e-3, atol=1e-9 * size)
    assert behind.unknowns == pytest.approx(np.trace(shown), rel=1e-6)
    assert behind.score == -7.0
    # -2 ln of their probability is least at the most probable ones, by C alone
    least = behind.lost(z, behind.values(whitened))
    assert least == pytest.approx(z @ np.linalg.solve(C, z), rel=1e-6)
