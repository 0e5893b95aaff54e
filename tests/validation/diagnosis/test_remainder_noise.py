"""Worth and forecasts of candidates in noise beyond sigma, by dense matrices."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from tests.campaigns_for_tests import campaign_of
from tests.validation.diagnosis.test_remainder import (
    CELLS,
    ROWS,
    SCALES,
    SIZES,
    AnyColumns,
)
from validation.diagnosis import remainder as module
from validation.diagnosis.evidence import Prior
from validation.diagnosis.remainder import Remainder, Unexplained
from validation.diagnosis.small_terms import GEOMETRY, SmallTerm

DEGREES = 4.0  # of freedom of Student's t


class Known:
    """Two effects and four small unknowns, what is left of them, and what it costs."""

    def __init__(self, rng, noise, signal, configuration=None, scatter=None):
        axis = np.array([0, 1, 3, 4])
        J, E = rng.normal(size=(CELLS, 4)), rng.normal(size=(CELLS, 2))
        self.E = E / np.linalg.norm(E, axis=0)
        size = np.array(SCALES)[axis // 3]
        self.small, self.noise = J * size, noise
        self.z = self.small @ rng.normal(size=4) + self.E @ [300.0, -200.0] + signal
        self.z += (scatter or noise) * rng.normal(size=CELLS)
        term = SmallTerm(GEOMETRY, np.arange(4), axis, J, np.full(4, np.nan), -np.inf)
        prior = Prior((np.ones(4, bool),), {GEOMETRY: SCALES}, 0.0, 0.0)
        blocks = np.arange(ROWS) if configuration is None else configuration
        self.here = Remainder(
            campaign_of(self.z.reshape(ROWS, 6), repeat=blocks), AnyColumns(),
            Unexplained([term], self.z, 1e-3 * self.E), np.ones(CELLS, bool), prior,
            noise,
        )  # fmt: skip
        self.candidate = self.here.sensitivities.candidate

    def cost(self, further):
        """z' C^-1 z and ln det C, of the covariance with further columns (N, m)."""
        C = self.noise**2 * np.eye(CELLS) + self.small @ self.small.T
        C += 1e9 * self.E @ self.E.T + further @ further.T
        return self.z @ np.linalg.solve(C, self.z), np.linalg.slogdet(C)[1]

    def worth(self, B):
        """By the formula at the head of the module, at the best of the sizes tried."""
        largest = np.linalg.norm(B, axis=0).max()
        alone, lndet = self.cost(0 * B)
        worths = []
        for t in SIZES * self.noise / largest:
            left, more = self.cost(t * B)
            v = np.clip(left / CELLS, self.noise**-2.0, 1.0)
            gain = alone - left / v - CELLS * np.log(v) - (more - lndet)
            worths.append(gain / 2)
        return max(worths)

    def likeliest(self, B):
        """Columns times the size that makes the readings likeliest."""
        found = minimize_scalar(
            lambda log: sum(self.cost(np.exp(log) * B)), (-3.0, 0.0), tol=1e-9
        )
        return np.exp(found.x) * B

    def errors(self, blocks, *further):
        """(N,) squared errors in folds of blocks drawn once, with further columns."""
        X = np.hstack([self.small, 1e4 * self.E, *further])
        of_cell, squares = np.repeat(blocks, 6), np.zeros(CELLS)
        names = np.random.default_rng(1).permutation(np.unique(blocks))
        for part in np.array_split(names, min(5, len(names))):
            apart = np.isin(of_cell, part)
            A = X[~apart].T @ X[~apart] + np.eye(X.shape[1])
            x = np.linalg.solve(A, X[~apart].T @ self.z[~apart])
            squares[apart] = (self.z - X @ x)[apart] ** 2
        return squares


@pytest.mark.parametrize(
    ("noise", "scatter"), [(1.0, 1.0), (1.0, 0.5), (3.0, 4.0), (3.0, 2.0), (3.0, 0.5)]
)
@pytest.mark.parametrize("size", [0.0, 0.1, 3.0, 1e4])
def test_worth_in_noise_beyond_sigma_is_that_of_its_formula(noise, scatter, size, rng):
    """What is left may turn out to be less than the noise, down to sigma."""
    B = rng.normal(size=(CELLS, 3))
    known = Known(rng, noise, size * B @ [0.5, -0.4, 0.2], scatter=scatter)
    found = known.here.worths([known.candidate(B)])[0]
    assert found == pytest.approx(known.worth(B), rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("noise", [1.0, 3.0])
@pytest.mark.parametrize("blocks", [2, 3, 15])
def test_gains_are_those_of_fits_to_the_other_folds(noise, blocks, rng, monkeypatch):
    """By Student's t over the noise; unknowns of their likeliest size, columns alike.

    A forecast is the cost of what is known alone, over sigma.
    """
    B, other = rng.normal(size=(CELLS, 2)), rng.normal(size=(CELLS, 1))
    known = Known(rng, noise, B @ [4.0, -3.0] + other[:, 0])
    block = np.arange(ROWS) % blocks
    monkeypatch.setattr(module, "blocks_of", lambda campaign: (block, "blocks"))
    own, beside = known.likeliest(B), known.likeliest(other)
    costs = [
        (DEGREES + 1) * np.log1p(known.errors(block, *some) / noise**2 / DEGREES)
        for some in ([], [own], [beside])
    ]
    per_block = [[cost[np.repeat(block, 6) == k].sum() for k in range(blocks)]
                 for cost in costs]  # fmt: skip
    for some, k, others, j in (([B], 1, [], 0), ([B], 1, [other], 2)):
        gain, error = known.here.gain(
            [known.candidate(b) for b in some], [known.candidate(b) for b in others]
        )
        gains = np.subtract(per_block[j], per_block[k])
        assert gain == pytest.approx(gains.sum(), rel=1e-3)
        scatter = np.sqrt(blocks) * gains.std(ddof=1)
        assert error == pytest.approx(scatter, rel=1e-2)
    forecast = (DEGREES + 1) * np.log1p(known.errors(block) / DEGREES)
    assert known.here.forecast() == pytest.approx(forecast.sum(), rel=1e-6)


def test_of_a_single_block_nothing_is_foretold(rng, monkeypatch):
    known = Known(rng, 1.0, 0.0)
    monkeypatch.setattr(module, "blocks_of", lambda c: (np.zeros(ROWS, int), "one"))
    assert known.here.gain([known.candidate(rng.normal(size=(CELLS, 1)))]) == (0.0, 0.0)
    assert known.here.forecast() == 0.0


@pytest.mark.parametrize(("gain", "error", "foretold"), [
    (2.1, 1.0, True), (1.9, 1.0, False), (21.0, 10.0, True), (19.0, 10.0, False),
    (-1.0, 0.0, False), (1.0, 0.0, True),
])  # fmt: skip
def test_rows_are_foretold_where_errors_fall_by_two_standard_errors(
    gain, error, foretold, rng
):
    here = Known(rng, 1.0, 0.0).here
    here.gain = lambda some: (gain, error)
    assert here.foretells([]) is foretold


@pytest.mark.parametrize(("configurations", "successive"), [(7, True), (8, False)])
def test_rows_of_few_configurations_are_apart_in_time_only(
    configurations, successive, rng
):
    known = Known(rng, 1.0, 0.0, np.arange(ROWS) % configurations)
    assert known.here.successive is successive
