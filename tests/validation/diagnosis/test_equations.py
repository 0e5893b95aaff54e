"""I + S G S against its inverse and determinant by numpy."""

import numpy as np
import pytest

from validation.diagnosis.equations import Equations
from validation.diagnosis.evidence import Evidence
from validation.diagnosis.small_terms import GEOMETRY, SmallTerm

COUNT = 30


@pytest.fixture
def products(rng):
    """Of COUNT columns, those from the tenth to the twentieth orthogonal."""
    columns = rng.normal(size=(200, COUNT)) * 10.0 ** rng.uniform(-1, 2, COUNT)
    columns[:, 10:20] = np.linalg.qr(columns[:, 10:20])[0] * np.arange(1, 11)
    return columns.T @ columns, columns.T @ rng.normal(size=200)


@pytest.mark.parametrize("apart", [slice(0), slice(10, 20), slice(12, 18)])
def test_solution_determinant_and_inverse(rng, products, apart):
    G, b = products
    mask = np.zeros(COUNT, bool)
    mask[apart] = True
    size = 10.0 ** rng.uniform(-2, 1, COUNT)
    M = np.eye(COUNT) + G * np.outer(size, size)
    x, log, inverse = Equations(G, b, mask).solved(size)
    np.testing.assert_allclose(x, np.linalg.solve(M, size * b), rtol=1e-8)
    assert log == pytest.approx(np.linalg.slogdet(M)[1] / 2, rel=1e-10)
    np.testing.assert_allclose(inverse, np.diag(np.linalg.inv(M)), rtol=1e-8)


def test_all_apart_is_by_hand():
    """Two unknowns that nothing couples: 1 + s^2 g each."""
    x, log, inverse = Equations(
        np.diag([4.0, 9.0]), np.array([2.0, 3.0]), np.ones(2, bool)
    ).solved(np.array([0.5, 2.0]))
    np.testing.assert_allclose(x, [1 / 2, 6 / 37])
    np.testing.assert_allclose(inverse, [1 / 2, 1 / 37])
    assert log == pytest.approx(np.log(2 * 37) / 2)


def test_nothing_is_asked_of_no_unknowns():
    x, log, inverse = Equations(
        np.zeros((0, 0)), np.zeros(0), np.zeros(0, bool)
    ).solved(np.zeros(0))
    assert len(x) == len(inverse) == 0
    assert log == 0.0


def test_unknowns_of_one_size_may_be_turned(rng):
    """Sizes and evidence are those of the columns, in whatever combinations."""
    axis = np.repeat([0, 3], [12, 8])
    J = rng.normal(size=(150, 20)) @ np.diag(rng.uniform(0.2, 3, 20))
    z = J @ rng.normal(size=20) + rng.normal(size=150)
    turn = np.eye(20)
    turn[:12, :12] = np.linalg.eigh(J[:, :12].T @ J[:, :12])[1]
    priors = []
    for columns in (J, J @ turn):
        term = SmallTerm(
            GEOMETRY, np.zeros(20, int), axis, columns, np.full(20, np.nan), -np.inf,
        )  # fmt: skip
        gram = columns.T @ columns
        if columns is not J:
            gram[:12, :12] = np.diag(np.diag(gram)[:12])
        evidence = Evidence([term], 150, gram)
        priors.append(evidence.best_of(columns.T @ z, float(z @ z)))
    assert priors[1].evidence == pytest.approx(priors[0].evidence, rel=1e-9)
    np.testing.assert_allclose(
        priors[1].scales[GEOMETRY], priors[0].scales[GEOMETRY], rtol=1e-6
    )
