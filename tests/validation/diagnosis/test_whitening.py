"""Test the whitening of noise that is common to several points."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forcefit.assembly.measurement.predict import read
from forcefit.validation.diagnosis.holdout import blocks_of
from forcefit.validation.diagnosis.signatures import conditions_of
from forcefit.validation.diagnosis.whitening import (
    independent,
    platform_motions,
    size_of_noise,
    whitening,
)
from tests.bar_for_tests import bar

VISIT = np.array([3, 0, 3, 3, 7, 0, 9, 9, 9, 9, 3])


def covariance(root, loadings, visit):
    """Return the covariance matrix of the noise of all cells."""
    return np.diag(root**-2.0) + (visit[:, None] == visit) * (loadings @ loadings.T)


@pytest.mark.parametrize("k", [1, 3, 6])
def test_whitened_cells_are_independent(k):
    rng = np.random.default_rng(k)
    root, L = rng.uniform(0.2, 2, 11), 3 * rng.normal(size=(11, k))
    C = covariance(root, L, VISIT)
    whiten = whitening(root, L, VISIT)
    W = whiten(np.eye(11))
    assert W @ C @ W.T == pytest.approx(np.eye(11), abs=1e-12)
    expected = np.linalg.slogdet(C)[1] + 2 * np.log(root).sum()
    assert whiten.log_det == pytest.approx(expected, rel=1e-12)
    values = rng.normal(size=11)
    assert whiten.inverse(whiten(values)) == pytest.approx(values, rel=1e-10)


def two_points(rows=40):
    """Return a campaign in which two points of a bar are measured together."""
    plain = bar(rows=rows)
    every = np.random.default_rng(2).permutation(np.repeat(np.arange(rows), 2))
    seen, which = {}, []
    for i in every.tolist():
        which.append("AB"[seen.setdefault(i, 0)])
        seen[i] += 1
    points = {"A": np.array([0.1, 0, 0.02]), "B": np.array([-0.1, 0.04, 0])}
    campaign = replace(
        plain.take(every), points=points, point=np.array(which),
        ids=tuple(f"m{i}:{name}" for i, name in zip(every, which, strict=True)),
    )  # fmt: skip
    measured = np.zeros((2 * rows, 6))
    measured[:, :3] = np.nan
    return replace(campaign, measured=measured)


def test_platform_motions_are_rotations_about_the_centre_of_the_points():
    """A rotation does not move the mean of the points."""
    campaign = two_points()
    motions = platform_motions(campaign, _reading(campaign))
    centre = np.mean(list(campaign.points.values()), axis=0)
    place = campaign.transforms[:, 1, :3, :3]
    turn = Rotation.from_rotvec([1e-6, -2e-6, 3e-6])
    arm = np.einsum("rij,rj->ri", place, campaign.targets - centre)
    expected = turn.apply(arm) - arm + [4e-6, 5e-6, -6e-6]
    found = motions @ np.array([1e-6, -2e-6, 3e-6, 4e-6, 5e-6, -6e-6])
    assert found[:, 3:] == pytest.approx(expected, abs=1e-11)
    assert found[:, :3] == pytest.approx(np.tile([1e-6, -2e-6, 3e-6], (80, 1)))


def _reading(campaign):
    """Return the changes (R, 6, 6) of the readings per unit screw by differences."""
    conditions, columns = conditions_of(campaign), []
    for k in range(6):
        screw = np.tile(1e-6 * np.eye(6)[k], (len(campaign), 1))
        columns.append((read(conditions, screw) - read(conditions, -screw)) / 2e-6)
    return np.stack(columns, axis=2)


def test_whitened_common_noise_has_unit_covariance():
    campaign = two_points(400)
    rng = np.random.default_rng(4)
    common = np.zeros((800, 6, 3))
    common[:, 3:] = 3 * campaign.sigma[0, 3] * np.eye(3)
    campaign = replace(campaign, common=common)
    shared = rng.normal(size=(400, 3))[campaign.measured_at_once]
    residual = campaign.sigma * rng.normal(size=(800, 6))
    residual += np.einsum("rck,rk->rc", common, shared)
    z = independent(campaign, residual).reshape(800, 3)
    assert np.mean(z**2) == pytest.approx(1, abs=4 * np.sqrt(2 / 2400))
    order = np.argsort(campaign.measured_at_once, kind="stable")
    together = np.mean(z[order[::2]] * z[order[1::2]])
    assert together == pytest.approx(0, abs=4 / np.sqrt(1200))
    size = size_of_noise(campaign)[:, 3:]
    assert size == pytest.approx(np.sqrt(10) * campaign.sigma[:, 3:])


def test_points_measured_together_are_held_out_together():
    campaign = replace(two_points(30), configuration=np.zeros(60, dtype=int))
    blocks = blocks_of(campaign)[0]
    assert len(np.unique(blocks)) > 8
    visit = campaign.measured_at_once
    assert all(len(np.unique(blocks[visit == v])) == 1 for v in visit)
