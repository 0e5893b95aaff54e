"""Test the estimate of noise that follows an Ornstein-Uhlenbeck process."""

from types import SimpleNamespace

import numpy as np
import pytest

from forcefit.validation.diagnosis.noise_in_time import (
    NoiseInTime,
    noise_in_time,
    widened,
)

ROWS, STEP, SHARE, CONSTANT = 120, 20.0, 0.7, 300.0
WITHIN_90 = 1.645


def session(rows=ROWS, columns=(3, 4), sessions=None):
    """Return an object with the required attributes of a campaign."""
    cells = np.zeros((rows, 6), dtype=bool)
    cells[:, columns] = True
    time = STEP * np.arange(rows)

    class Rows(SimpleNamespace):
        def __len__(self):
            return rows

    return Rows(covariates={"time": time}, cells=cells, session=sessions, point=None)


def covariance_of(campaign, share=SHARE, constant=CONSTANT):
    """Return the covariance matrix (N, N) of the process."""
    rows, columns = np.nonzero(campaign.cells)
    time = campaign.covariates["time"][rows]
    own = [columns]
    if campaign.session is not None:
        own.append(campaign.session[rows])
    alike = np.all([o[:, None] == o for o in own], axis=0)
    R = share * alike * np.exp(-np.abs(time[:, None] - time) / constant)
    return R + (1 - share) * np.eye(len(rows))


def design(campaign, rng):
    """Return three slowly varying columns, which are a constant, a ramp and a wave."""
    rows, columns = np.nonzero(campaign.cells)
    time = campaign.covariates["time"][rows] / (ROWS * STEP)
    wave = np.sin(2 * np.pi * 1.5 * time + columns)
    return np.column_stack([np.ones(len(rows)), time - 0.5, wave])


@pytest.mark.parametrize("sessions", [None, np.repeat([0, 1], ROWS // 2)])
def test_covariance_under_correlated_noise_equals_matrix_formula(sessions, rng):
    """The covariance of the least-squares estimate is H G'R G H.

    By the Gauss-Markov theorem, generalised least squares has a smaller covariance.
    For R = 1, the covariance is H.
    """
    campaign = session(sessions=sessions)
    campaign.covariates["time"] = np.cumsum(rng.uniform(0, 2 * STEP, ROWS))
    G, R = design(campaign, rng), covariance_of(campaign)
    H = np.linalg.inv(G.T @ G)
    wide = widened(H, G, campaign, NoiseInTime(SHARE, CONSTANT, 0.0))
    assert wide == pytest.approx(H @ G.T @ R @ G @ H, rel=1e-9, abs=1e-15)
    surest = np.linalg.inv(G.T @ np.linalg.inv(R) @ G)
    assert np.linalg.eigvalsh(wide - surest).min() > -1e-12
    assert np.all(np.diag(wide) > 3 * np.diag(H))
    white = widened(H, G, campaign, NoiseInTime(0.0, CONSTANT, 0.0))
    assert np.array_equal(white, H)


@pytest.mark.slow
def test_90_per_cent_intervals_are_valid_under_correlated_noise(rng):
    """Most intervals include the true value, unlike intervals for white noise.

    For 200 campaigns with three unknowns, the expected rate is 0.9 +- 0.012. It is
    slightly lower because the fit removes part of the correlation.
    """
    campaign = session()
    G = design(campaign, rng)
    H = np.linalg.inv(G.T @ G)
    root = np.linalg.cholesky(covariance_of(campaign))
    inside, white, found = [], [], 0
    for _ in range(200):
        z = root @ rng.normal(size=len(G))
        x = H @ G.T @ z
        noise = noise_in_time(campaign, z - G @ x)
        found += noise is not None
        C = H if noise is None else widened(H, G, campaign, noise)
        inside.append(np.abs(x) < WITHIN_90 * np.sqrt(np.diag(C)))
        white.append(np.abs(x) < WITHIN_90 * np.sqrt(np.diag(H)))
    assert found > 190
    assert 0.8 < np.mean(inside) < 0.95
    assert np.mean(white) < 0.65


@pytest.mark.parametrize("covariates", [{}, {"time": np.zeros(ROWS)}])
def test_noise_in_time_is_none_without_recorded_times(covariates, rng):
    campaign = session()
    z = np.linalg.cholesky(covariance_of(campaign)) @ rng.normal(size=2 * ROWS)
    campaign.covariates = covariates
    assert noise_in_time(campaign, z) is None


def test_white_noise_is_not_reported_as_correlated(rng):
    campaign = session()
    drawn = rng.normal(size=(100, int(campaign.cells.sum())))
    assert not any(noise_in_time(campaign, 0.3 * z) for z in drawn)


def by_definition(campaign, z):
    """Return the estimate that maximises the likelihood with the full matrix R."""
    times = campaign.covariates["time"]
    sessions = np.zeros(len(campaign)) if campaign.session is None else campaign.session
    each = [np.sort(times[sessions == s]) for s in np.unique(sessions)]
    steps = np.concatenate([np.diff(t) for t in each])
    best = (-np.inf, 0.0, 0.0)
    for share in (0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95):
        for constant in np.geomspace(
            np.median(steps[steps > 0]), max(np.ptp(t) for t in each), 12
        ):
            R = covariance_of(campaign, share, constant)
            squares = z @ np.linalg.solve(R, z)
            gain = len(z) * np.log(z @ z / squares) - np.linalg.slogdet(R)[1]
            best = max(best, (gain, share, constant))
    return best[1], best[2], np.exp(-best[0] / 2)  # equal to chi2.sf(best[0], 2)


@pytest.mark.parametrize("sessions", [None, np.repeat([0, 1, 1], 12)])
def test_noise_in_time_equals_estimate_from_the_full_matrix(sessions, rng):
    """The rows are not in the order of time, and the time steps differ."""
    campaign = session(36, (1, 3), sessions)
    campaign.covariates["time"] = rng.permutation(np.cumsum(rng.integers(0, 40, 36)))
    root = np.linalg.cholesky(covariance_of(campaign, 0.9, 200.0))
    z = 2.5 * root @ rng.normal(size=72)
    found, expected = noise_in_time(campaign, z), by_definition(campaign, z)
    assert (found.share, found.constant) == pytest.approx(expected[:2])
    assert found.probability == pytest.approx(expected[2], rel=1e-9, abs=0)


def test_noise_in_time_is_independent_between_points(rng):
    """Two points that are measured alternately are two independent series."""
    one, both = session(40), session(80)
    both.point = np.tile(["p", "q"], 40)
    both.covariates["time"] = np.repeat(one.covariates["time"], 2)
    noise = NoiseInTime(SHARE, CONSTANT, 0.0)
    G = design(one, rng)
    H = np.linalg.inv(G.T @ G)
    wide = widened(H, G, one, noise)
    twice = np.repeat(G.reshape(40, 2, 3), 2, axis=0).reshape(160, 3)
    found = widened(H / 2, twice, both, noise)
    assert found == pytest.approx(wide / 2, rel=1e-9)
