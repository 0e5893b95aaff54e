"""Errors on rows kept aside: which of two models foretells them better."""

import numpy as np
import pytest
from scipy.stats import t

from tests.campaigns_for_tests import campaign_of
from validation.diagnosis.holdout import gain_over_blocks, split

BLOCKS = np.repeat(np.arange(15), 6)


def test_the_gain_is_that_of_student_likelihoods():
    rng = np.random.default_rng(5)
    z = rng.normal(0, 3, (2, len(BLOCKS)))
    gain, _ = gain_over_blocks(*z**2, BLOCKS)
    likelihoods = t.logpdf(z, df=4).sum(axis=1)
    assert gain == pytest.approx(2 * (likelihoods[1] - likelihoods[0]), rel=1e-12)


def test_small_changes_about_one_sigma_count_by_their_squares():
    less, every = 1e-6 * np.arange(len(BLOCKS)), np.ones(len(BLOCKS))
    gain, error = gain_over_blocks(every, every - less, BLOCKS)
    by_block = np.array([less[BLOCKS == k].sum() for k in range(15)])
    assert gain == pytest.approx(less.sum(), rel=1e-4)
    assert error == pytest.approx(by_block.std(ddof=1) * np.sqrt(15), rel=1e-4)


def test_a_row_that_neither_model_foretells_does_not_decide():
    """Seen: 13 rows of 15 better by far, one next to a singularity 6 and 22 sigma."""
    before, after = np.full(len(BLOCKS), 12.0), np.full(len(BLOCKS), 0.8)
    before[BLOCKS == 7], after[BLOCKS == 7] = 35.0, 479.0
    assert np.mean(before) < np.mean(after)
    gain, error = gain_over_blocks(before, after, BLOCKS)
    assert gain > 2 * error > 0


def test_what_is_gained_by_one_is_lost_by_the_other():
    rng = np.random.default_rng(6)
    z = rng.normal(0, 3, (2, len(BLOCKS))) ** 2
    there, back = gain_over_blocks(*z, BLOCKS), gain_over_blocks(*z[::-1], BLOCKS)
    assert there == pytest.approx((-back[0], back[1]))
    assert gain_over_blocks(*z, np.zeros(len(BLOCKS)))[1] == 0.0


def test_the_scatter_of_two_blocks_is_that_of_two_numbers():
    """Gains g and h: their sum, and sqrt(2) times |g - h| / sqrt(2)."""
    before, less = np.ones(4), np.array([1e-6, 2e-6, 5e-6, 7e-6])
    gain, error = gain_over_blocks(before, before - less, np.array([0, 0, 1, 1]))
    assert gain == pytest.approx(15e-6, rel=1e-4)
    assert error == pytest.approx(9e-6, rel=1e-4)
    assert gain_over_blocks(before, before - less, np.zeros(4))[1] == 0.0


@pytest.mark.parametrize(("rows", "kept"), [(1, 0), (2, 1), (3, 1), (7, 1), (9, 2)])
def test_a_quarter_is_kept_aside_and_one_row_of_few(rows, kept):
    parts = split(campaign_of(np.ones((rows, 6)), time=60.0 * np.arange(rows)))
    assert np.sum(~parts.fitted) == kept
